use std::{
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::Progress;

const FORMAT: &str = "softrast learning checkpoint 1";

/// Learning as it stands in a file, with what it was learning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// Everything that decides the result: task, settings, learner, in the words of the program that
    /// learns. A checkpoint of another job is refused.
    pub job: String,
    /// How far it has come.
    pub progress: Progress,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    checksum: String,
    checkpoint: Checkpoint,
}

/// A checkpoint could not be read or written, or is not one to go on from.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file could not be read.
    #[error("cannot read checkpoint {path:?}: {reason}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The file could not be written.
    #[error("cannot write checkpoint {path:?}: {reason}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The text is not that of a checkpoint.
    #[error("{path:?} is no checkpoint, or a damaged one: {reason}; remove it to start over")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The checkpoint is of something else.
    #[error("checkpoint {path:?} belongs to another job: it is for {found}, this is {expected}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The job in the file.
        found: String,
        /// The job at hand.
        expected: String,
    },
}

impl Checkpoint {
    /// Writes the file at `path`; whenever the program dies, the file is the old one or the new one.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointError> {
        let written = self.text().and_then(|text| {
            let mut file = temporary(path)?;
            file.write_all(text.as_bytes())?;
            // The name must not reach the disk before the text does.
            file.as_file().sync_all()?;
            file.persist(path).map_err(|failed| failed.error)
        });
        let failed = |reason| CheckpointError::Write { path: path.to_owned(), reason };
        written.map(drop).map_err(failed)
    }

    /// Reads the file at `path`, to go on with `job`.
    ///
    /// # Errors
    ///
    /// If it cannot be read, is not a whole checkpoint as it was written, or is of another job.
    pub fn load(path: &Path, job: &str) -> Result<Progress, CheckpointError> {
        let read = |reason| CheckpointError::Read { path: path.to_owned(), reason };
        let damaged = |reason| CheckpointError::Damaged { path: path.to_owned(), reason };
        let bytes = fs::read(path).map_err(read)?;
        let file: File =
            serde_json::from_slice(&bytes).map_err(|reason| damaged(reason.to_string()))?;
        if file.format != FORMAT {
            return Err(damaged(format!("its format is {:?}, expected {FORMAT:?}", file.format)));
        }
        let checkpoint = file.checkpoint;
        let checksum = checkpoint.checksum().map_err(|reason| damaged(reason.to_string()))?;
        if file.checksum != checksum {
            return Err(damaged(format!("its checksum is {}, not {checksum}", file.checksum)));
        }
        if !checkpoint.progress.is_sound() {
            return Err(damaged("its vectors differ in length or are not finite".into()));
        }
        if checkpoint.job != job {
            let (found, expected) = (checkpoint.job, job.to_owned());
            return Err(CheckpointError::Foreign { path: path.to_owned(), found, expected });
        }
        Ok(checkpoint.progress)
    }

    fn text(&self) -> io::Result<String> {
        let (format, checksum) = (FORMAT.to_owned(), self.checksum()?);
        let file = File { format, checksum, checkpoint: self.clone() };
        Ok(serde_json::to_string_pretty(&file)? + "\n")
    }

    /// FNV-1a of the text in short, which is the same before writing and after reading.
    fn checksum(&self) -> io::Result<String> {
        let bytes = serde_json::to_vec(self)?;
        let mix = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
        Ok(format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, mix)))
    }
}

/// A file in the folder of `path`, so that it can take its name at once.
fn temporary(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".softrast-").suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Temporary files are private by default; a checkpoint is as readable as any new file.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    builder.tempfile_in(folder.unwrap_or(Path::new(".")))
}
