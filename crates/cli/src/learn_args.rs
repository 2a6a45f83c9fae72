//! The flags of `learn`.

use clap::Args;
use softrast_inverse::{Input, LearnConfig, OuterLoss, SIGMA};
use softrast_lab::parse::{count, named, positive, whole};
use softrast_meta::{MetaGradient, OuterSteps};

/// Settings of learning.
#[derive(Args, Clone, Debug)]
pub(crate) struct LearnArgs {
    /// Estimator of the meta-gradient: unrolled, truncated:K, direct, alternating, es or es:S
    /// [default: es for few parameters, else unrolled]
    #[arg(long, value_name = "NAME", value_parser = estimator)]
    estimator: Option<MetaGradient>,
    /// Updates of the softness
    #[arg(long, value_name = "N", value_parser = count, default_value_t = 50, allow_negative_numbers = true, alias = "outer")]
    updates: usize,
    /// Instances per update
    #[arg(long, value_name = "N", value_parser = count, default_value_t = 8, allow_negative_numbers = true)]
    batch: usize,
    /// Largest move of a parameter in an update, roughly
    #[arg(long, value_name = "X", value_parser = positive, default_value_t = 0.03, allow_negative_numbers = true)]
    outer_rate: f64,
    /// Also learn the inner learning rate; with --estimator es
    #[arg(long)]
    learn_rate: bool,
    /// Learn an adaptive schedule: the error of a run controls its scale, learning rate and restarts; starts from a decay
    #[arg(long, alias = "feedback")]
    adaptive: bool,
    /// Held-out instances for selecting the softness
    #[arg(long, value_name = "N", value_parser = count, default_value_t = 8, allow_negative_numbers = true)]
    validation_runs: usize,
    /// End after this many consecutive validations without an improvement [default: never]
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    patience: Option<usize>,
    /// Outer loss: a fixed narrow softness on a finer image or on the image's own pixels, the hard image of the last
    /// step or of the returned one, which have no gradient, or the inner loss itself, as in the paper [default: fixed;
    /// own for direct, which needs it; returned with an adaptive schedule]
    #[arg(long, value_name = "fixed|pixels|hard|returned|own", value_parser = named::<OuterLoss>)]
    outer_loss: Option<OuterLoss>,
    /// The inner steps after which the outer loss is evaluated: the last, or a quarter, half and all of them [default: last]
    #[arg(long, value_name = "last|quarters", value_parser = named::<OuterSteps>)]
    outer_steps: Option<OuterSteps>,
    /// Knots of the schedule of a moving scale [default: 3, or those of the file]
    #[arg(long, value_name = "N", value_parser = whole::<1, 5>, allow_negative_numbers = true)]
    knots: Option<usize>,
    /// Variable of a softness with a fixed width: the distance in NDC, as in the paper, or the distance over a learned width [default: ndc]
    #[arg(long, value_name = "ndc|relative", value_parser = named::<Input>)]
    input: Option<Input>,
    /// Lower limit of a learned width or a moving scale, in pixels [default: 0.03]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    floor: Option<f64>,
}

/// Parses an estimator; the learning rate of alternating descent is set later to that of the updates.
fn estimator(text: &str) -> Result<MetaGradient, String> {
    let es = |sigma| MetaGradient::EvolutionStrategy { sigma, pairs: 1 };
    Ok(match (text, text.split_once(':')) {
        ("unrolled", _) => MetaGradient::default(),
        ("direct", _) => MetaGradient::Direct,
        ("alternating", _) => MetaGradient::AlternatingDescent { learning_rate: f64::NAN },
        ("es", _) => es(SIGMA),
        (_, Some(("es", sigma))) => es(positive(sigma)?),
        (_, Some(("truncated", steps))) => {
            MetaGradient::Truncated { steps: count(steps)?, clip: Some(1.0) }
        }
        _ => return Err("expected unrolled, truncated:K, direct, alternating, es or es:S".into()),
    })
}

impl LearnArgs {
    /// `seed` is added to the seeds of training and validation.
    pub(crate) fn config(self, seed: u64) -> LearnConfig {
        let usual = LearnConfig::default();
        let mut estimator = self.estimator;
        if let Some(MetaGradient::AlternatingDescent { learning_rate }) = &mut estimator {
            *learning_rate = self.outer_rate;
        }
        LearnConfig {
            estimator,
            updates: self.updates,
            batch: self.batch,
            outer_rate: self.outer_rate,
            learn_rate: self.learn_rate,
            adaptive: self.adaptive,
            seed: usual.seed.saturating_add(seed),
            validation_seed: usual.validation_seed.saturating_add(seed),
            validation_runs: self.validation_runs,
            patience: self.patience,
            outer_loss: self.outer_loss,
            outer_steps: self.outer_steps.unwrap_or(usual.outer_steps),
            knots: self.knots,
            input: self.input.unwrap_or(usual.input),
            floor_px: self.floor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::usual_args;

    #[test]
    fn estimators_have_the_names_of_the_documentation() {
        let es = |sigma| Ok(MetaGradient::EvolutionStrategy { sigma, pairs: 1 });
        assert_eq!([estimator("es"), estimator("es:0.3")], [es(0.2), es(0.3)]);
        let truncated = MetaGradient::Truncated { steps: 5, clip: Some(1.0) };
        assert_eq!(estimator("truncated:5"), Ok(truncated));
        for wrong in ["truncated", "truncated:0", "unrolled:3", "second", "es:0", "es:x"] {
            assert!(estimator(wrong).is_err(), "{wrong}");
        }
        let usual: LearnArgs = usual_args();
        let alternating = estimator("alternating").ok();
        let config = LearnArgs { estimator: alternating, outer_rate: 0.5, ..usual }.config(3);
        let expected = MetaGradient::AlternatingDescent { learning_rate: 0.5 };
        assert_eq!((config.estimator, config.validation_seed), (Some(expected), 2_000_003));
    }

    #[test]
    fn a_line_that_says_nothing_learns_by_the_defaults_of_the_library() {
        assert_eq!(usual_args::<LearnArgs>().config(0), LearnConfig::default());
    }
}
