//! Differentiable soft rasterizer on burn whose softness is learned.
//!
//! | to | there is | example |
//! |---|---|---|
//! | draw a silhouette and differentiate it | [`SoftRenderer`](raster::SoftRenderer), [`project`](raster::project) | below, [`silhouette`] |
//! | read masks, pictures and cameras of a folder as tensors | [`Views`](views::Views) | [`fit_masks`] |
//! | move vertices by burn's optimisers | [`VertexModel`](inverse::VertexModel), with the losses of a [`Surface`](inverse::Surface) | [`fit_masks`] |
//! | narrow the edge over a run | [`Width`](raster::Width) in pixels, [`ScheduledSoftness`](inverse::ScheduledSoftness) | [`fit_masks`] |
//! | compare images | [`iou_loss`](raster::iou_loss), [`mse_loss`](raster::mse_loss), [`ssim_loss`](raster::ssim_loss), [`multi_scale_loss`](raster::multi_scale_loss) | [`fit_masks`], [`colour`] |
//! | draw colours and textures, and differentiate them | [`ColourRenderer`](raster::ColourRenderer), [`Attributes`](raster::Attributes) | [`colour`], [`texture`] |
//! | light a mesh | [`lambert`](raster::lambert), [`phong`](raster::phong), [`spherical_harmonics`](raster::spherical_harmonics) | [`texture`] |
//! | find the camera of a mask | [`PoseSearch`](inverse::pose::PoseSearch) | [`pose_from_mask`] |
//! | use a camera of a file or of one's own | [`Pinhole`](raster::Pinhole), [`Orbit`](raster::Orbit), [`Lens`](views::Lens), [`Cameras`](raster::Cameras) | [`pose_from_mask`] |
//! | define a softness | [`Softness`](softness::Softness), [`Truncated`](softness::Truncated) for heavy tails | [`own_softness`], in colour [`own_colour`] |
//! | learn a softness, and keep it in a file | [`learn`](fn@inverse::learn), [`NamedSoftness`](inverse::NamedSoftness) | [`learn`](https://github.com/softrast/softrast/blob/main/crates/softrast/examples/learn.rs), [`own_learned`] |
//! | differentiate through an optimisation | [`meta`], `Autodiff<Autodiff<_>>` | [`meta_gradient`] |
//! | read and write meshes | [`Mesh`](mesh::Mesh) | [`fit_masks`] |
//!
//! The [`guide`] leads from an image to a fitted mesh. Each module is a crate that can be used
//! alone; [`prelude`] has the items of most programs. Derivatives are exact to second order in f64. Errors
//! in files are returned; wrong shapes panic, with the found and the expected shape.
//!
//! [`tensor`] re-exports the tensors, backends and autodiff of burn 0.21; types of other burn releases are incompatible. The Cargo features
//! `ndarray` (default), `flex`, `wgpu` and `cuda` add backends. [`inverse`], [`views`] and [`meta`] need the feature `inverse`, which also
//! builds burn's modules and optimisers and the readers of pictures; images of meshes and their derivatives need only a backend.
//!
//! ```
//! use softrast::{mesh::fox, prelude::*, tensor::{Autodiff, NdArray}};
//!
//! let (mesh, device) = (fox(), Default::default());
//! let camera = Orbit { distance: 2.7, elevation_deg: 20.0, azimuth_deg: 30.0, fov_deg: 60.0 };
//! let camera = camera.tensor::<Autodiff<NdArray>>(&device).require_grad();
//! let renderer = SoftRenderer::new(mesh.faces(), 64, Family::Logistic, 0.01);
//! let seen = project(vertex_tensor(mesh.positions(), &device), camera.clone());
//! let alpha = renderer.silhouette(seen);
//! assert_eq!(alpha.dims(), [1, 64, 64]);
//! let gradient = camera.grad(&alpha.mean().backward()).unwrap();
//! assert_eq!(gradient.dims(), [1, 4]);
//! ```
//!
//! [`silhouette`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/silhouette.rs
//! [`fit_masks`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/fit_masks.rs
//! [`colour`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/colour.rs
//! [`texture`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/texture.rs
//! [`pose_from_mask`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/pose_from_mask.rs
//! [`own_colour`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/own_colour.rs
//! [`own_softness`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/own_softness.rs
//! [`own_learned`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/own_learned.rs
//! [`meta_gradient`]: https://github.com/softrast/softrast/blob/main/crates/softrast/examples/meta_gradient.rs

// Without the feature `inverse` the table still names its items.
#![cfg_attr(not(feature = "inverse"), allow(rustdoc::broken_intra_doc_links))]

#[cfg(feature = "inverse")]
pub mod guide;
pub mod prelude;

#[cfg(feature = "inverse")]
#[doc(inline)]
pub use softrast_inverse as inverse;
#[doc(inline)]
pub use softrast_mesh as mesh;
#[cfg(feature = "inverse")]
#[doc(inline)]
pub use softrast_meta as meta;
#[doc(inline)]
pub use softrast_raster as raster;
#[doc(inline)]
pub use softrast_softness as softness;
#[doc(inline)]
pub use softrast_tensor as tensor;
#[cfg(feature = "inverse")]
#[doc(inline)]
pub use softrast_views as views;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Compiles and runs the guide to colours.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/guide/colour.md")]
struct Colours;
