//! POSE by colour: recovers the pose of a camera from a picture in colours.
//!
//! **Definition.** The mesh has a colour at each vertex. The silhouette is that of POSE, and its `IoU` loss is part of the loss; beside it
//! stands the squared difference of colours on few pixels, see [`Scene`]. Instances, starts and errors are those of POSE, seed by seed. Not
//! in the paper: docs/notes.md, Pose by colour.

mod coat;
mod scene;
mod task;

pub use coat::Coat;
pub use scene::Scene;
pub use task::Coloured;
