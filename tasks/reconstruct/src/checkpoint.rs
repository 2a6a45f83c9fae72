use std::{fs, path::Path};

use anyhow::{Context, bail, ensure};
use softrast_lab::write_atomically;
use softrast_mesh::read_bounded;

use crate::Header;

/// Beginning of a training's file; the number is the version of the format and the network.
const MAGIC: &[u8] = b"softrast reconstruct 2\n";

/// Largest file, in bytes.
const LARGEST_FILE: u64 = 1 << 32;

/// State of a training after an epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Settings of the training, and its history.
    pub header: Header,
    /// Weights and the state of the optimisers, as burn's recorder writes them.
    pub records: Vec<u8>,
}

impl Checkpoint {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// If it cannot be read, is no checkpoint, is of another version, or is damaged.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let name = path.display();
        let bytes = read_bounded(path, LARGEST_FILE)
            .with_context(|| format!("cannot read the checkpoint {name}"))?;
        if !bytes.starts_with(MAGIC) {
            let family = &MAGIC[..MAGIC.len() - 3];
            if bytes.starts_with(family) {
                bail!("{name} is a checkpoint of another version of this program: train anew");
            }
            bail!("{name} is not a checkpoint of reconstruct: train one");
        }
        let damaged = || format!("{name} is damaged or cut off: train anew");
        let rest = &bytes[MAGIC.len()..];
        ensure!(rest.len() >= 16, damaged());
        let number = |k: usize| u64::from_le_bytes(std::array::from_fn(|i| rest[8 * k + i]));
        let (sum, length) = (number(0), number(1));
        ensure!(sum == checksum(&rest[8..]), damaged());
        let body = &rest[16..];
        let length = usize::try_from(length).ok().filter(|&length| length <= body.len());
        let (header, records) = body.split_at(length.with_context(damaged)?);
        let header: Header = serde_json::from_slice(header).with_context(|| {
            format!("{name} is a checkpoint of another version of this program: train anew")
        })?;
        header
            .check(path)
            .with_context(|| format!("{name} is of another version of this program: train anew"))?;
        Ok(Self { header, records: records.to_vec() })
    }

    /// Writes the file at `path` atomically.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn save(&self, path: &Path) -> anyhow::Result<()> {
        write(path, &self.bytes()?)
    }

    /// The content of its file.
    pub(crate) fn bytes(&self) -> anyhow::Result<Vec<u8>> {
        Ok(sealed(&serde_json::to_vec(&self.header)?, &self.records))
    }
}

/// The bytes of a file with a header in JSON and arbitrary records.
pub fn sealed(header: &[u8], records: &[u8]) -> Vec<u8> {
    let body = [&(header.len() as u64).to_le_bytes(), header, records].concat();
    [MAGIC, &checksum(&body).to_le_bytes(), &body].concat()
}

/// Writes a file atomically, and creates its folder if missing.
///
/// # Errors
///
/// If it cannot be written.
fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let made = path.parent().map_or(Ok(()), fs::create_dir_all);
    let written = made.and_then(|()| write_atomically(path, bytes));
    written.with_context(|| format!("cannot write {}", path.display()))
}

/// FNV-1a over words of eight bytes: detects accidental damage, not forgery.
fn checksum(bytes: &[u8]) -> u64 {
    let mut sum = 0xcbf2_9ce4_8422_2325_u64 ^ bytes.len() as u64;
    for chunk in bytes.chunks(8) {
        let word = std::array::from_fn(|k| chunk.get(k).copied().unwrap_or(0));
        sum = (sum ^ u64::from_le_bytes(word)).wrapping_mul(0x0100_0000_01b3).rotate_left(23);
    }
    sum
}
