use serde::Serialize;

/// Results of one outer step, all for the softness at its start.
///
/// The last record of a run has no gradient: there is no step after it.
///
/// See [`OuterLoop`](crate::OuterLoop) for an example.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Record {
    /// Updates of φ before this step.
    pub step: usize,
    /// Mean outer loss over the batch.
    pub loss: Option<f64>,
    /// Mean outer loss over the validation instances; `None` if no validation was due or an instance has no finite loss.
    pub validation_loss: Option<f64>,
    /// Norm of the mean gradient, before clipping.
    pub gradient_norm: Option<f64>,
    /// Powers of ten by which the adjoint would have grown in the median instance, see
    /// [`MetaEstimate::adjoint_growth`](crate::MetaEstimate).
    pub adjoint_growth: Option<f64>,
    /// Number of times the adjoint was clipped, over the batch.
    pub clips: usize,
    /// Instances of the batch dropped because their loss or gradient was not finite.
    pub dropped: usize,
    /// Duration.
    pub seconds: f64,
    /// The softness.
    pub phi: Vec<f64>,
}
