use clap::{Args, ValueEnum};
use serde::Serialize;

use crate::{
    Command, Error, Variant,
    settings::{count, positive},
};

/// Flags that say how to learn.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct LearnFlags {
    /// How `learn` gets its gradient: unrolled (exact, through all inner steps), truncated:K (the last
    /// K), direct (at the end alone), joint (down the inner loss), es or es:S (differences of whole runs whose
    /// parameters are S apart, 0.2 if not said) [default: es for a softness of few parameters, unrolled for an mlp].
    #[arg(long, value_name = "ORDER", value_parser = order)]
    order: Option<Order>,

    /// Updates of the softness [default: 50].
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    outer: Option<usize>,

    /// Steps of each optimisation that is learned through [default: the steps of the task].
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    inner: Option<usize>,

    /// Instances for each update [default: 8].
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    batch: Option<usize>,

    /// Largest move of a parameter of the softness in an update, roughly [default: 0.03].
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    outer_rate: Option<f64>,

    /// Learn the logarithm of the inner learning rate along with the softness; with --order es.
    #[arg(long)]
    learn_rate: bool,

    /// Instances that decide which softness is kept [default: 8].
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    validation_runs: Option<usize>,

    /// End after so many validations that found nothing better [default: never].
    #[arg(long, value_name = "N", value_parser = count, allow_negative_numbers = true)]
    patience: Option<usize>,

    /// What judges a result: a fixed narrow softness on a finer image (fixed) or on the image's own
    /// pixels (pixels), the hard image (hard), or the loss that was optimised (own) [default: fixed; own
    /// for direct, which sees nothing else].
    #[arg(long, value_enum)]
    referee: Option<Referee>,

    /// When it judges: after the last step, or also after a quarter and half of them [default: end].
    #[arg(long, value_enum)]
    judged: Option<Judged>,

    /// Numbers that describe how the scale moves, where it does (--schedule decay) [default: 3].
    #[arg(long, value_name = "N", value_parser = knots, allow_negative_numbers = true)]
    knots: Option<usize>,

    /// What a softness whose scale stays sees: the distance as it is, or divided by a width that is
    /// learned along with it [default: ndc].
    #[arg(long, value_enum)]
    input: Option<Input>,

    /// Pixels that a learned width or a moving scale stays above [default: 0.03].
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    floor: Option<f64>,
}

/// What a task has to know to have a softness learned on it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// What it is learned on.
    pub variant: Variant,
    /// How the gradient is taken.
    pub order: Order,
    /// Updates of the softness.
    pub outer: usize,
    /// Instances for each.
    pub batch: usize,
    /// Learning rate of the updates.
    pub outer_rate: f64,
    /// Whether the learning rate of the inner loop is learned too.
    pub learn_rate: bool,
    /// Seed of the first training instance.
    pub seed: u64,
    /// Seed of the first validation instance.
    pub validation_seed: u64,
    /// Instances to validate on.
    pub validation_runs: usize,
    /// Validations in vain before learning ends early.
    pub patience: Option<usize>,
    /// What judges a result.
    pub referee: Referee,
    /// When it judges.
    pub judged: Judged,
    /// Knots of a scale that moves.
    pub knots: usize,
    /// What a softness sees whose scale does not.
    pub input: Input,
    /// What it stays above, in pixels.
    pub floor_px: f64,
}

/// How the derivative of the outer loss is taken; see `MetaGradient` of `softrast-meta`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Exactly, through every inner step.
    Unrolled,
    /// Through the last steps.
    Truncated(usize),
    /// At the end alone, as in the released shape code.
    Direct,
    /// Not at all: the softness goes down the inner loss, as in the released pose code.
    Joint,
    /// By differences, from runs whose parameters are so far off, on average.
    Es(f64),
}

/// What judges the result of an inner loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Referee {
    /// A fixed narrow softness on a finer image, which no learned softness can flatter.
    Fixed,
    /// The same on the image's own pixels, on which the hard errors of tables are taken as well.
    Pixels,
    /// The hard image, by which tables compare. It has no gradient, so it goes with what takes none of it.
    Hard,
    /// The loss that was optimised, under the learned softness itself, as in the paper.
    Own,
}

/// What a softness whose scale stays is a function of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Input {
    /// The distance in NDC, as in the paper.
    Ndc,
    /// The distance over a learned width: a path of one knot.
    Relative,
}

/// After which inner steps results are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Judged {
    /// The last.
    End,
    /// A quarter, half and all of them.
    Quarters,
}

/// Seeds of training instances count from here, as in a search, and those of validation from there;
/// `evaluate` counts from 0.
const TRAINING_SEED: u64 = crate::search::TRAINING_SEED;
const VALIDATION_SEED: u64 = 2 * TRAINING_SEED;

impl LearnFlags {
    /// Inner steps, if the command line names them.
    pub(crate) fn inner(&self) -> Option<usize> {
        self.inner
    }

    /// The plan that the flags make for a softness of so many parameters; `seed` is added to the seeds of training and
    /// validation.
    ///
    /// # Errors
    ///
    /// If flags contradict each other.
    pub(crate) fn plan(
        &self,
        variant: Variant,
        seed: u64,
        parameters: usize,
    ) -> Result<Plan, Error> {
        // As good as an exact gradient where there are few, and cheaper (docs/estimators.md).
        let usual = if parameters <= FEW { Order::Es(SIGMA) } else { Order::Unrolled };
        let order = self.order.unwrap_or(usual);
        let direct = order == Order::Direct;
        if direct && !matches!(self.referee, None | Some(Referee::Own)) {
            let message = "--order direct sees how the loss depends on the softness where a run ends, \
                           and a fixed referee does not: leave out --referee";
            return Err(Error::Usage(message.into()));
        }
        if self.referee == Some(Referee::Hard) && !matches!(order, Order::Es(_) | Order::Joint) {
            let message = "a hard image has no gradient: --referee hard needs --order es or joint";
            return Err(Error::Usage(message.into()));
        }
        if self.learn_rate && !matches!(order, Order::Es(_)) {
            let message =
                "--learn-rate needs --order es: the others differentiate by the softness alone";
            return Err(Error::Usage(message.into()));
        }
        Ok(Plan {
            variant,
            order,
            outer: self.outer.unwrap_or(50),
            batch: self.batch.unwrap_or(8),
            outer_rate: self.outer_rate.unwrap_or(0.03),
            learn_rate: self.learn_rate,
            seed: TRAINING_SEED.saturating_add(seed),
            validation_seed: VALIDATION_SEED.saturating_add(seed),
            validation_runs: self.validation_runs.unwrap_or(8),
            patience: self.patience,
            referee: self.referee.unwrap_or(if direct { Referee::Own } else { Referee::Fixed }),
            judged: self.judged.unwrap_or(Judged::End),
            knots: self.knots.unwrap_or(3),
            input: self.input.unwrap_or(Input::Ndc),
            floor_px: self.floor.unwrap_or(0.03),
        })
    }

    /// Refuses flags that mean nothing to the command.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] that names the flag.
    pub(crate) fn check(&self, command: Command) -> Result<(), Error> {
        let given = [
            (self.order.is_some(), "--order"),
            (self.outer.is_some(), "--outer"),
            (self.inner.is_some(), "--inner"),
            (self.batch.is_some(), "--batch"),
            (self.outer_rate.is_some(), "--outer-rate"),
            (self.learn_rate, "--learn-rate"),
            (self.validation_runs.is_some(), "--validation-runs"),
            (self.patience.is_some(), "--patience"),
            (self.referee.is_some(), "--referee"),
            (self.judged.is_some(), "--judged"),
            (self.knots.is_some(), "--knots"),
            (self.input.is_some(), "--input"),
            (self.floor.is_some(), "--floor"),
        ];
        match given.into_iter().find(|(given, _)| *given && command != Command::Learn) {
            None => Ok(()),
            Some((_, flag)) => {
                let command = command.name();
                Err(Error::Usage(format!("{flag} goes with learn, not with {command}")))
            }
        }
    }
}

/// What `es` alone means. The entries of φ are mostly logarithms.
const SIGMA: f64 = 0.2;
/// A softness of no more parameters is learned by `es` unless the command line says otherwise.
const FEW: usize = 10;
const ORDERS: &str = "expected unrolled, truncated:K, direct, joint, es or es:S";

fn order(text: &str) -> Result<Order, String> {
    match text.split_once(':') {
        None => match text {
            "unrolled" => Ok(Order::Unrolled),
            "direct" => Ok(Order::Direct),
            "joint" => Ok(Order::Joint),
            "es" => Ok(Order::Es(SIGMA)),
            _ => Err(ORDERS.into()),
        },
        Some(("truncated", steps)) => count(steps).map(Order::Truncated),
        Some(("es", sigma)) => positive(sigma).map(Order::Es),
        Some(_) => Err(ORDERS.into()),
    }
}

/// A path of more knots would follow the noise.
const MOST_KNOTS: usize = 5;

fn knots(text: &str) -> Result<usize, String> {
    let knots = text.parse().ok().filter(|n| (1..=MOST_KNOTS).contains(n));
    knots.ok_or_else(|| format!("expected a whole number from 1 to {MOST_KNOTS}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_have_the_names_of_the_documentation() {
        assert_eq!(order("truncated:5"), Ok(Order::Truncated(5)));
        assert_eq!([order("es"), order("es:0.3")], [0.2, 0.3].map(|s| Ok(Order::Es(s))));
        for wrong in ["truncated", "truncated:0", "unrolled:3", "second", "es:0", "es:x"] {
            assert!(order(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_direct_gradient_needs_a_referee_that_sees_the_softness() {
        let direct = LearnFlags { order: Some(Order::Direct), ..LearnFlags::default() };
        assert_eq!(direct.plan(Variant::Original, 0, 1).unwrap().referee, Referee::Own);
        let fixed = LearnFlags { referee: Some(Referee::Fixed), ..direct };
        assert!(fixed.plan(Variant::Original, 0, 1).is_err());
        let seeds = LearnFlags::default().plan(Variant::Original, 3, 1).unwrap();
        assert_eq!((seeds.seed, seeds.validation_seed), (1_000_003, 2_000_003));
    }

    #[test]
    fn few_parameters_are_learned_by_differences_and_many_by_derivatives() {
        let hard =
            |order| LearnFlags { referee: Some(Referee::Hard), order, ..LearnFlags::default() };
        let rate = LearnFlags { learn_rate: true, ..LearnFlags::default() };
        for flags in [hard(None), hard(Some(Order::Es(0.1))), rate] {
            assert!(flags.plan(Variant::Original, 0, 1).is_ok());
            assert!(flags.order.is_some() || flags.plan(Variant::Original, 0, MLP).is_err());
        }
        let order = |parameters| {
            LearnFlags::default().plan(Variant::Original, 0, parameters).unwrap().order
        };
        assert_eq!([order(4), order(MLP)], [Order::Es(SIGMA), Order::Unrolled]);
    }

    /// Weights of the network.
    const MLP: usize = 56;
}
