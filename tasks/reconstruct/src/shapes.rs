use std::{fmt::Debug, sync::Arc};

use crate::{Data, NpzFolder, Procedural, Voxels};

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

/// What part of a data set shapes belong to: no shape is in two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// For learning.
    Train,
    /// For watching how learning goes.
    Val,
    /// For the figures at the end.
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

/// Shapes of a class for watching and for the figures at the end, in the procedural set.
const HELD_OUT: usize = 200;

/// The shapes of a split of a data set.
///
/// # Errors
///
/// If there are files, and they are missing or not as they should be.
pub(crate) fn open(data: &Data, split: Split, seed: u64) -> anyhow::Result<Arc<dyn Shapes>> {
    Ok(match data {
        Data::Procedural(per_class) => {
            let count = if split == Split::Train { *per_class } else { HELD_OUT };
            Arc::new(Procedural::new(split, seed, count))
        }
        Data::Files(folder) => Arc::new(NpzFolder::open(folder, split)?),
    })
}
