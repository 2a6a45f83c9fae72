/// What is asked of an op with some inputs.
///
/// Gradients come back flat, one after the other, in the order of the inputs, and only those that are wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pass {
    /// The result.
    Forward,
    /// The gradient of `Σ upstream · result`; the upstream stands behind the inputs.
    Vjp {
        /// To which inputs.
        wanted: Vec<bool>,
    },
    /// The gradient of `Σ direction · gradient`; the direction stands behind inputs and upstream.
    VjpOfVjp {
        /// What the gradient consists of.
        along: Vec<bool>,
        /// To which of the inputs, and whether to the upstream.
        wanted: Vec<bool>,
    },
}
