//! The bytes that a glTF file refers to: in its binary chunk, in data URIs, or in other files.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    rc::Rc,
};

use base64::{
    Engine, alphabet,
    engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig},
};

use crate::{
    bounded::read_bounded,
    error::shown,
    referenced::{MOST_BYTES, referenced_uri},
};

/// The bytes of a buffer: the binary chunk, or others, which several buffers may share.
pub(crate) enum Content<'a> {
    Chunk(&'a [u8]),
    Own(Rc<Vec<u8>>),
}

impl Content<'_> {
    pub(crate) fn bytes(&self) -> &[u8] {
        match self {
            Self::Chunk(bytes) => bytes,
            Self::Own(bytes) => bytes,
        }
    }
}

/// The files of buffers, each read once.
#[derive(Default)]
pub(crate) struct Files {
    read: HashMap<PathBuf, Result<Rc<Vec<u8>>, String>>,
    /// Bytes in all of them.
    pub(crate) length: usize,
}

impl Files {
    /// The content of the file of a URI, or the reason why there is none.
    pub(crate) fn read(&mut self, folder: Option<&Path>, uri: &str) -> Result<Rc<Vec<u8>>, String> {
        let Some(folder) = folder else {
            return Err("lies in another file: export it as one .glb file".to_owned());
        };
        let Self { read, length } = self;
        let path = referenced_uri(folder, uri);
        let content = read.entry(path).or_insert_with_key(|path| {
            let most = MOST_BYTES - *length as u64;
            let content = read_bounded(path, most).map_err(|reason| {
                let file = shown(&path.display().to_string());
                format!("lies in {file}, which cannot be read: {reason}")
            })?;
            *length += content.len();
            Ok(Rc::new(content))
        });
        content.clone()
    }
}

/// The bytes in a data URI, `Some(None)` if it is not base64; `None` for other URIs.
pub(crate) fn data(uri: &str) -> Option<Option<Vec<u8>>> {
    const LENIENT: GeneralPurpose = GeneralPurpose::new(
        &alphabet::STANDARD,
        GeneralPurposeConfig::new()
            .with_decode_padding_mode(DecodePaddingMode::Indifferent)
            .with_decode_allow_trailing_bits(true),
    );
    let (_, coded) = match uri.strip_prefix("data:")?.split_once(";base64,") {
        Some(parts) => parts,
        None => return Some(None),
    };
    Some(LENIENT.decode(coded).ok())
}
