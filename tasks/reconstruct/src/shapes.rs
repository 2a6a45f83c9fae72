use std::fmt::Debug;

use crate::Voxels;

/// Shapes in classes, each as pictures from 24 views and as voxels.
pub trait Shapes: Debug + Send + Sync {
    /// Names of the classes; there is at least one.
    fn classes(&self) -> &[String];

    /// Number of shapes of a class, at least one.
    fn count(&self, class: usize) -> usize;

    /// Planes of red, green, blue and alpha, `[4 * 64 * 64]`, each row by row from the top.
    ///
    /// # Errors
    ///
    /// If the picture cannot be read.
    fn picture(&self, class: usize, shape: usize, view: usize) -> anyhow::Result<Vec<u8>>;

    /// The cells that the shape fills.
    ///
    /// # Errors
    ///
    /// If they cannot be read.
    fn voxels(&self, class: usize, shape: usize) -> anyhow::Result<Voxels>;
}

/// Split of a data set; the shapes of splits are disjoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// For learning.
    Train,
    /// For validation during learning.
    Val,
    /// For the final scores.
    Test,
}

impl Split {
    /// Name in the files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Val => "val",
            Self::Test => "test",
        }
    }
}
