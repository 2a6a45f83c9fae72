use softrast_mesh::{Mesh, fox, painted_fox};
use softrast_views::Frame;

use crate::{Args, Instances};

/// The mesh to view, its name, and the frame of its file in which it is viewed.
pub(crate) fn mesh(args: &Args) -> anyhow::Result<(Mesh, String, Frame)> {
    let (mesh, name) = match &args.mesh {
        None if args.colour => (painted_fox(), "fox".to_owned()),
        None => (fox(), "fox".to_owned()),
        Some(path) => (Mesh::load(path)?, path.display().to_string()),
    };
    // The released pairs belong to the released meshes.
    let as_it_stands = args.raw || args.instances == Instances::Released24;
    Ok(if as_it_stands || args.mesh.is_none() {
        (mesh, name, Frame { middle: [0.0; 3], unit: 1.0 })
    } else {
        let frame = normalizing(&mesh);
        (mesh.normalized(), format!("{name}, normalized"), frame)
    })
}

/// The frame of [`Mesh::normalized`].
fn normalizing(mesh: &Mesh) -> Frame {
    let [low, high] = mesh.bounds();
    let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let middle = [0, 1, 2].map(|k| f64::midpoint(low[k], high[k]));
    Frame { middle, unit: if longest > 0.0 { longest / 2.0 } else { 1.0 } }
}
