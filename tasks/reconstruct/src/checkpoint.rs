use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use tempfile::NamedTempFile;

use crate::{Epoch, Settings};

/// What a file of a training begins with; the number counts changes of the format or the network.
const MAGIC: &[u8] = b"softrast reconstruct 1\n";

/// A training as it stood after an epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// What is being trained and its history.
    pub header: Header,
    /// Weights and the state of the optimisers, as burn's recorder writes them.
    pub(crate) records: Vec<u8>,
}

/// What a checkpoint says about itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The training.
    pub settings: Settings,
    /// Names of the classes of its shapes.
    pub classes: Vec<String>,
    /// Epochs until now, the first one before any step.
    pub epochs: Vec<Epoch>,
}

impl Checkpoint {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// If it cannot be read, is no checkpoint, is of another version, or is damaged.
    pub fn load(path: &Path) -> anyhow::Result<Self> {
        let name = path.display();
        let bytes = fs::read(path).with_context(|| format!("cannot read the checkpoint {name}"))?;
        if !bytes.starts_with(MAGIC) {
            let family = &MAGIC[..MAGIC.len() - 3];
            if bytes.starts_with(family) {
                bail!("{name} is a checkpoint of another version of this program");
            }
            bail!("{name} is not a checkpoint of reconstruct");
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
        let header = serde_json::from_slice(header).with_context(|| {
            format!("{name} is a checkpoint of another version of this program")
        })?;
        Ok(Self { header, records: records.to_vec() })
    }

    /// Writes the file at `path`, which appears whole or not at all.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub fn save(&self, path: &Path) -> anyhow::Result<()> {
        let header = serde_json::to_vec(&self.header)?;
        let mut body = (header.len() as u64).to_le_bytes().to_vec();
        body.extend(&header);
        body.extend(&self.records);
        let sum = checksum(&body).to_le_bytes();
        write(path, &[MAGIC, &sum, &body])
    }
}

/// Writes a file by way of a temporary one beside it.
///
/// # Errors
///
/// If it cannot be written.
pub(crate) fn write(path: &Path, parts: &[&[u8]]) -> anyhow::Result<()> {
    let failed = || format!("cannot write {}", path.display());
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.map_or_else(|| PathBuf::from("."), Path::to_path_buf);
    fs::create_dir_all(&folder).with_context(failed)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".softrast-").suffix(".tmp");
    // A temporary file is private by default; this one becomes an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file: NamedTempFile = builder.tempfile_in(folder).with_context(failed)?;
    for part in parts {
        file.write_all(part).with_context(failed)?;
    }
    file.persist(path).map_err(|error| error.error).with_context(failed)?;
    Ok(())
}

/// FNV-1a over words of eight bytes: finds what a disk or a copy breaks, not what a forger does.
fn checksum(bytes: &[u8]) -> u64 {
    let mut sum = 0xcbf2_9ce4_8422_2325_u64 ^ bytes.len() as u64;
    for chunk in bytes.chunks(8) {
        let word = std::array::from_fn(|k| chunk.get(k).copied().unwrap_or(0));
        sum = (sum ^ u64::from_le_bytes(word)).wrapping_mul(0x0100_0000_01b3).rotate_left(23);
    }
    sum
}
