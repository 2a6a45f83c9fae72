use softrast_lab::Error;
use softrast_raster::{BackendChoice, compiled_backends};

/// The backend that the command line asks for, set up.
///
/// # Errors
///
/// If there is none of that name or no adapter for it.
pub fn backend(asked: Option<&str>) -> anyhow::Result<BackendChoice> {
    let backend = BackendChoice::among(compiled_backends!(), asked);
    let backend = backend.map_err(|error| Error::usage(error.to_string()))?;
    backend.set_up()?;
    Ok(backend)
}
