//! Meshes of the paper, which are not part of the repository.

use std::{env, path::Path};

use softrast_mesh::Mesh;

/// The mesh `paper/NAME` in the folder of the environment variable `SOFTRAST_MESHES`.
///
/// # Panics
///
/// If it is missing.
pub fn paper_mesh(name: &str) -> Mesh {
    let folder = env::var_os("SOFTRAST_MESHES").unwrap_or_else(|| {
        panic!("needs paper/{name} in the folder that SOFTRAST_MESHES names, which is not set")
    });
    let path = Path::new(&folder).join("paper").join(name);
    Mesh::load(path).unwrap_or_else(|error| panic!("{error} (SOFTRAST_MESHES is {folder:?})"))
}
