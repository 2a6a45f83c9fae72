use std::sync::Arc;

use crate::{Data, NpzFolder, Procedural, Shapes, Split};

/// Shapes per class of the validation and test splits, in the procedural set.
const HELD_OUT: usize = 200;

/// The shapes of a split of a data set.
///
/// # Errors
///
/// If files are used, and they are missing or invalid.
pub(crate) fn open(data: &Data, split: Split, seed: u64) -> anyhow::Result<Arc<dyn Shapes>> {
    Ok(match data {
        Data::Procedural(per_class) => {
            let count = if split == Split::Train { *per_class } else { HELD_OUT };
            Arc::new(Procedural::new(split, seed, count))
        }
        Data::Files(folder) => Arc::new(NpzFolder::open(folder, split)?),
    })
}
