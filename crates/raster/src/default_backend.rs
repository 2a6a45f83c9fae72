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

/// There is nothing that wgpu could run on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "no adapter for wgpu found: install the Vulkan driver of your graphics card, or Mesa's software \
     Vulkan (Debian, Ubuntu: apt install mesa-vulkan-drivers libvulkan1)"
)]
pub struct NoAdapter;

/// Sets [`DefaultBackend`] up. Call it before the first tensor, which would panic where it cannot
/// be. In a browser, where that is asynchronous, the page does it with burn's `init_setup_async`.
///
/// # Errors
///
/// [`NoAdapter`] if it is wgpu and the system has no adapter.
pub fn set_up_default_backend() -> Result<(), NoAdapter> {
    #[cfg(all(
        feature = "wgpu",
        not(any(feature = "ndarray", feature = "flex", target_family = "wasm"))
    ))]
    crate::adapter_name()?;
    Ok(())
}
