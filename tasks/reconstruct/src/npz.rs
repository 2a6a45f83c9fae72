use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use anyhow::{Context, anyhow, ensure};
use zip::{CompressionMethod, ZipArchive};

use crate::npy::{Element, Head};

/// The only array of an NPZ file, whose rows are read when they are asked for.
///
/// An array that is not compressed is read where it lies. A compressed one is unpacked to a temporary
/// file when it is opened, because deflated bytes cannot be reached out of order; the system removes
/// that file at the end. Neither is ever in memory as a whole.
#[derive(Debug)]
pub(crate) struct NpzArray {
    path: PathBuf,
    file: Mutex<File>,
    element: Element,
    rows: usize,
    /// Bytes of a row, and where the first one begins.
    row: usize,
    start: u64,
}

impl NpzArray {
    /// Opens a file whose array is `[rows, shape…]`, with any number of rows from 1.
    ///
    /// # Errors
    ///
    /// One line that names the file and what is wrong with it.
    pub(crate) fn open(path: &Path, shape: &[usize]) -> anyhow::Result<Self> {
        Self::opened(path, shape).with_context(|| format!("cannot use {}", path.display()))
    }

    fn opened(path: &Path, shape: &[usize]) -> anyhow::Result<Self> {
        let file = File::open(path)?;
        let mut archive = ZipArchive::new(&file)
            .map_err(|error| anyhow!("it is no NPZ file, or is damaged or cut off ({error})"))?;
        let entry = (0..archive.len())
            .find(|&k| archive.name_for_index(k).is_some_and(|name| name.ends_with(".npy")));
        let entry = entry.context("it holds no array")?;
        let mut entry = archive.by_index(entry)?;
        let size = entry.size();
        let head = Head::read(&mut entry)?;
        let found = head.shape.split_first();
        let rows = match found {
            Some((&rows, rest)) if rest == shape => rows,
            _ => {
                let list = |shape: &[usize]| {
                    shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
                };
                let (found, expected) = (list(&head.shape), list(shape));
                return Err(anyhow!("its array is ({found}), expected (shapes, {expected})"));
            }
        };
        ensure!(rows > 0, "it holds no shape");
        let whole = head.data_bytes().and_then(|bytes| bytes.checked_add(head.length as u64));
        let whole = whole.context("its array would be larger than any file")?;
        ensure!(whole == size, "its array has {size} bytes, expected {whole}");
        let data_start = entry.data_start().context("its array has no place")?;
        let (file, start) = if entry.compression() == CompressionMethod::Stored {
            drop(entry);
            let length = file.metadata()?.len();
            ensure!(data_start.saturating_add(size) <= length, "it is cut off");
            (file, data_start + head.length as u64)
        } else {
            (unpacked(&mut entry, size - head.length as u64)?, 0)
        };
        let row = shape.iter().product::<usize>() * head.element.bytes();
        let file = Mutex::new(file);
        Ok(Self { path: path.to_owned(), file, element: head.element, rows, row, start })
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// Type of the elements.
    pub(crate) fn element(&self) -> Element {
        self.element
    }

    /// The bytes of one of `parts` equal parts of a row.
    ///
    /// # Errors
    ///
    /// If they cannot be read.
    pub(crate) fn part(&self, row: usize, [part, parts]: [usize; 2]) -> anyhow::Result<Vec<u8>> {
        let length = self.row / parts;
        let mut bytes = vec![0; length];
        let place = self.start + (row * self.row + part * length) as u64;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        let read = file.seek(SeekFrom::Start(place)).and_then(|_| file.read_exact(&mut bytes));
        read.with_context(|| format!("cannot read shape {row} of {}", self.path.display()))?;
        Ok(bytes)
    }
}

/// The rest of an entry in a temporary file; checks its sum.
fn unpacked(entry: &mut impl Read, size: u64) -> anyhow::Result<File> {
    let mut file = tempfile::tempfile().context("cannot make a temporary file to unpack it")?;
    let copied = io::copy(entry, &mut file);
    let copied = copied.map_err(|error| anyhow!("it is damaged, or there is no room ({error})"))?;
    ensure!(copied == size, "its array ends after {copied} bytes of {size}");
    Ok(file)
}
