//! Soft step functions for differentiable rasterizers, as burn tensor ops.
//!
//! A [`Softness`] says how much a face covers a pixel at a signed distance, and how deep the face
//! is optically. Its parameters are one explicit vector φ, so that an optimiser sees nothing else.
//! A [`Family`] is one chosen by name; an [`EdgeSoftness`] applies it to the distance or to its
//! signed square; [`support`] says how far from the edge it still changes; a [`SoftnessFile`] keeps
//! it; a [`SoftStep`] puts it into a network. A [`DepthSoftness`] says how much a face counts by its
//! depth.
//!
//! ```
//! use burn::{backend::NdArray, tensor::{DType, Tensor}};
//! use softrast_softness::{EdgeSoftness, Family, Softness};
//!
//! let softness = EdgeSoftness { family: Family::Logistic, squared: false };
//! let options = (&Default::default(), DType::F64);
//! let phi = Tensor::<NdArray, 1>::from_data(&softness.default_phi(0.02)[..], options.clone());
//! let distance = Tensor::<_, 1>::from_data([-0.02, 0.0, 0.02], options);
//! let coverage: Vec<f64> = softness.value(phi, distance).into_data().iter().collect();
//! assert_eq!(coverage[1], 0.5);
//! ```
//!
//! Values, optical depths and their derivatives are finite for every finite distance, and so are
//! their gradients of first and second order; tails keep their digits. Two limits: distances beyond
//! 1e15 scales count as 1e15 scales, and f32 cannot hold the second derivatives of a step that is
//! narrower than about 1e-7.

mod atan_ratio;
mod bilogit;
mod cauchy;
mod cubic_hermite;
mod depth;
mod depth_file;
mod depth_mlp;
mod depth_softness;
mod edge;
mod error_function;
mod exp;
mod family;
mod file;
mod file_error;
mod gamma;
mod gauss;
mod gudermannian;
mod gumbel;
mod half_line;
mod initial_mlp;
mod laplace;
mod levy;
mod ln_gamma;
mod logistic;
mod mirror;
mod mlp;
mod parameter;
mod path;
mod polynomial;
mod reciprocal;
mod rise;
mod soft_step;
mod softness;
mod support;
mod surrogate;
mod uniform;
mod unit_step;
mod wigner;

pub use bilogit::BiLogit;
pub use cauchy::Cauchy;
pub use cubic_hermite::CubicHermite;
pub use depth_file::DepthSoftnessFile;
pub use depth_mlp::DepthMlp;
pub use depth_softness::{DepthSoftness, UnknownDepthSoftness};
pub use edge::EdgeSoftness;
pub use exp::Exp;
pub use family::{Family, UnknownFamily};
pub use file::SoftnessFile;
pub use file_error::SoftnessFileError;
pub use gamma::Gamma;
pub use gauss::Gauss;
pub use gudermannian::Gudermannian;
pub use gumbel::{GumbelMax, GumbelMin};
pub use half_line::{Forward, Reversed};
pub use initial_mlp::initial_mlp;
pub use laplace::Laplace;
pub use levy::Levy;
pub use logistic::Logistic;
pub use mlp::Mlp;
pub use path::ScalePath;
pub use reciprocal::Reciprocal;
pub use soft_step::SoftStep;
pub use softness::{OPAQUE, Softness};
pub use support::{Support, support};
pub use surrogate::Surrogate;
pub use uniform::Uniform;
pub use wigner::Wigner;
