//! Writes the meshes in `data/meshes`: `cargo run --release -p softrast-mesh --example make_data`.

use std::path::Path;

use softrast_mesh::{airplane, chair, fox};

fn main() -> Result<(), softrast_mesh::MeshError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/meshes");
    for (name, mesh) in [("fox", fox()), ("airplane", airplane()), ("chair", chair())] {
        mesh.save(folder.join(name).with_extension("obj"))?;
    }
    Ok(())
}
