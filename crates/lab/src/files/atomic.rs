use std::{
    fs,
    io::{self, Write},
    path::Path,
};

/// Writes a file atomically: if the program dies, the file is the old one or the new one, complete.
///
/// # Errors
///
/// The error of the system.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut file = hidden().tempfile_in(folder.unwrap_or(Path::new(".")))?;
    file.write_all(bytes)?;
    // The name must not reach the disk before the bytes do.
    file.as_file().sync_all()?;
    file.persist(path).map(drop).map_err(|failed| failed.error)
}

/// Makes files under hidden names.
pub(super) fn hidden() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".softrast-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private by default; results get the permissions of any new file.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder
}
