use std::fmt::Debug;

use softrast_tensor::{Backend, Tensor};

/// An optimiser as a pure function: state in, state out.
///
/// A step consists of tensor ops, so that on `Autodiff<B>` its result is differentiable with
/// respect to the parameters, the gradient and the state, to any order.
pub trait Optimizer {
    /// State carried from one step to the next.
    type State<B: Backend, const D: usize>: Clone + Debug;

    /// The state before the first step for parameters shaped like `theta`.
    fn init<B: Backend, const D: usize>(&self, theta: &Tensor<B, D>) -> Self::State<B, D>;

    /// The parameters and the state after one step down the gradient `grad`, shaped like `theta`.
    fn step<B: Backend, const D: usize>(
        &self,
        theta: Tensor<B, D>,
        grad: Tensor<B, D>,
        state: Self::State<B, D>,
    ) -> (Tensor<B, D>, Self::State<B, D>);

    /// The tensors of a state, in an order of the optimiser's choice.
    ///
    /// With [`state`](Optimizer::state) a state can be stored, moved between `B` and `Autodiff<B>`,
    /// and differentiated with respect to.
    fn tensors<B: Backend, const D: usize>(&self, state: Self::State<B, D>) -> Vec<Tensor<B, D>>;

    /// The state after `steps` steps that consists of `tensors`.
    ///
    /// # Panics
    ///
    /// If their number differs from that of [`tensors`](Optimizer::tensors).
    fn state<B: Backend, const D: usize>(
        &self,
        steps: usize,
        tensors: Vec<Tensor<B, D>>,
    ) -> Self::State<B, D>;
}
