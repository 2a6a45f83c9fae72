use softrast_softness::Softness;

/// A custom softness that files refer to by a name.
///
/// A file has the name and the parameters; the formula, with any constants of the implementing value, is code. Therefore
/// [`ScheduledSoftness::load_own`](crate::ScheduledSoftness::load_own) takes the softness, and refuses files of another name.
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
    /// Name in files, where families have an object.
    const NAME: &'static str;
}
