//! What most programs need, for `use softrast::prelude::*`.

pub use softrast_inverse::{
    InverseProblem, Iterate, LearnConfig, Method, Minimization, NamedSoftness, PoseProblem,
    ScheduledSoftness, SoftnessAt, SolveConfig, learn, minimize,
    pose::{FoundPose, PoseSearch},
    save_picture,
};
pub use softrast_mesh::{Mesh, MeshError};
pub use softrast_meta::{Adam, MetaGradient, Optimizer};
pub use softrast_raster::{
    Attributes, Background, ColourRenderer, Orbit, Pinhole, Pinholes, RasterBackend, SoftRenderer,
    TConorm, Weighting, hard_silhouette, iou_loss, mse_loss, project, project_pinhole, vertices,
};
pub use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
pub use softrast_tensor::{Backend, Tensor};
pub use softrast_views::{Lens, Picture, load_views};
