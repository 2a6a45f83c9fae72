//! The pictures of the materials of a file, each read once.

use std::{collections::HashMap, hash::Hash, sync::Arc};

use crate::error::Trouble;

/// Limit of pictures of a mesh.
const MOST: usize = 1000;
/// Limit of the bytes of all pictures of a mesh: images of a small file may share the same bytes.
const MOST_BYTES: usize = 1 << 30;

/// The pictures so far, by their names in the file.
pub(crate) struct Pictures<K> {
    known: HashMap<K, Option<Arc<[u8]>>>,
    bytes: usize,
}

impl<K> Default for Pictures<K> {
    fn default() -> Self {
        Self { known: HashMap::new(), bytes: 0 }
    }
}

impl<K: Eq + Hash> Pictures<K> {
    /// The picture of this name, read by `read` the first time; `None` on errors, which add a warning the first time.
    pub(crate) fn get(
        &mut self,
        name: K,
        read: impl FnOnce() -> Result<Vec<u8>, Trouble>,
        warnings: &mut Vec<Trouble>,
    ) -> Option<Arc<[u8]>> {
        if let Some(known) = self.known.get(&name) {
            return known.clone();
        }
        let too_many = |reason: String| Trouble::part("materials", reason);
        let found = match self.known.len() {
            MOST => Err(too_many(format!("more than {MOST} pictures: the others are not read"))),
            more if more > MOST => return None,
            _ => read(),
        };
        let found = found.and_then(|picture| match MOST_BYTES - self.bytes >= picture.len() {
            true => Ok(picture.into()),
            false => Err(too_many(format!("pictures of more than {} MiB", MOST_BYTES >> 20))),
        });
        let picture: Option<Arc<[u8]>> = found.map_err(|trouble| warnings.push(trouble)).ok();
        self.bytes += picture.as_ref().map_or(0, |picture| picture.len());
        self.known.insert(name, picture.clone());
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_read_once_and_there_is_an_end() {
        let (mut pictures, mut warnings) = (Pictures::default(), vec![]);
        for round in 0..2 {
            for name in 0..MOST + 5 {
                let read = || {
                    assert_eq!(round, 0, "picture {name} is read again");
                    Ok(vec![1])
                };
                assert_eq!(pictures.get(name, read, &mut warnings).is_some(), name < MOST);
            }
        }
        let text = warnings.pop().unwrap().of_file("a.obj").to_string();
        assert_eq!(text, "a.obj: materials: more than 1000 pictures: the others are not read");
        assert!(warnings.is_empty());
    }
}
