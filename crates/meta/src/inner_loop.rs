use std::convert::Infallible;

use softrast_tensor::{Autodiff, Backend, Tensor};

use crate::{Objective, Optimizer, objective::loss_under};

/// A fixed number of steps of an optimiser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InnerLoop<O> {
    /// The optimiser.
    pub optimizer: O,
    /// Number of steps.
    pub steps: usize,
}

impl<O: Optimizer> InnerLoop<O> {
    /// Solves from `theta` `[N]` under the softness `phi` `[P]` and returns the final scene `[N]`.
    ///
    /// If `B` is itself an `Autodiff` backend, the result is tracked with respect to `theta` and
    /// `phi` through every step, second derivatives of the loss included: `backward()` gives the
    /// unrolled meta-gradient. The tape then holds all steps; detach `phi` to avoid that.
    pub fn solve<B: Backend, P: Objective<Autodiff<B>>>(
        &self,
        objective: &P,
        theta: Tensor<B, 1>,
        phi: &Tensor<B, 1>,
    ) -> Tensor<B, 1> {
        let gradient = |step: usize, theta: &Tensor<B, 1>| {
            Ok(gradient(objective, theta.clone(), phi.clone(), step))
        };
        let Ok::<_, Infallible>(theta) =
            descend(self, theta, gradient, |theta| allowed(objective, theta), |_, _, _| ());
        theta
    }
}

/// Descends along `gradient` (called with the step, counted from 0) from `theta` `[N]` and returns the final scene. `allowed` projects the
/// scene after each step, and `see` receives the scene and the optimiser's state before the first step and after each.
///
/// ```
/// use std::convert::Infallible;
///
/// use softrast_meta::{InnerLoop, Sgd, descend};
/// use softrast_tensor::{NdArray, Tensor, numbers, vector};
///
/// let halving = InnerLoop { optimizer: Sgd { learning_rate: 0.5 }, steps: 3 };
/// let gradient = |_step, theta: &Tensor<NdArray, 1>| Ok::<_, Infallible>(theta.clone());
/// let mut seen = Vec::new();
/// let end = descend(&halving, vector(&[8.0]), gradient, |theta| theta, |_, theta, _| {
///     seen.extend(numbers(theta.clone()));
/// })?;
/// assert_eq!((numbers(end), seen), (vec![1.0], vec![8.0, 4.0, 2.0, 1.0]));
/// # Ok::<(), Infallible>(())
/// ```
///
/// # Errors
///
/// The error of `gradient`, which ends the descent.
pub fn descend<B: Backend, O: Optimizer, E>(
    InnerLoop { optimizer, steps }: &InnerLoop<O>,
    mut theta: Tensor<B, 1>,
    mut gradient: impl FnMut(usize, &Tensor<B, 1>) -> Result<Tensor<B, 1>, E>,
    allowed: impl Fn(Tensor<B, 1>) -> Tensor<B, 1>,
    mut see: impl FnMut(usize, &Tensor<B, 1>, &O::State<B, 1>),
) -> Result<Tensor<B, 1>, E> {
    let mut state = optimizer.init(&theta);
    see(0, &theta, &state);
    for step in 0..*steps {
        let grad = gradient(step, &theta)?;
        (theta, state) = optimizer.step(theta, grad, state);
        theta = allowed(theta);
        see(step + 1, &theta, &state);
    }
    Ok(theta)
}

/// The nearest scene `[N]` that the objective allows; tracked like `theta` on an `Autodiff` backend.
pub(crate) fn allowed<B: Backend, P: Objective<Autodiff<B>>>(
    objective: &P,
    theta: Tensor<B, 1>,
) -> Tensor<B, 1> {
    objective.allowed(Tensor::from_inner(theta)).inner()
}

/// Gradient of the loss at inner step `step` with respect to `theta` `[N]`; zero if independent of it.
///
/// On an `Autodiff` backend the gradient is tracked in turn.
pub(crate) fn gradient<B: Backend, P: Objective<Autodiff<B>>>(
    objective: &P,
    theta: Tensor<B, 1>,
    phi: Tensor<B, 1>,
    step: usize,
) -> Tensor<B, 1> {
    gradient_of(&theta, |theta| loss_under(objective, theta, Tensor::from_inner(phi), step))
}

/// Gradient of a loss `[1]` with respect to `theta` `[N]`.
pub(crate) fn gradient_of<B: Backend>(
    theta: &Tensor<B, 1>,
    loss: impl FnOnce(Tensor<Autodiff<B>, 1>) -> Tensor<Autodiff<B>, 1>,
) -> Tensor<B, 1> {
    let leaf = Tensor::<Autodiff<B>, 1>::from_inner(theta.clone()).require_grad();
    let grads = loss(leaf.clone()).backward();
    leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like())
}
