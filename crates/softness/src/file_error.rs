use std::{io, path::PathBuf};

use crate::file::LARGEST_LOGARITHM;

/// A softness file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SoftnessFileError {
    /// The file could not be read.
    #[error("cannot read softness {path:?}: {reason}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The file, or the temporary one beside it, could not be written.
    #[error("cannot write softness {path:?}: {reason}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: io::Error,
    },
    /// The text is not what a softness file holds.
    #[error("softness {path:?} is not valid: {reason}")]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        reason: serde_json::Error,
    },
    /// φ has the wrong length.
    #[error("softness {path:?} has {found} parameters, but {family} has {expected}")]
    Length {
        /// The file.
        path: PathBuf,
        /// The family's name.
        family: &'static str,
        /// Parameters found.
        found: usize,
        /// Parameters of the family.
        expected: usize,
    },
    /// A parameter is not a number.
    #[error("softness {path:?}: phi[{index}] is {found}, expected a finite number")]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Which parameter.
        index: usize,
        /// Its value.
        found: f64,
    },
    /// The exponential of a parameter is not a positive number in f32.
    #[error(
        "softness {path:?}: phi[{index}] is the logarithm {found}, expected -{limit} to {limit}",
        limit = LARGEST_LOGARITHM
    )]
    Logarithm {
        /// The file.
        path: PathBuf,
        /// Which parameter.
        index: usize,
        /// Its value.
        found: f64,
    },
    /// The learning rate is none.
    #[error("softness {path:?}: the learning rate is {found}, expected a positive number")]
    LearningRate {
        /// The file.
        path: PathBuf,
        /// Its value.
        found: f64,
    },
    /// The path of scales cannot be used.
    #[error("softness {path:?} has a path with {what}")]
    Path {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
}
