/// A pass of an op: the result, its gradient, or the gradient of that.
///
/// Gradients are concatenated in the order of the inputs, flat, and only those that are wanted.
///
/// The module [`low_level`](crate::low_level) has an example.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pass {
    /// The result.
    Forward,
    /// The gradient of `Σ upstream · result`; the upstream follows the inputs.
    Vjp {
        /// The inputs with respect to which gradients are wanted.
        wanted: Vec<bool>,
    },
    /// The gradient of `Σ direction · gradient`; the direction follows inputs and upstream.
    VjpOfVjp {
        /// The inputs whose gradients the gradient consists of.
        along: Vec<bool>,
        /// The inputs, and last the upstream, with respect to which gradients are wanted.
        wanted: Vec<bool>,
    },
}
