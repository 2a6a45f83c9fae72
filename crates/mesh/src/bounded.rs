//! Reading of untrusted files: only regular files, and only up to a bound.

use std::{
    fs::{self, File},
    io::{self, Read},
    path::Path,
};

/// Opens the file at `path` for reading if it is a regular file.
///
/// Folders, devices and pipes are refused before they are opened: opening a pipe may block forever, and a device may be endless. Links are
/// followed.
///
/// # Errors
///
/// If the path leads to no regular file, or the file cannot be opened. The error does not name the path.
pub fn open_regular(path: &Path) -> io::Result<File> {
    let refused = || io::Error::other("it is a folder, a device or a pipe, not a file");
    if !fs::metadata(path)?.is_file() {
        return Err(refused());
    }
    let file = File::open(path)?;
    // Another file may have replaced it in between.
    if file.metadata()?.is_file() { Ok(file) } else { Err(refused()) }
}

/// The content of the regular file at `path`, which has at most `most` bytes.
///
/// ```
/// use std::path::Path;
///
/// let error = softrast_mesh::read_bounded(Path::new("/dev/zero"), 1 << 20).unwrap_err();
/// assert!(!error.to_string().contains('\n'));
/// ```
///
/// # Errors
///
/// As for [`open_regular`], or if the file has more bytes or cannot be read. The error does not name the path.
pub fn read_bounded(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open_regular(path)?;
    let too_long = || io::Error::other(format!("it has more than {most} bytes"));
    let length = file.metadata()?.len();
    if length > most {
        return Err(too_long());
    }
    let mut content = Vec::new();
    content.try_reserve_exact(usize::try_from(length).map_err(io::Error::other)?)?;
    // Files of the kernel may report size 0, and some are endless.
    file.take(most.saturating_add(1)).read_to_end(&mut content)?;
    if content.len() as u64 > most { Err(too_long()) } else { Ok(content) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_the_bound_and_refused_beyond_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        fs::write(&path, b"12345").unwrap();
        assert_eq!(read_bounded(&path, 5).unwrap(), b"12345");
        assert_eq!(read_bounded(&path, u64::MAX).unwrap(), b"12345");
        let message = read_bounded(&path, 4).unwrap_err().to_string();
        assert_eq!(message, "it has more than 4 bytes");
        assert_eq!(
            read_bounded(&folder.path().join("b"), 4).unwrap_err().kind(),
            io::ErrorKind::NotFound
        );
    }

    #[cfg(unix)]
    #[test]
    fn folders_devices_and_pipes_are_refused_without_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
        assert!(made.success());
        for path in [folder.path(), &pipe, Path::new("/dev/zero"), Path::new("/dev/null")] {
            let message = read_bounded(path, 9).unwrap_err().to_string();
            assert_eq!(message, "it is a folder, a device or a pipe, not a file", "{path:?}");
        }
    }
}
