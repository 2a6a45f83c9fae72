//! The head of an NPY array, as the library that the format comes from writes it.

use std::io::Read;

use anyhow::{Context, bail, ensure};

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

/// What an array holds.
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
    /// If it is not that of an array in C order of a type that is known here.
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
        let text = String::from_utf8_lossy(&text);
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

    /// Bytes of all elements; nothing if there are more than can be counted.
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
