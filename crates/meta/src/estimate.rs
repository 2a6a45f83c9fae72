use softrast_tensor::{Backend, Tensor, numbers};

/// A meta-gradient and its diagnostics.
///
/// See [`BilevelProblem`](crate::BilevelProblem) for an example.
#[derive(Clone, Debug)]
pub struct MetaEstimate<B: Backend> {
    /// The outer loss.
    pub loss: f64,
    /// Its derivative with respect to φ, `[P]`.
    pub gradient: Tensor<B, 1>,
    /// Norms of the adjoint of the scene, from after the last step backwards, each before clipping;
    /// empty if no step was differentiated.
    pub adjoint_norms: Vec<f64>,
    /// Growth of the adjoint without clipping, in powers of ten. Above some units the inner loop is
    /// chaotic at this φ, and an unclipped gradient is meaningless (docs/notes.md, Meta-gradients:
    /// chaos).
    pub adjoint_growth: f64,
    /// Number of times the adjoint was clipped.
    pub clips: usize,
    /// Numbers stored from the inner loop for the backward pass.
    pub stored: usize,
}

impl<B: Backend> MetaEstimate<B> {
    /// An estimate without a backward pass through the inner steps.
    pub(crate) fn without_steps(loss: f64, gradient: Tensor<B, 1>) -> Self {
        let adjoint_norms = Vec::new();
        Self { loss, gradient, adjoint_norms, adjoint_growth: 0.0, clips: 0, stored: 0 }
    }

    /// Whether the loss and every entry of the gradient are finite.
    pub fn is_finite(&self) -> bool {
        self.loss.is_finite() && numbers(self.gradient.clone()).iter().all(|x| x.is_finite())
    }
}
