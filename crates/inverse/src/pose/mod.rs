//! POSE as a problem: find the camera pose at which a mesh has a given silhouette.
//!
//! The mesh is first turned by the rotation of the target camera, then viewed from the pose (distance, elevation,
//! azimuth). The answer is therefore elevation 0, azimuth 0 and the target's distance. Instances in a batch are
//! independent, one view each. Source: Wu et al. 2024, Sec. 5.1; docs/notes.md, Pose.

mod coloured;
mod found;
mod glance;
mod instance;
mod least_squares;
mod masks;
mod pose_search;
mod problem;
mod scene;
mod search;
mod shifts;
mod symmetry;
mod target;
mod vertex_colours;

pub use coloured::{ColouredViews, split_coverage};
pub use found::FoundPose;
pub use instance::{PoseInstance, PoseProblem};
pub use masks::{MaskPose, MaskPoses, MaskScene};
pub use pose_search::PoseSearch;
pub use scene::{PoseScene, nearest_distance};
pub use symmetry::{Symmetry, symmetries};
pub use vertex_colours::VertexColours;
