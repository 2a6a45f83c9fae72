/// The system has no adapter that wgpu could run on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "no adapter for wgpu found: install the Vulkan driver of your graphics card, or Mesa's software \
     Vulkan (Debian, Ubuntu: apt install mesa-vulkan-drivers libvulkan1)"
)]
pub struct NoAdapter;
