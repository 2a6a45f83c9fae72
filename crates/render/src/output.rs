use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};
use image::{ImageFormat, RgbImage};
use softrast_runner::{contact_sheet, rgb_from_gray};
use tempfile::NamedTempFile;

/// A picture file that appears whole or not at all.
pub(crate) struct Output {
    path: PathBuf,
    file: NamedTempFile,
}

impl Output {
    /// Makes sure that `path` can be written, before the work that leads to it; makes its folder.
    pub(crate) fn open(path: &Path) -> anyhow::Result<Self> {
        let refused = || format!("cannot write {}; choose another file with --out", path.display());
        if path.is_dir() {
            bail!("{}: it is a folder", refused());
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new("."));
        let file = fs::create_dir_all(folder).and_then(|()| temporary(folder));
        Ok(Self { path: path.into(), file: file.with_context(refused)? })
    }

    /// Writes the picture as PNG and gives it its name.
    pub(crate) fn write(mut self, picture: &RgbImage) -> anyhow::Result<()> {
        let refused = || format!("cannot write {}", self.path.display());
        let mut bytes = io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Png).with_context(refused)?;
        self.file.write_all(bytes.get_ref()).with_context(refused)?;
        let persisted = self.file.persist(&self.path).map_err(|failed| failed.error);
        persisted.map(drop).with_context(|| format!("cannot write {}", self.path.display()))
    }
}

/// A hidden file beside the one to come.
fn temporary(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".render-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private by default; a picture is as readable as any new file.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// The views `[views, size, size]` as one picture: itself if there is one, else a contact sheet.
pub(crate) fn picture(alpha: &[f64], size: usize) -> RgbImage {
    let views: Vec<_> =
        alpha.chunks_exact(size * size).map(|view| rgb_from_gray(view, size, size)).collect();
    match &views[..] {
        [view] => view.clone(),
        views => contact_sheet(views, columns(views.len())),
    }
}

/// Columns of a sheet that is wider than high, without empty cells where that can be.
fn columns(views: usize) -> usize {
    let root = views.isqrt() + usize::from(views.isqrt().pow(2) < views);
    (root..=2 * root).find(|columns| views.is_multiple_of(*columns)).unwrap_or(root)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_is_wide_and_full() {
        let expected = [(1, 1), (2, 2), (4, 2), (5, 5), (7, 3), (8, 4), (24, 6), (36, 6)];
        for (views, expected) in expected {
            assert_eq!(columns(views), expected, "{views} views");
        }
    }
}
