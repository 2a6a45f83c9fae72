//! The content of a mesh file, before validation.

use crate::{Texture, error::Trouble};

#[derive(Default)]
pub(crate) struct Parts {
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
    pub(crate) colours: Option<Vec<[f64; 3]>>,
    pub(crate) texture: Option<Texture>,
    /// Everything in the file that was omitted or changed: colours, textures, pictures, extensions.
    pub(crate) warnings: Vec<Trouble>,
}
