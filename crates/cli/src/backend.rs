use softrast_lab::Error;
use softrast_raster::{BackendChoice, compiled_backends};

/// The backend of the command line, initialized.
///
/// # Errors
///
/// If no backend has that name, or it has no adapter.
pub fn backend(asked: Option<&str>) -> anyhow::Result<BackendChoice> {
    let backend = BackendChoice::select(compiled_backends!(), asked);
    let backend = backend.map_err(|error| Error::usage(error.to_string()))?;
    backend.set_up()?;
    Ok(backend)
}
