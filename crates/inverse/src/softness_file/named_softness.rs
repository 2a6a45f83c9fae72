use softrast_softness::Softness;

/// A softness of one's own that files hold by a name.
///
/// A file has the name and the numbers; the formula, with any constants of the value that implements this, is code. So
/// [`ScheduledSoftness::load_own`](crate::ScheduledSoftness::load_own) is given the softness, and refuses files of another name.
///
/// ```
/// use softrast_inverse::{NamedSoftness, ScheduledSoftness};
/// # use softrast_tensor::{Backend, Tensor};
/// # use softrast_softness::Softness;
/// # #[derive(Clone, Debug, PartialEq)]
/// # struct Arctan;
/// # impl Softness for Arctan {
/// #     fn value<B: Backend, const D: usize>(&self, phi: Tensor<B, 1>, x: Tensor<B, D>) -> Tensor<B, D> {
/// #         (x / phi.exp().reshape([1; D])).atan() / std::f64::consts::PI + 0.5
/// #     }
/// # }
///
/// impl NamedSoftness for Arctan {
///     const NAME: &'static str = "arctan";
/// }
///
/// let decay = ScheduledSoftness::decay(Arctan, 0.1, 0.01);
/// let text = decay.text("decay.json")?;
/// assert!(text.contains("\"softness\": \"arctan\""));
/// assert_eq!(ScheduledSoftness::parse_own(Arctan, &text, "decay.json")?, decay);
/// # Ok::<(), softrast_inverse::SoftnessFileError>(())
/// ```
pub trait NamedSoftness: Softness {
    /// Name in files, where a family of the crate has an object.
    const NAME: &'static str;
}
