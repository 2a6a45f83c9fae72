//! Soft step functions for differentiable rasterizers, as burn tensor ops.
//!
//! A [`Softness`] is the coverage of a pixel by a face as a function of the signed distance, with its optical depth. Its parameters are one
//! explicit vector φ, for optimisers. A custom softness has one required method; the bundled ones are in [`families`], and a [`Family`]
//! selects one by name. An [`EdgeSoftness`] applies it to the distance or to its signed square; [`support`] computes the distances at which
//! it still changes; `SoftStep` (feature `modules`) wraps it for networks; [`Truncated`] cuts off a heavy tail. A [`DepthSoftness`] weights
//! faces by depth.
//!
//! ```
//! use softrast_tensor::{DType, NdArray, Tensor};
//! use softrast_softness::{EdgeSoftness, Family, Softness};
//!
//! let softness = EdgeSoftness::new(Family::Logistic);
//! let options = (&Default::default(), DType::F64);
//! let phi = Tensor::<NdArray, 1>::from_data(&softness.default_phi(0.02)[..], options.clone());
//! let distance = Tensor::<_, 1>::from_data([-0.02, 0.0, 0.02], options);
//! let coverage: Vec<f64> = softness.value(phi, distance).into_data().iter().collect();
//! assert_eq!(coverage[1], 0.5);
//! ```
//!
//! Values, optical depths and their derivatives are finite for every finite distance, and so are their gradients of first and second order;
//! tails keep their digits. Two limits: distances beyond 1e15 scales count as 1e15 scales, and f32 cannot represent the second derivatives
//! of a step narrower than about 1e-7.

mod depth_softness;
mod edge;
mod error_function;
pub mod families;
mod family;
mod math;
mod mirrored;
mod network;
#[cfg(feature = "modules")]
mod soft_step;
mod softness;
mod support;
mod truncated;

pub use depth_softness::{DepthSoftness, UnknownDepthSoftness};
pub use edge::EdgeSoftness;
pub use family::{Family, UnknownFamily};
pub use math::OPAQUE;
#[doc(hidden)]
pub use math::ln_scale;
pub use mirrored::Mirrored;
pub use network::initial_mlp;
#[cfg(feature = "modules")]
pub use soft_step::SoftStep;
pub use softness::Softness;
pub use support::{Support, settled_beyond, support};
pub use truncated::Truncated;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
