use softrast_tensor::{Backend, Tensor};

use crate::Optimizer;

/// Plain gradient descent: `θ - learning_rate · g`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sgd {
    /// Step per unit of gradient.
    pub learning_rate: f64,
}

impl Optimizer for Sgd {
    type State<B: Backend, const D: usize> = ();

    fn init<B: Backend, const D: usize>(&self, _theta: &Tensor<B, D>) {}

    fn step<B: Backend, const D: usize>(
        &self,
        theta: Tensor<B, D>,
        grad: Tensor<B, D>,
        (): (),
    ) -> (Tensor<B, D>, ()) {
        (theta - grad * self.learning_rate, ())
    }

    fn tensors<B: Backend, const D: usize>(&self, (): ()) -> Vec<Tensor<B, D>> {
        Vec::new()
    }

    fn state<B: Backend, const D: usize>(&self, _steps: usize, tensors: Vec<Tensor<B, D>>) {
        assert!(tensors.is_empty(), "gradient descent remembers nothing");
    }
}
