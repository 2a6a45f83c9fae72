//! Differentiable soft rasterizer ops on burn: cameras, silhouettes, exact second order.
//!
//! A silhouette is a sum over faces of a one-dimensional function of the signed distance ([`low_level::profile_sum`]). The softness and the
//! T-conorm ([`low_level::Profile`]) determine this function, and the coverage as a function of the sum. A [`SoftRenderer`] combines them;
//! [`mod@reference`] computes the same in plain tensor ops over every pixel-face pair. A [`ColourRenderer`] draws attributes of faces, soft
//! by edge and by depth; [`blend`] does so for a few faces of any kind.
//!
//! ```
//! use softrast_tensor::{NdArray, Tensor};
//! use softrast_raster::{Projected, SoftRenderer};
//! use softrast_softness::Family;
//!
//! // x and y in NDC and the depth, as after projection.
//! let corners = [[[-0.5, -0.5, 1.0], [0.5, -0.5, 1.0], [0.0, 0.5, 1.0]]];
//! let corners = Tensor::<NdArray, 3>::from_floats(corners, &Default::default());
//! let renderer = SoftRenderer::new(&[[0, 1, 2]], 3, Family::Logistic, 0.01);
//! let alpha: Vec<f32> = renderer.silhouette(Projected::new(corners)).into_data().iter().collect();
//! // The pixel in the middle, and the one at the top left.
//! assert!(alpha[4] > 0.99 && alpha[0] < 0.01);
//! ```
//!
//! # Example: a sharp image with the gradient of a wider softness
//!
//! ```
//! use softrast_raster::{HostBackend, Projected, SoftRenderer, vertex_tensor};
//! use softrast_softness::Family;
//! use softrast_tensor::{Autodiff, numbers};
//!
//! let corners = [[-0.5, -0.5, 1.0], [0.5, -0.5, 1.0], [0.0, 0.5, 1.0]];
//! let corners = vertex_tensor::<Autodiff<HostBackend>>(&corners, &Default::default()).require_grad();
//! let sharp = SoftRenderer::new(&[[0, 1, 2]], 8, Family::Logistic, 1e-4).without_back_faces();
//! let surrogate = sharp.clone().with_surrogate(Family::Logistic, 0.1);
//! let [(image, gradient), (same, wide)] = [sharp, surrogate].map(|renderer| {
//!     let image = renderer.silhouette(Projected::new(corners.clone()));
//!     let gradient = corners.grad(&image.clone().sum().backward()).unwrap();
//!     (numbers(image.inner()), numbers(gradient.abs().sum())[0])
//! });
//! assert_eq!(image, same);
//! assert!(gradient < 1e-3 && wide > 1.0);
//! ```

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu", feature = "cuda")))]
compile_error!(
    "softrast-raster needs a backend: turn on one of the features ndarray, flex, wgpu, cuda"
);

mod attributes;
mod backend;
mod backend_choice;
mod cache;
mod camera;
mod colour;
mod colour_renderer;
mod curve;
#[cfg(feature = "gpu")]
mod gpu;
mod hard;
mod limits;
mod log_curve;
mod loss;
mod no_adapter;
mod ops;
mod picture_loss;
mod pinhole;
mod profile;
mod project;
pub mod reference;
mod shading;
mod silhouette;
mod small_product;
mod soft_renderer;
mod t_conorm;
mod view;
mod weighting;
mod width;

pub use attributes::Attributes;
pub use backend::RasterBackend;
pub use backend_choice::{BackendChoice, HostBackend, NoBackend};
pub use camera::Orbit;
pub use colour::{Background, blend, hard_colour, nearness};
pub use colour_renderer::ColourRenderer;
#[cfg(feature = "wgpu")]
pub use gpu::Wgpu;
#[cfg(all(feature = "wgpu", not(target_family = "wasm")))]
pub use gpu::adapter_name;
#[cfg(feature = "cuda")]
pub use gpu::{Cuda, cuda_device_name};
pub use hard::{hard_coverage, hard_silhouette, nearest_faces};
pub use limits::NEAR;
pub use loss::{edge_length, flatness, iou_loss, mse_loss, normal_consistency};
pub use no_adapter::NoAdapter;
pub use picture_loss::{huber_loss, l1_loss, multi_scale_loss, ssim_loss};
pub use pinhole::{Pinhole, PinholeError, Pinholes, PyTorch3dCamera, rotate_by_tangent};
pub use project::{Cameras, Projected, project, vertex_tensor};
pub use shading::{Light, lambert, phong, spherical_harmonics, vertex_normals};
pub use soft_renderer::SoftRenderer;
pub use softrast_kernel::ImageSize;
/// Used by [`on_backend!`].
#[doc(hidden)]
pub use softrast_tensor as tensor;
pub use t_conorm::{TConorm, UnknownTConorm};
pub use view::view_rotation;
pub use weighting::Weighting;
pub use width::{Width, WidthSchedule};

/// Components of the renderers, to prepare tables, run ops on slices, or measure them. They take projected vertices as plain tensors.
///
/// ```
/// use softrast_raster::low_level::{FusedOp, Numbers, Pass, Profile, Rasterizer, Silhouette, profile_sum};
/// use softrast_raster::{HostBackend, vertex_tensor};
/// use softrast_softness::{EdgeSoftness, Family, Softness};
/// use softrast_tensor::vector;
///
/// let softness = EdgeSoftness::new(Family::Logistic);
/// let phi = vector::<HostBackend>(&softness.default_phi(0.02));
/// let silhouette: Silhouette<_> = Rasterizer::new(8).prepare(&[[0, 1, 2]].into(), softness, &phi);
/// let profile: &Profile = silhouette.profile();
/// assert!(profile.error() <= Rasterizer::TOLERANCE && profile.support()[0] < 1.0);
///
/// // The sums of tensors, and of slices: vertices axis by axis.
/// let corners = [[-0.5, -0.5, 1.0], [0.5, -0.5, 1.0], [0.0, 0.5, 1.0]];
/// let (op, table) = (silhouette.op(), silhouette.table(phi));
/// let FusedOp::ProfileSum(sum) = &op else { unreachable!() };
/// let sums = profile_sum(sum, vertex_tensor::<HostBackend>(&corners, &Default::default()), table.clone());
/// let table: Vec<f32> = table.into_data().iter().collect();
/// let axes: Vec<f32> = (0..9).map(|k| corners[k % 3][k / 3] as f32).collect();
/// let dims = [vec![1, 3, 3], vec![table.len() / 4, 4]];
/// assert_eq!(f32::run_pass(&op, &Pass::Forward, &[&axes, &table], &dims), sums.into_data());
/// ```
pub mod low_level {
    pub use crate::{
        backend::profile_sum,
        colour_renderer::WeightTables,
        ops::blend::SoftBlend,
        ops::blend_loss::BlendLoss,
        ops::loss::SilhouetteLoss,
        ops::sum::ProfileSum,
        ops::{ElementaryOp, FusedOp, Numbers, Pass},
        profile::Profile,
        silhouette::{Rasterizer, Silhouette},
        small_product::small_product,
    };
    pub use softrast_kernel::PixelLoss;
}
pub(crate) use low_level::*;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
