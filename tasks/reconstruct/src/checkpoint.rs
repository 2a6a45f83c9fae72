use std::{fs, path::Path};

use anyhow::{Context, bail, ensure};
use softrast_lab::write_atomically;

use crate::Header;

/// What a file of a training begins with; the number counts changes of the format or the network.
const MAGIC: &[u8] = b"softrast reconstruct 2\n";

/// A training as it stood after an epoch.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// What is being trained and its history.
    pub header: Header,
    /// Weights and the state of the optimisers, as burn's recorder writes them.
    pub(crate) records: Vec<u8>,
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
        write(path, &[MAGIC, &sum, &body].concat())
    }
}

/// Writes a file that appears whole or not at all, and its folder if that is missing.
///
/// # Errors
///
/// If it cannot be written.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let made = path.parent().map_or(Ok(()), fs::create_dir_all);
    let written = made.and_then(|()| write_atomically(path, bytes));
    written.with_context(|| format!("cannot write {}", path.display()))
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

#[cfg(test)]
mod tests {
    use std::sync::OnceLock;

    use proptest::prelude::*;
    use serde_json::{Value, json};

    use super::*;

    /// The file of a training that is as small as it can be: its header, and what follows it.
    fn written() -> &'static (Value, Vec<u8>) {
        static WRITTEN: OnceLock<(Value, Vec<u8>)> = OnceLock::new();
        WRITTEN.get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let out = folder.path().display();
            run(&format!(
                "train --quick --epochs 1 --pairs 1 --steps 1 --shapes 1 --val 1 --quiet --out {out}"
            ))
            .unwrap();
            let Checkpoint { header, records } =
                Checkpoint::load(&folder.path().join("checkpoint.bin")).unwrap();
            (serde_json::to_value(header).unwrap(), records)
        })
    }

    fn run(line: &str) -> Result<(), String> {
        let words = ["reconstruct"].into_iter().chain(line.split_whitespace()).map(Into::into);
        crate::execute(words, &mut Vec::new()).map_err(|failure| failure.to_string())
    }

    /// Evaluates a file: fine, or one line that names it and says what to do.
    fn evaluate(bytes: &[u8]) -> Result<(), TestCaseError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.bin");
        fs::write(&path, bytes).unwrap();
        let ended = run(&format!("evaluate --shapes 1 --views 1 --checkpoint {}", path.display()));
        if let Err(line) = ended {
            let says = line.contains("checkpoint.bin") && line.contains("train");
            prop_assert!(says && line.lines().count() == 1, "{line}");
        }
        Ok(())
    }

    /// A file with this header and a checksum that fits.
    fn sealed(header: &Value, records: &[u8]) -> Vec<u8> {
        let header = header.to_string();
        let length = (header.len() as u64).to_le_bytes();
        let body = [&length, header.as_bytes(), records].concat();
        [MAGIC, &checksum(&body).to_le_bytes(), &body].concat()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        #[test]
        fn a_damaged_file_ends_in_one_line(at in any::<prop::sample::Index>(), byte: u8, cut: bool) {
            let (header, records) = written();
            let mut bytes = sealed(header, records);
            let at = at.index(bytes.len());
            if cut { bytes.truncate(at) } else { bytes[at] = byte }
            evaluate(&bytes)?;
        }

        #[test]
        fn records_that_are_cut_end_in_one_line(at in any::<prop::sample::Index>()) {
            let (header, records) = written();
            evaluate(&sealed(header, &records[..at.index(records.len())]))?;
        }
    }

    #[test]
    fn a_softness_or_a_t_conorm_that_this_version_does_not_have_ends_in_one_line() {
        let (header, records) = written();
        let others = [
            ("/settings/t_conorm", json!("max")),
            ("/settings/phi", json!([])),
            ("/settings/phi/0", json!(1e300)),
            ("/settings/softness/family", json!("soft")),
        ];
        for (place, other) in others {
            let mut header = header.clone();
            *header.pointer_mut(place).unwrap() = other;
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("checkpoint.bin");
            fs::write(&path, sealed(&header, records)).unwrap();
            let line = format!("{:#}", Checkpoint::load(&path).unwrap_err());
            assert!(line.contains("train anew") && line.lines().count() == 1, "{line}");
        }
    }
}
