//! POSE by colour: recovers the pose of a camera from a picture in colours.
//!
//! **Definition.** The mesh has a colour at each vertex. The silhouette is that of POSE, and its `IoU` loss is part of the loss; beside it
//! stands the squared difference of colours on few pixels, see [`softrast_inverse::pose::ColouredViews`]. Instances, starts and errors are those of POSE, seed by seed. Not
//! in the paper: docs/notes.md, Pose by colour.

mod scene;
mod task;

use softrast_lab::Error;
use softrast_mesh::Mesh;

use crate::Args;

pub use scene::Scene;
pub use task::Coloured;

/// The colours of the vertices of a mesh.
///
/// # Errors
///
/// If it has none.
pub(crate) fn coloured<'a>(args: &Args, mesh: &'a Mesh) -> anyhow::Result<&'a [[f64; 3]]> {
    mesh.colours().ok_or_else(|| {
        let mesh = args.mesh.as_deref().unwrap_or(std::path::Path::new("the mesh"));
        Error::usage(format!(
            "--colour needs a mesh with a texture or with colours at its vertices, and {} has neither: give a PLY, GLB or OBJ file \
             that has, as shape3d --colour writes them",
            mesh.display()
        ))
    })
}
