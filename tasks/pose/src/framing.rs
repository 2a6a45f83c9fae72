use std::path::Path;

use softrast_mesh::{Mesh, fox, painted_fox};
use softrast_views::{Frame, painted_by_texture};

use crate::{Args, Instances};

/// The mesh of the problem.
pub(crate) struct Viewed {
    pub(crate) mesh: Mesh,
    pub(crate) name: String,
    /// The frame, in coordinates of its file, in which it is viewed.
    pub(crate) frame: Frame,
    /// Warnings about its colours.
    pub(crate) notes: Vec<String>,
}

/// Loads the mesh.
pub(crate) fn viewed(args: &Args) -> anyhow::Result<Viewed> {
    let ((mesh, notes), name) = match &args.mesh {
        None if args.colour => ((painted_fox(), vec![]), "fox".to_owned()),
        None => ((fox(), vec![]), "fox".to_owned()),
        Some(path) if args.colour => (in_colours(path)?, path.display().to_string()),
        Some(path) => ((Mesh::load(path)?, vec![]), path.display().to_string()),
    };
    // The released pairs belong to the released meshes.
    let as_it_stands = args.raw || args.instances == Instances::Released24;
    Ok(if as_it_stands || args.mesh.is_none() {
        Viewed { mesh, name, frame: Frame { middle: [0.0; 3], unit: 1.0 }, notes }
    } else {
        let frame = normalizing(&mesh);
        Viewed { mesh: mesh.normalized(), name: format!("{name}, normalized"), frame, notes }
    })
}

/// Most faces of a mesh that is subdivided to sample the colours of its texture at vertices.
const MOST_FACES: usize = 20_000;

/// The mesh of a file with vertex colours, sampled from its texture if it has one; and warnings about colours that are lost.
fn in_colours(path: &Path) -> anyhow::Result<(Mesh, Vec<String>)> {
    let (mesh, warnings) = Mesh::load_textured(path)?;
    let (painted, errors) = painted_by_texture(&mesh, MOST_FACES);
    let name = path.display();
    let errors = errors.into_iter().map(|error| format!("{name}: its picture: {error:#}"));
    let notes = warnings.iter().map(ToString::to_string).chain(errors).collect();
    Ok((painted.unwrap_or(mesh), notes))
}

/// The frame of [`Mesh::normalized`].
fn normalizing(mesh: &Mesh) -> Frame {
    let [low, high] = mesh.bounds();
    let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let middle = [0, 1, 2].map(|k| f64::midpoint(low[k], high[k]));
    Frame { middle, unit: if longest > 0.0 { longest / 2.0 } else { 1.0 } }
}
