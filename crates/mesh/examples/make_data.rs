//! Writes the meshes in `data/meshes`: `cargo run --release -p softrast-mesh --example make_data`.

use std::path::Path;

fn main() -> Result<(), softrast_mesh::MeshError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/meshes");
    softrast_mesh::fox().write_obj(folder.join("fox.obj"))
}
