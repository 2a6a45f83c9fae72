use anyhow::{bail, ensure};
use serde::{Deserialize, Serialize};
use softrast_meta::{MetaGradient, OuterSteps};
use softrast_softness::Softness;

use crate::ScheduledSoftness;

/// Settings for learning a softness.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LearnConfig {
    /// Estimator of the meta-gradient. By default an evolution strategy if the softness has up to ten parameters or
    /// an adaptive schedule, or the outer loss is [`OuterLoss::Returned`]; else [`MetaGradient::default`].
    pub estimator: Option<MetaGradient>,
    /// Updates of the softness.
    pub updates: usize,
    /// Instances per update.
    pub batch: usize,
    /// Learning rate of the updates.
    pub outer_rate: f64,
    /// Whether the logarithm of the inner learning rate is learned too.
    pub learn_rate: bool,
    /// Whether a softness with a moving scale learns an adaptive schedule, starting from
    /// [`AdaptiveSchedule::START`](crate::AdaptiveSchedule::START).
    pub adaptive: bool,
    /// Seed of the first training instance.
    pub seed: u64,
    /// Seed of the first validation instance.
    pub validation_seed: u64,
    /// Number of validation instances.
    pub validation_runs: usize,
    /// Validations without an improvement before learning ends early.
    pub patience: Option<usize>,
    /// The outer loss. By default [`OuterLoss::Own`] for [`MetaGradient::Direct`],
    /// [`OuterLoss::Returned`] with an adaptive schedule, else [`OuterLoss::Fixed`].
    pub outer_loss: Option<OuterLoss>,
    /// Steps after which the outer loss is evaluated.
    pub outer_steps: OuterSteps,
    /// Knots of a moving scale; by default three, or those of the softness file.
    pub knots: Option<usize>,
    /// The variable of a softness with a fixed scale.
    pub input: Input,
    /// Floor of a learned scale, in pixels; by default 0.03, or that of the softness file.
    pub floor_px: Option<f64>,
}

/// The loss of the result of an inner loop.
///
/// [`Learning`](crate::Learning) has an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OuterLoss {
    /// A fixed narrow softness on an image of twice the size, independent of the learned softness.
    Fixed,
    /// A fixed narrow softness on the image's own pixels, on which the hard errors of tables are taken too.
    Pixels,
    /// The hard image, by which tables compare. It has no gradient: only for estimators that do not differentiate it.
    Hard,
    /// The hard image at the returned step, that of the least error, under an evolution strategy. It is the square root
    /// of the error, so that a few failed runs do not hide the differences of the others.
    Returned,
    /// The inner loss itself, under the learned softness, as in the paper.
    Own,
}

/// The variable of a softness with a fixed scale.
///
/// ```
/// use softrast_inverse::{Input, LearnConfig, PhiLayout, ScheduledSoftness};
/// use softrast_softness::{EdgeSoftness, Family};
///
/// let network = ScheduledSoftness::constant(EdgeSoftness::new(Family::Mlp), 0.1);
/// let parameters = [Input::Ndc, Input::Relative].map(|input| {
///     let config = LearnConfig { input, ..LearnConfig::default() };
///     PhiLayout::learned(&network, Vec::new(), 100, 64, &config).start().len()
/// });
/// assert_eq!(parameters, [56, 57]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Input {
    /// The distance in NDC, as in the paper.
    Ndc,
    /// The distance over a learned width: a schedule of one knot.
    Relative,
}

/// First seeds of training and of validation; reported runs count from 0.
const TRAINING_SEED: u64 = 1_000_000;
/// Up to this many parameters are learned by differences, which is as good there and cheaper (docs/studies/estimators.md).
const FEW: usize = 10;
/// Default standard deviation of an evolution strategy: entries of φ are mostly logarithms.
pub const SIGMA: f64 = 0.2;

impl Default for LearnConfig {
    fn default() -> Self {
        Self {
            estimator: None,
            updates: 50,
            batch: 8,
            outer_rate: 0.03,
            learn_rate: false,
            adaptive: false,
            seed: TRAINING_SEED,
            validation_seed: 2 * TRAINING_SEED,
            validation_runs: 8,
            patience: None,
            outer_loss: None,
            outer_steps: OuterSteps::Last,
            knots: None,
            input: Input::Ndc,
            floor_px: None,
        }
    }
}

impl LearnConfig {
    /// This configuration with its defaults resolved for the start softness and the number of the problem's `own` parameters.
    ///
    /// # Errors
    ///
    /// If choices contradict each other.
    pub fn resolved(
        &self,
        softness: &ScheduledSoftness<impl Softness>,
        own: usize,
    ) -> anyhow::Result<Self> {
        let (parameters, has_surrogate) =
            (softness.parameters() + own, softness.surrogate.is_some());
        let is_adaptive = self.adaptive || softness.adaptive.is_some();
        ensure!(
            !self.adaptive || !softness.is_constant(),
            "--adaptive moves the scale along its schedule: add --schedule decay"
        );
        let es = MetaGradient::EvolutionStrategy { sigma: SIGMA, pairs: 1 };
        let few = parameters <= FEW || is_adaptive || self.outer_loss == Some(OuterLoss::Returned);
        let usual = if few { es } else { MetaGradient::default() };
        let estimator = self.estimator.unwrap_or(usual);
        let differences = matches!(estimator, MetaGradient::EvolutionStrategy { .. });
        let along = matches!(estimator, MetaGradient::AlternatingDescent { .. });
        let direct = estimator == MetaGradient::Direct;
        let usual = match direct {
            true => OuterLoss::Own,
            false if is_adaptive => OuterLoss::Returned,
            false => OuterLoss::Fixed,
        };
        let outer_loss = self.outer_loss.unwrap_or(usual);
        ensure!(
            !direct || outer_loss == OuterLoss::Own,
            "--estimator direct sees how the loss depends on the softness where a run ends, and a fixed outer loss does not: leave out --outer-loss"
        );
        ensure!(
            outer_loss != OuterLoss::Hard || differences || along,
            "a hard image has no gradient: --outer-loss hard needs --estimator es or alternating"
        );
        ensure!(
            outer_loss != OuterLoss::Returned || (differences && own == 0),
            "--outer-loss returned needs --estimator es, and a task whose softness is that of its edges alone"
        );
        ensure!(
            !is_adaptive || outer_loss == OuterLoss::Returned,
            "an adaptive schedule depends on the hard image, which has no gradient: it needs --estimator es and --outer-loss returned"
        );
        ensure!(
            softness.rate_end.is_none() || !is_adaptive,
            "an adaptive schedule moves the learning rate itself: leave out --rate-end, or begin with a softness without one"
        );
        ensure!(
            softness.rate_end.is_none_or(|end| end == 1.0) || outer_loss == OuterLoss::Returned,
            "a rate that falls is followed where runs are judged by what they return: leave out --rate-end, or add --outer-loss returned"
        );
        ensure!(
            !self.learn_rate || differences,
            "--learn-rate needs --estimator es: the others differentiate by the softness alone"
        );
        if has_surrogate && (along || outer_loss == OuterLoss::Own) {
            bail!(
                "a surrogate is learned with --estimator unrolled, truncated:K or es, and with --outer-loss fixed, pixels or hard: all \
                 else follows the image's \
                 own derivative, which it replaces"
            );
        }
        Ok(Self { estimator: Some(estimator), outer_loss: Some(outer_loss), ..self.clone() })
    }

    /// Pixels a side of the image of the outer loss, as a multiple of those of the optimised image.
    pub(crate) fn finer(&self) -> usize {
        match self.outer_loss {
            None | Some(OuterLoss::Fixed | OuterLoss::Own) => 2,
            Some(OuterLoss::Pixels | OuterLoss::Hard | OuterLoss::Returned) => 1,
        }
    }

    /// Whether the estimator differentiates through runs.
    pub(crate) fn differentiates(&self) -> bool {
        !matches!(self.estimator, Some(MetaGradient::EvolutionStrategy { .. }))
    }
}

#[cfg(test)]
mod tests {
    use softrast_softness::{EdgeSoftness, Family};

    use super::*;

    fn with(estimator: MetaGradient) -> LearnConfig {
        LearnConfig { estimator: Some(estimator), ..LearnConfig::default() }
    }

    /// A softness with one parameter or many.
    fn start(family: Family, has_surrogate: bool) -> ScheduledSoftness {
        let start = ScheduledSoftness::constant(EdgeSoftness::new(family), 0.1);
        if has_surrogate { start.with_surrogate_scale(0.2) } else { start }
    }

    fn resolved(config: &LearnConfig, family: Family) -> anyhow::Result<LearnConfig> {
        config.resolved(&start(family, false), 0)
    }

    #[test]
    fn a_direct_gradient_needs_a_loss_that_sees_the_softness() {
        let direct = with(MetaGradient::Direct);
        let found = resolved(&direct, Family::Gauss).unwrap();
        assert_eq!(found.outer_loss, Some(OuterLoss::Own));
        let fixed = LearnConfig { outer_loss: Some(OuterLoss::Fixed), ..direct };
        assert!(resolved(&fixed, Family::Gauss).is_err());
    }

    #[test]
    fn few_parameters_are_learned_by_differences_and_many_by_derivatives() {
        let usual = LearnConfig::default();
        let estimator = |family| resolved(&usual, family).unwrap().estimator.unwrap();
        assert!(matches!(estimator(Family::Gauss), MetaGradient::EvolutionStrategy { .. }));
        assert_eq!(estimator(Family::Mlp), MetaGradient::default());
        let hard = LearnConfig { outer_loss: Some(OuterLoss::Hard), ..LearnConfig::default() };
        let rate = LearnConfig { learn_rate: true, ..LearnConfig::default() };
        for config in [hard, rate] {
            assert!(resolved(&config, Family::Gauss).is_ok());
            assert!(resolved(&config, Family::Mlp).is_err());
        }
    }

    #[test]
    fn a_falling_rate_needs_the_returned_loss_and_no_adaptive_schedule() {
        let decay = EdgeSoftness::new(Family::Gauss);
        let softness =
            ScheduledSoftness { rate_end: Some(0.2), ..ScheduledSoftness::decay(decay, 0.1, 0.01) };
        let plain = LearnConfig::default();
        let returned = LearnConfig { outer_loss: Some(OuterLoss::Returned), ..plain.clone() };
        let adaptive = LearnConfig { adaptive: true, ..plain.clone() };
        assert!(returned.resolved(&softness, 0).is_ok());
        for wrong in [plain, adaptive] {
            let refused = wrong.resolved(&softness, 0).unwrap_err().to_string();
            assert!(refused.contains("leave out --rate-end"), "{refused}");
        }
    }

    #[test]
    fn an_adaptive_schedule_is_learned_by_differences_of_the_returned_loss() {
        let config = LearnConfig { adaptive: true, ..LearnConfig::default() };
        assert!(resolved(&config, Family::Gauss).is_err(), "a fixed scale has no schedule");
        let gauss = EdgeSoftness::new(Family::Gauss);
        let moving = ScheduledSoftness::decay(gauss, 0.1, 0.01);
        let found = config.resolved(&moving, 0).unwrap();
        assert_eq!(found.outer_loss, Some(OuterLoss::Returned));
        assert!(matches!(found.estimator, Some(MetaGradient::EvolutionStrategy { .. })));
        let unrolled = LearnConfig { adaptive: true, ..with(MetaGradient::default()) };
        let hard = LearnConfig { outer_loss: Some(OuterLoss::Hard), ..config.clone() };
        assert!(unrolled.resolved(&moving, 0).is_err() && hard.resolved(&moving, 0).is_err());
        assert!(config.resolved(&moving, 1).is_err());
    }

    #[test]
    fn a_surrogate_is_not_learned_by_what_needs_the_derivative_that_it_replaces() {
        let along = MetaGradient::AlternatingDescent { learning_rate: 0.1 };
        for config in [
            with(along),
            LearnConfig { outer_loss: Some(OuterLoss::Own), ..with(MetaGradient::default()) },
        ] {
            let found = [true, false].map(|has| config.resolved(&start(Family::Gauss, has), 0));
            assert!(found[0].is_err() && found[1].is_ok());
        }
    }
}
