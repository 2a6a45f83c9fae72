use softrast_tensor::{Backend, Tensor, numbers};

/// A meta-gradient and what its making tells.
#[derive(Clone, Debug)]
pub struct MetaEstimate<B: Backend> {
    /// The outer loss.
    pub loss: f64,
    /// Its derivative by φ, `[P]`.
    pub gradient: Tensor<B, 1>,
    /// Norm of the adjoint of the scene after the last step, before it, and so on back, each before
    /// it was clipped; empty where no step was walked back.
    pub adjoint_norms: Vec<f64>,
    /// By how many powers of ten the adjoint would have grown without clipping: above some units the
    /// inner loop is chaotic at this φ, and an unclipped gradient means nothing
    /// (docs/notes.md, Meta-gradients: chaos).
    pub adjoint_growth: f64,
    /// How often the adjoint was clipped.
    pub clips: usize,
    /// Numbers kept from the inner loop for the way back.
    pub stored: usize,
}

impl<B: Backend> MetaEstimate<B> {
    /// An estimate for which no step was walked back.
    pub(crate) fn without_steps(loss: f64, gradient: Tensor<B, 1>) -> Self {
        let adjoint_norms = Vec::new();
        Self { loss, gradient, adjoint_norms, adjoint_growth: 0.0, clips: 0, stored: 0 }
    }

    /// Whether the loss and every entry of the gradient are numbers.
    pub fn is_finite(&self) -> bool {
        self.loss.is_finite() && numbers(self.gradient.clone()).iter().all(|x| x.is_finite())
    }
}
