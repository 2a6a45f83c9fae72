//! POSE by colour: finds the pose of a camera from a colour picture.
//!
//! **Definition.** The mesh has a colour at each vertex. The silhouette is that of POSE; the loss is its `IoU` loss
//! plus the squared difference of colours at low resolution, see [`softrast_inverse::pose::ColouredViews`]. Instances,
//! starts and errors are those of POSE, seed by seed. Not in the paper: docs/notes.md, Pose by colour.

mod scene;
mod task;

use softrast_lab::Error;
use softrast_mesh::Mesh;

use crate::Args;

pub use scene::Scene;
pub use task::Coloured;

/// The vertex colours of a mesh.
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
