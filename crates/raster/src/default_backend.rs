//! The backend that the features of this crate choose for binaries; library code is generic.

/// The backend of binaries, in floats of 32 bits: the first of `ndarray`, `flex` and `wgpu` whose
/// feature is on. Without any of them it does not exist.
#[cfg(feature = "ndarray")]
pub type DefaultBackend = burn::backend::NdArray<f32>;
/// The backend of binaries, in floats of 32 bits: the first of `ndarray`, `flex` and `wgpu` whose
/// feature is on.
#[cfg(all(feature = "flex", not(feature = "ndarray")))]
pub type DefaultBackend = burn::backend::Flex;
/// The backend of binaries, in floats of 32 bits: the first of `ndarray`, `flex` and `wgpu` whose
/// feature is on.
#[cfg(all(feature = "wgpu", not(any(feature = "ndarray", feature = "flex"))))]
pub type DefaultBackend = crate::Wgpu;

/// Name of [`DefaultBackend`] and its float type.
pub const DEFAULT_BACKEND: &str = if cfg!(feature = "ndarray") {
    "ndarray f32"
} else if cfg!(feature = "flex") {
    "flex f32"
} else {
    "wgpu f32"
};
