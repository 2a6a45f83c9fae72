use std::sync::OnceLock;

use softrast_tensor::{
    gpu::cubecl::Runtime,
    wgpu::{AutoGraphicsApi, GraphicsApi, WgpuDevice, WgpuRuntime, init_setup},
};

use crate::NoAdapter;

/// Sets up the default wgpu adapter, once, and returns its name: `NVIDIA H200`, `llvmpipe (LLVM 15)`.
///
/// Without this call, the first tensor sets it up, and panics if there is none.
///
/// # Errors
///
/// [`NoAdapter::Wgpu`] if the system has none.
pub fn adapter_name() -> Result<&'static str, NoAdapter> {
    static NAME: OnceLock<Result<String, NoAdapter>> = OnceLock::new();
    let name = NAME.get_or_init(|| {
        if WgpuRuntime::enumerate_all_devices(&AutoGraphicsApi::backend()).is_empty() {
            return Err(NoAdapter::Wgpu);
        }
        let setup = init_setup::<AutoGraphicsApi>(&WgpuDevice::default(), Default::default());
        Ok(setup.adapter.get_info().name)
    });
    name.as_deref().map_err(Clone::clone)
}
