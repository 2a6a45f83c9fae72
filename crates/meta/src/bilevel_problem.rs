use std::convert::Infallible;

use softrast_tensor::{Autodiff, Backend, Tensor, numbers};

use crate::{
    InnerLoop, Objective, Optimizer, OuterSteps, descend,
    inner_loop::{allowed, gradient},
    objective::loss_under,
};

/// One instance of a task to learn a softness on: the inner problem and its outer loss.
///
/// ```
/// use softrast_meta::{BilevelProblem, InnerLoop, MetaEstimate, MetaGradient, Objective, OuterSteps, Sgd};
/// use softrast_tensor::{Backend, NdArray, Tensor, numbers, vector};
///
/// /// A parabola around φ.
/// struct Parabola;
/// impl<B: Backend> Objective<B> for Parabola {
///     fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
///         (theta - phi).powi_scalar(2)
///     }
/// }
/// /// The squared distance to 1.
/// struct ToOne;
/// impl<B: Backend> Objective<B> for ToOne {
///     fn loss(&self, theta: Tensor<B, 1>, _phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
///         (theta - 1.0).powi_scalar(2)
///     }
/// }
///
/// let problem = BilevelProblem {
///     objective: Parabola,
///     outer_loss: ToOne,
///     inner: InnerLoop { optimizer: Sgd { learning_rate: 0.25 }, steps: 1 },
///     start: vector::<NdArray>(&[0.0]),
///     outer_steps: OuterSteps::Last,
/// };
/// // A step halves the distance to φ: the outer loss is (φ / 2 - 1)².
/// let exact = MetaGradient::Unrolled { clip: None };
/// let estimate: MetaEstimate<NdArray> = exact.estimate(&problem, &vector(&[4.0]), 0);
/// assert!((estimate.loss - 1.0).abs() < 1e-6);
/// assert!((numbers(estimate.gradient)[0] - 1.0).abs() < 1e-6);
/// ```
#[derive(Clone, Debug)]
pub struct BilevelProblem<B: Backend, P, R, O> {
    /// The inner loss, under the learned softness; on the level of autodiff that second derivatives need.
    pub objective: P,
    /// The outer loss. It should not depend on φ, or a wide softness looks better than it is
    /// (docs/notes.md, Outer loss); the paper uses the objective itself.
    pub outer_loss: R,
    /// Optimiser and number of steps of the inner loop.
    pub inner: InnerLoop<O>,
    /// Start of the inner loop, `[N]`.
    pub start: Tensor<B, 1>,
    /// Steps after which the outer loss is evaluated.
    pub outer_steps: OuterSteps,
}

impl<B, P, R, O> BilevelProblem<B, P, R, O>
where
    B: Backend,
    P: Objective<Autodiff<Autodiff<B>>>,
    R: Objective<Autodiff<B>>,
    O: Optimizer,
{
    /// The outer loss of the inner loop under `phi` `[P]`.
    pub fn loss(&self, phi: &Tensor<B, 1>) -> f64 {
        let at = self.outer_steps.at(self.inner.steps);
        let mut total = 0.0;
        self.walk(phi, |step, theta, _| {
            if at.contains(&step) {
                total += self.judged(theta, phi, step);
            }
        });
        total / at.len() as f64
    }

    /// The outer loss of a scene after some steps.
    pub(crate) fn judged(&self, theta: &Tensor<B, 1>, phi: &Tensor<B, 1>, step: usize) -> f64 {
        let [theta, phi] = [theta, phi].map(|x| Tensor::from_inner(x.clone()));
        numbers(loss_under(&self.outer_loss, theta, phi, step).inner()).iter().sum()
    }
}

impl<B: Backend, P: Objective<Autodiff<Autodiff<B>>>, R, O: Optimizer> BilevelProblem<B, P, R, O> {
    /// Runs the inner loop and passes `see` the scene and the optimiser's state before the first
    /// step and after each.
    pub(crate) fn walk(
        &self,
        phi: &Tensor<B, 1>,
        see: impl FnMut(usize, &Tensor<B, 1>, &O::State<B, 1>),
    ) {
        let gradient = |step: usize, theta: &Tensor<B, 1>| {
            let [at, phi] = [theta, phi].map(|x| Tensor::<Autodiff<B>, 1>::from_inner(x.clone()));
            // At the autodiff level of the backward pass, so that `detach` in the objective acts on that level.
            Ok(gradient(&self.objective, at, phi, step).inner())
        };
        let allowed = |theta| allowed(&self.objective, Tensor::from_inner(theta)).inner();
        let Ok::<_, Infallible>(_) =
            descend(&self.inner, self.start.clone(), gradient, allowed, see);
    }
}
