//! Values that are stored in JSON files, and those bundled with the crate.

use std::{
    fs,
    io::{self, Read},
    path::{Path, PathBuf},
};

use serde::{Serialize, de::DeserializeOwned};

/// Largest absolute value of a parameter that is a logarithm: its exponential must fit an f32.
pub(crate) const LARGEST_LOGARITHM: f64 = 80.0;

/// Largest softness file, in bytes.
const LARGEST_FILE: u64 = 1 << 24;

/// A softness file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SoftnessFileError {
    /// The file could not be read.
    #[error("cannot read softness {path:?}: {reason}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        reason: io::Error,
    },
    /// The file, or the temporary file next to it, could not be written.
    #[error("cannot write softness {path:?}: {reason}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        reason: io::Error,
    },
    /// The text is not a softness file.
    #[error("softness {path:?} is not valid: {reason}")]
    Parse {
        /// The file.
        path: PathBuf,
        /// The error and its place.
        reason: serde_json::Error,
    },
    /// The parameters, the schedule or the learning rate do not suit the softness.
    #[error("softness {path:?}{wrong}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The found and the expected value: the end of the sentence.
        wrong: String,
    },
    /// No softness of this name is bundled.
    #[error("no softness of that kind is called {name:?}; there are {known}")]
    Unknown {
        /// The requested name.
        name: String,
        /// The bundled names.
        known: String,
    },
}

/// A value that is stored in a JSON file; [`stored`] adds the methods.
pub(crate) trait Stored: Serialize + DeserializeOwned {
    /// Names of the bundled values, and the texts of their files.
    const LEARNED: &'static [(&'static str, &'static str)];

    /// Returns the found and the expected value if it is invalid.
    fn check(&self) -> Result<(), String>;
}

/// The list of [`Stored::LEARNED`]: files of `learned/`, whose names end in `$end`.
macro_rules! learned {
    ($end:literal: $($name:literal),+) => {
        &[$(($name, include_str!(concat!("../../learned/", $name, $end)))),+]
    };
}
pub(crate) use learned;

/// Reading and writing, for a type that is [`Stored`].
macro_rules! stored {
    ($stored:ty) => {
        impl $stored {
            /// Reads and checks the file at `path`.
            ///
            /// # Errors
            ///
            /// If it cannot be read, is not JSON, has unknown or missing fields, or parameters that do
            /// not suit the softness.
            pub fn load(path: impl AsRef<Path>) -> Result<Self, SoftnessFileError> {
                Self::parse(&crate::softness_file::stored::read(path.as_ref())?, path)
            }

            /// Parses and checks the text of a file; `path` names it in errors.
            ///
            /// # Errors
            ///
            /// The errors of `load`, except those of reading.
            pub fn parse(text: &str, path: impl AsRef<Path>) -> Result<Self, SoftnessFileError> {
                let stored = crate::softness_file::stored::parsed(text, path.as_ref())?;
                let checked = crate::softness_file::stored::Stored::check(&stored);
                crate::softness_file::stored::checked(checked, path.as_ref())?;
                Ok(stored)
            }

            /// Checks the parameters and writes the file at `path`, replacing an existing one.
            ///
            /// The text first goes to a temporary file in the same folder, so that `path` never
            /// holds half a softness.
            ///
            /// # Errors
            ///
            /// If the parameters do not suit the softness, or the file cannot be written.
            pub fn save(&self, path: impl AsRef<Path>) -> Result<(), SoftnessFileError> {
                crate::softness_file::stored::save(&self.text(path.as_ref())?, path.as_ref())
            }

            /// Checks the parameters and returns the text that `save` would write at `path`.
            ///
            /// # Errors
            ///
            /// If the parameters do not suit the softness.
            pub fn text(&self, path: impl AsRef<Path>) -> Result<String, SoftnessFileError> {
                let checked = crate::softness_file::stored::Stored::check(self);
                crate::softness_file::stored::checked(checked, path.as_ref())?;
                crate::softness_file::stored::text(self, path.as_ref())
            }

            /// A value learned on a task and bundled with the crate; its note describes the learning.
            ///
            /// # Errors
            ///
            /// If no bundled value has this name.
            pub fn learned(name: &str) -> Result<Self, SoftnessFileError> {
                Self::parse(crate::softness_file::stored::learned_text::<Self>(name)?, name)
            }

            /// The names of the bundled values.
            pub fn learned_names() -> impl Iterator<Item = &'static str> {
                <Self as crate::softness_file::stored::Stored>::LEARNED
                    .iter()
                    .map(|(name, _)| *name)
            }
        }
    };
}
pub(crate) use stored;

/// The text of a regular file: reading a pipe or a device could block for ever.
pub(crate) fn read(path: &Path) -> Result<String, SoftnessFileError> {
    let read = || {
        if !fs::metadata(path)?.is_file() {
            return Err(io::Error::other("it is a folder, a device or a pipe, not a file"));
        }
        let mut text = String::new();
        fs::File::open(path)?.take(LARGEST_FILE + 1).read_to_string(&mut text)?;
        match text.len() as u64 > LARGEST_FILE {
            true => Err(io::Error::other(format!("it is larger than {} MiB", LARGEST_FILE >> 20))),
            false => Ok(text),
        }
    };
    read().map_err(|reason| SoftnessFileError::Read { path: path.to_owned(), reason })
}

pub(crate) fn parsed<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, SoftnessFileError> {
    // Editors on Windows may write a byte order mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    serde_json::from_str(text)
        .map_err(|reason| SoftnessFileError::Parse { path: path.to_owned(), reason })
}

pub(crate) fn text(stored: &impl Serialize, path: &Path) -> Result<String, SoftnessFileError> {
    let text = serde_json::to_string_pretty(stored).map_err(io::Error::from);
    text.map(|text| text + "\n").map_err(|reason| unwritten(path, reason))
}

/// Writes the text through a temporary file next to `path`.
pub(crate) fn save(text: &str, path: &Path) -> Result<(), SoftnessFileError> {
    let mut beside = path.as_os_str().to_owned();
    beside.push(format!(".{}.tmp", std::process::id()));
    fs::write(&beside, text).and_then(|()| fs::rename(&beside, path)).map_err(|reason| {
        // The partial file is useless; it may not exist, so an error here is ignored.
        let _ = fs::remove_file(&beside);
        unwritten(path, reason)
    })
}

pub(crate) fn learned_text<T: Stored>(name: &str) -> Result<&'static str, SoftnessFileError> {
    // Softnesses with an adaptive schedule were `TASK-feedback` up to version 0.2.
    let current = name.strip_suffix("-feedback").map(|task| format!("{task}-adaptive"));
    let current = current.as_deref().unwrap_or(name);
    let found = T::LEARNED.iter().find(|(of, _)| *of == current);
    let (_, text) = found.ok_or_else(|| {
        let known: Vec<_> = T::LEARNED.iter().map(|(name, _)| *name).collect();
        SoftnessFileError::Unknown { name: name.to_owned(), known: known.join(", ") }
    })?;
    Ok(text)
}

/// Turns an error of a check into that of a file.
pub(crate) fn checked(check: Result<(), String>, path: &Path) -> Result<(), SoftnessFileError> {
    check.map_err(|wrong| SoftnessFileError::Invalid { path: path.to_owned(), wrong })
}

fn unwritten(path: &Path, reason: io::Error) -> SoftnessFileError {
    SoftnessFileError::Write { path: path.to_owned(), reason }
}

/// Whether `x` is finite in f32 too, the type of images.
pub(crate) fn fits_f32(x: f64) -> bool {
    x.abs() <= f64::from(f32::MAX)
}

/// Checks that `phi` has the expected length, and that its leading logarithms are in range.
pub(crate) fn check_phi(
    softness: &str,
    [expected, logarithms]: [usize; 2],
    phi: &[f64],
) -> Result<(), String> {
    if phi.len() != expected {
        return Err(format!(" has {} parameters, but {softness} has {expected}", phi.len()));
    }
    for (index, found) in phi.iter().enumerate() {
        if !fits_f32(*found) {
            return Err(format!(": phi[{index}] is {found}, expected a number that fits an f32"));
        }
        if index < logarithms && found.abs() > LARGEST_LOGARITHM {
            let limit = LARGEST_LOGARITHM;
            return Err(format!(
                ": phi[{index}] is the logarithm {found}, expected -{limit} to {limit}"
            ));
        }
    }
    Ok(())
}
