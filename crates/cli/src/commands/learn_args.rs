//! The flags of `learn`.

use clap::{Args, ValueEnum};
use softrast_inverse::{Input, LearnConfig, OuterLoss, SIGMA};
use softrast_lab::parse::{count, positive, whole};
use softrast_meta::{MetaGradient, OuterSteps};

/// Flags that say how to learn.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct LearnArgs {
    /// How the meta-gradient is taken: unrolled, truncated:K, direct, alternating, es or es:S [default: es for few parameters, else unrolled]
    #[arg(long, alias = "order", value_name = "NAME", value_parser = estimator)]
    estimator: Option<Estimator>,
    /// Updates of the softness [default: 50]
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    outer: Option<usize>,
    /// Steps of each optimisation that is learned through [default: those of the task]
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    pub(super) inner: Option<usize>,
    /// Instances for each update [default: 8]
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    batch: Option<usize>,
    /// Largest move of a parameter in an update, roughly [default: 0.03]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    outer_rate: Option<f64>,
    /// Learn the inner learning rate along with the softness; with --estimator es
    #[arg(long)]
    learn_rate: bool,
    /// Instances that decide which softness is kept [default: 8]
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    validation_runs: Option<usize>,
    /// End after so many validations that found nothing better [default: never]
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    patience: Option<usize>,
    /// The image that the outer loss is taken of [default: fixed; own for direct, which sees nothing else]
    #[arg(long, alias = "referee", value_enum)]
    outer_loss: Option<OuterLossArg>,
    /// The inner steps after which the outer loss is taken [default: last]
    #[arg(long, alias = "judged", value_enum)]
    outer_steps: Option<OuterStepsArg>,
    /// Numbers that describe how a moving scale moves [default: 3, or those of the file]
    #[arg(long, value_name = "N", value_parser = whole::<1, 5>, allow_negative_numbers = true)]
    knots: Option<usize>,
    /// What a softness whose scale stays is a function of [default: ndc]
    #[arg(long, value_enum)]
    input: Option<InputArg>,
    /// Pixels that a learned width or a moving scale stays above [default: 0.03]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    floor: Option<f64>,
}

/// How the gradient is taken, as the command line names it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Estimator {
    Alternating,
    Other(MetaGradient),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum OuterLossArg {
    /// A fixed narrow softness on a finer image
    Fixed,
    /// The same on the image's own pixels
    Pixels,
    /// The hard image; it has no gradient
    Hard,
    /// The loss that was optimised, as in the paper
    Own,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum OuterStepsArg {
    /// After the last step
    #[value(alias = "end")]
    Last,
    /// After a quarter, half and all of the steps
    Quarters,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum InputArg {
    /// The distance in NDC, as in the paper
    Ndc,
    /// The distance over a learned width
    Relative,
}

fn estimator(text: &str) -> Result<Estimator, String> {
    const EXPECTED: &str = "expected unrolled, truncated:K, direct, alternating, es or es:S";
    let es = |sigma| MetaGradient::EvolutionStrategy { sigma, pairs: 1 };
    let estimator = match text.split_once(':') {
        None => match text {
            "alternating" | "joint" => return Ok(Estimator::Alternating),
            "unrolled" => MetaGradient::default(),
            "direct" => MetaGradient::Direct,
            "es" => es(SIGMA),
            _ => return Err(EXPECTED.into()),
        },
        Some(("truncated", steps)) => {
            MetaGradient::Truncated { steps: count(steps)?, clip: Some(1.0) }
        }
        Some(("es", sigma)) => es(positive(sigma)?),
        Some(_) => return Err(EXPECTED.into()),
    };
    Ok(Estimator::Other(estimator))
}

impl LearnArgs {
    /// `seed` is added to the seeds of training and validation.
    pub(super) fn config(&self, seed: u64) -> LearnConfig {
        let usual = LearnConfig::default();
        let outer_rate = self.outer_rate.unwrap_or(usual.outer_rate);
        LearnConfig {
            estimator: self.estimator.map(|estimator| match estimator {
                Estimator::Alternating => {
                    MetaGradient::AlternatingDescent { learning_rate: outer_rate }
                }
                Estimator::Other(estimator) => estimator,
            }),
            updates: self.outer.unwrap_or(usual.updates),
            batch: self.batch.unwrap_or(usual.batch),
            outer_rate,
            learn_rate: self.learn_rate,
            seed: usual.seed.saturating_add(seed),
            validation_seed: usual.validation_seed.saturating_add(seed),
            validation_runs: self.validation_runs.unwrap_or(usual.validation_runs),
            patience: self.patience,
            outer_loss: self.outer_loss.map(|image| match image {
                OuterLossArg::Fixed => OuterLoss::Fixed,
                OuterLossArg::Pixels => OuterLoss::Pixels,
                OuterLossArg::Hard => OuterLoss::Hard,
                OuterLossArg::Own => OuterLoss::Own,
            }),
            outer_steps: match self.outer_steps {
                None | Some(OuterStepsArg::Last) => OuterSteps::Last,
                Some(OuterStepsArg::Quarters) => OuterSteps::Quarters,
            },
            knots: self.knots,
            input: match self.input {
                None | Some(InputArg::Ndc) => Input::Ndc,
                Some(InputArg::Relative) => Input::Relative,
            },
            floor_px: self.floor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_have_the_names_of_the_documentation() {
        let es = |sigma| Ok(Estimator::Other(MetaGradient::EvolutionStrategy { sigma, pairs: 1 }));
        assert_eq!([estimator("es"), estimator("es:0.3")], [es(0.2), es(0.3)]);
        let truncated = MetaGradient::Truncated { steps: 5, clip: Some(1.0) };
        assert_eq!(estimator("truncated:5"), Ok(Estimator::Other(truncated)));
        for wrong in ["truncated", "truncated:0", "unrolled:3", "second", "es:0", "es:x"] {
            assert!(estimator(wrong).is_err(), "{wrong}");
        }
        let joint = LearnArgs {
            estimator: Some(Estimator::Alternating),
            outer_rate: Some(0.5),
            ..LearnArgs::default()
        };
        assert_eq!(
            joint.config(3).estimator,
            Some(MetaGradient::AlternatingDescent { learning_rate: 0.5 })
        );
        assert_eq!(joint.config(3).validation_seed, 2_000_003);
    }
}
