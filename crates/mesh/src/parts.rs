//! The content of a mesh file, before it is known to be a mesh.

use crate::{Texture, error::Trouble};

#[derive(Default)]
pub(crate) struct Parts {
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) faces: Vec<[u32; 3]>,
    pub(crate) colours: Option<Vec<[f64; 3]>>,
    pub(crate) texture: Option<Texture>,
    /// Everything that was left out or changed although the file has it: colours, textures, pictures, extensions.
    pub(crate) warnings: Vec<Trouble>,
}
