//! The one array of an NPZ file: a zip archive of NPY arrays, each a head in text and its elements.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use anyhow::{Context, anyhow, bail, ensure};
use softrast_mesh::open_regular;
use zip::{CompressionMethod, ZipArchive};

/// The only array of an NPZ file; rows are read on demand.
///
/// An uncompressed array is read in place. A compressed one is unpacked to a temporary file when it
/// is opened, because deflated bytes have no random access; the system removes that file at the
/// end. Neither is ever completely in memory.
#[derive(Debug)]
pub(crate) struct NpzArray {
    path: PathBuf,
    file: Mutex<File>,
    element: Element,
    rows: usize,
    /// Bytes of a row, and the position of the first one.
    row: usize,
    start: u64,
}

impl NpzArray {
    /// Opens a file whose array is `[rows, shape…]`, with any number of rows from 1.
    ///
    /// # Errors
    ///
    /// A message of one line with the file and its fault.
    pub(crate) fn open(path: &Path, shape: &[usize]) -> anyhow::Result<Self> {
        Self::opened(path, shape).with_context(|| format!("cannot use {}", path.display()))
    }

    fn opened(path: &Path, shape: &[usize]) -> anyhow::Result<Self> {
        let file = open_regular(path)?;
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

/// Unpacks the rest of an entry to a temporary file, and checks its checksum.
fn unpacked(entry: &mut impl Read, size: u64) -> anyhow::Result<File> {
    let mut file = tempfile::tempfile().context("cannot make a temporary file to unpack it")?;
    let copied = io::copy(entry, &mut file);
    let copied = copied.map_err(|error| anyhow!("it is damaged, or there is no room ({error})"))?;
    ensure!(copied == size, "its array ends after {copied} bytes of {size}");
    Ok(file)
}

/// Type of the elements of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Element {
    /// Numbers from 0 to 255, or truth values.
    Byte,
    F32,
    F64,
}

impl Element {
    pub(crate) fn bytes(self) -> usize {
        match self {
            Self::Byte => 1,
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// Header of an array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Head {
    pub(crate) element: Element,
    pub(crate) shape: Vec<usize>,
    /// Bytes before the first element.
    pub(crate) length: usize,
}

impl Head {
    /// Reads the head, and leaves `from` at the first element.
    ///
    /// # Errors
    ///
    /// If it is not the header of an array in C order with a supported type.
    pub(crate) fn read(from: &mut impl Read) -> anyhow::Result<Self> {
        let mut start = [0; 8];
        from.read_exact(&mut start).context("it is cut off")?;
        ensure!(start.starts_with(b"\x93NUMPY"), "it is no NumPy array");
        let digits = match start[6] {
            1 => 2,
            2 | 3 => 4,
            version => bail!("its format {version} is not known here"),
        };
        let mut size = [0; 4];
        from.read_exact(&mut size[..digits]).context("it is cut off")?;
        let size = u32::from_le_bytes(size) as usize;
        ensure!(size <= 1 << 16, "its head of {size} bytes is too long");
        let mut text = vec![0; size];
        from.read_exact(&mut text).context("it is cut off")?;
        // Keeps a message that quotes it on one line.
        let text = String::from_utf8_lossy(&text).replace(char::is_control, " ");
        let value = |key: &str| -> anyhow::Result<&str> {
            let found = text.split_once(&format!("'{key}':")).map(|(_, rest)| rest.trim_start());
            found.with_context(|| format!("its head has no {key}"))
        };
        let element = match value("descr")?.split(['\'', '"']).nth(1) {
            Some("|u1" | "|b1" | "|i1") => Element::Byte,
            Some("<f4") => Element::F32,
            Some("<f8") => Element::F64,
            other => bail!(
                "its elements are {}, expected |u1, |b1, |i1, <f4 or <f8",
                other.unwrap_or("of no simple type")
            ),
        };
        ensure!(value("fortran_order")?.starts_with("False"), "it is in Fortran order, expected C");
        let shape = value("shape")?;
        let shape = shape.strip_prefix('(').and_then(|rest| rest.split_once(')'));
        let (shape, _) = shape.context("its head has no shape")?;
        let sizes = shape.split(',').map(str::trim).filter(|size| !size.is_empty());
        let sizes = sizes.map(|size| size.parse::<usize>().ok()).collect::<Option<Vec<_>>>();
        let shape = sizes.with_context(|| format!("its shape is ({shape})"))?;
        Ok(Self { element, shape, length: 8 + digits + size })
    }

    /// Bytes of all elements; `None` on overflow.
    pub(crate) fn data_bytes(&self) -> Option<u64> {
        let mut sizes = self.shape.iter().map(|&size| size as u64);
        sizes.try_fold(self.element.bytes() as u64, u64::checked_mul)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(text: &str) -> anyhow::Result<Head> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        Head::read(&mut bytes.as_slice())
    }

    #[test]
    fn a_head_as_numpy_writes_it_is_read() {
        let text = "{'descr': '|u1', 'fortran_order': False, 'shape': (3, 24, 4, 64, 64), }   \n";
        let expected =
            Head { element: Element::Byte, shape: vec![3, 24, 4, 64, 64], length: 10 + text.len() };
        assert_eq!(head(text).unwrap(), expected);
        assert_eq!(expected.data_bytes(), Some(3 * 24 * 4 * 64 * 64));
        let one = head("{'descr': '<f4', 'fortran_order': False, 'shape': (7,), }").unwrap();
        assert_eq!((one.element, one.shape), (Element::F32, vec![7]));
    }

    #[test]
    fn what_is_not_known_is_said() {
        let message = |text| head(text).unwrap_err().to_string();
        let wrong = message("{'descr': '<i8', 'fortran_order': False, 'shape': (7,), }");
        assert_eq!(wrong, "its elements are <i8, expected |u1, |b1, |i1, <f4 or <f8");
        let wrong = message("{'descr': '<\ni8', 'fortran_order': False, 'shape': (7,), }");
        assert_eq!(wrong, "its elements are < i8, expected |u1, |b1, |i1, <f4 or <f8");
        let wrong = message("{'descr': '|u1', 'fortran_order': True, 'shape': (7,), }");
        assert_eq!(wrong, "it is in Fortran order, expected C");
        let wrong = message("{'descr': '|u1', 'fortran_order': False, 'shape': (-7,), }");
        assert_eq!(wrong, "its shape is (-7,)");
        let endless =
            "{'descr': '|u1', 'fortran_order': False, 'shape': (4294967296, 4294967296), }";
        assert_eq!(head(endless).unwrap().data_bytes(), None);
        assert!(Head::read(&mut &b"\x93NUM"[..]).unwrap_err().to_string().contains("cut off"));
    }
}
