use softrast_raster::BackendChoice;
use softrast_runner::{Command, Settings};

use crate::method_of_flags::usage;

/// The backend that the command line asks for, set up.
pub(crate) fn backend(
    settings: &Settings,
    compiled: &'static [BackendChoice],
) -> anyhow::Result<BackendChoice> {
    let asked = settings.backend.as_deref();
    let backend =
        BackendChoice::among(compiled, asked).map_err(|error| usage(&error.to_string()))?;
    if settings.command == Command::Learn && asked.is_some() && backend != BackendChoice::NdArray {
        return Err(usage(&format!(
            "learn computes on ndarray, not on {backend}: leave out --backend"
        )));
    }
    backend.set_up()?;
    Ok(backend)
}
