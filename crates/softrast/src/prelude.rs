//! What most programs need, for `use softrast::prelude::*`.

pub use softrast_inverse::{
    InverseProblem, Iterate, LearnConfig, Method, Minimization, NamedSoftness, PoseProblem,
    ScheduledSoftness, SoftnessAt, SolveConfig, Surface, VertexModel, learn, minimize,
    pose::{FoundPose, PoseSearch},
    save_picture,
};
pub use softrast_mesh::{Mesh, MeshError};
pub use softrast_meta::MetaGradient;
pub use softrast_raster::{
    Attributes, Background, Cameras, ColourRenderer, Orbit, Pinhole, Pinholes, Projected,
    RasterBackend, SoftRenderer, TConorm, Weighting, Width, hard_silhouette, iou_loss, mse_loss,
    project, vertices,
};
pub use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
pub use softrast_tensor::{Backend, Tensor};
pub use softrast_views::{Lens, Picture, Views, load_views};
