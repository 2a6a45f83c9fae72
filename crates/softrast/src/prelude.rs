//! The items of most programs, for `use softrast::prelude::*`.

#[cfg(feature = "inverse")]
pub use softrast_inverse::{
    InverseProblem, Iterate, LearnConfig, Method, Minimization, NamedSoftness, PoseProblem,
    ScheduledSoftness, SoftnessAt, SolveConfig, Surface, VertexModel, learn, minimize,
    pose::{FoundPose, PoseSearch},
    save_colour_picture, save_picture,
};
pub use softrast_mesh::{Mesh, MeshError};
#[cfg(feature = "inverse")]
pub use softrast_meta::MetaGradient;
pub use softrast_raster::{
    Attributes, Background, Cameras, ColourRenderer, Orbit, Pinhole, Pinholes, Projected,
    RasterBackend, SoftRenderer, TConorm, Weighting, Width, hard_silhouette, iou_loss, mse_loss,
    project, vertex_tensor,
};
pub use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness, Truncated};
pub use softrast_tensor::{Backend, Tensor};
#[cfg(feature = "inverse")]
pub use softrast_views::{Lens, Picture, Views, load_views};
