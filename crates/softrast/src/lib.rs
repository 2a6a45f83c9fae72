//! Differentiable soft rasterizer on burn whose softness is learned.
//!
//! This crate re-exports the libraries of the project under short names; each can be used alone:
//!
//! - [`mesh`]: triangle meshes, a careful reader of OBJ, PLY, STL, OFF, GLB and glTF, generators;
//! - [`softness`]: soft step functions as burn tensor ops;
//! - [`raster`]: cameras, silhouettes, colours, losses, exact to second order;
//! - [`meta`]: optimisers and inner loops that can be differentiated;
//! - [`inverse`]: problems of inverse rendering; `minimize` solves them, `learn` learns a softness on them;
//!   softnesses over a run, and their files;
//! - [`views`]: pictures, masks and cameras of nerfstudio, COLMAP and OpenCV, and the visual hull.
//!
//! [`tensor`] re-exports the tensors, backends and autodiff of burn 0.21; types of other releases of burn do not fit. The Cargo features
//! `ndarray` (default), `flex` and `wgpu` choose the backend.
//!
//! ```
//! use softrast::{mesh::fox, prelude::*, tensor::{Autodiff, NdArray}};
//!
//! let (mesh, device) = (fox(), Default::default());
//! let camera = Orbit { distance: 2.7, elevation_deg: 20.0, azimuth_deg: 30.0, fov_deg: 60.0 };
//! let camera = camera.tensor::<Autodiff<NdArray>>(&device).require_grad();
//! let renderer = SoftRenderer::new(mesh.faces(), 64, Family::Logistic, 0.01);
//! let seen = project(vertices(mesh.positions(), &device), camera.clone());
//! let alpha = renderer.silhouette(seen);
//! assert_eq!(alpha.dims(), [1, 64, 64]);
//! let gradient = camera.grad(&alpha.mean().backward()).unwrap();
//! assert_eq!(gradient.dims(), [1, 4]);
//! ```

pub mod prelude;

#[doc(inline)]
pub use softrast_inverse as inverse;
#[doc(inline)]
pub use softrast_mesh as mesh;
#[doc(inline)]
pub use softrast_meta as meta;
#[doc(inline)]
pub use softrast_raster as raster;
#[doc(inline)]
pub use softrast_softness as softness;
#[doc(inline)]
pub use softrast_tensor as tensor;
#[doc(inline)]
pub use softrast_views as views;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

/// The same of the guide to colours.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/guide/colour.md")]
pub struct Colours;
