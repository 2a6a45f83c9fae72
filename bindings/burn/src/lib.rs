//! softrast for tensors of burn 0.22: soft silhouettes, colours, losses and cameras as ops of its automatic differentiation.
//!
//! softrast itself computes on tensors of burn 0.21, since exact second derivatives need nested
//! autodiff. This crate copies each op's data over, and the result and its gradient back.
//!
//! | to | there is |
//! |---|---|
//! | project vertices | [`project`], [`project_orbits`], [`vertex_tensor`] |
//! | draw silhouettes, and compare them with masks | [`Silhouettes`] |
//! | draw colours | [`Colours`] |
//! | differentiate twice | [`Silhouettes::hvp`], and [`Silhouettes::jvp`] along a direction |
//!
//! Renderers, softnesses and meshes are those of [`softrast`], re-exported here.
//!
//! Tensors are `f32` or `f64` on burn's CPU backends `Flex` (default feature `flex`) or `NdArray` (feature `ndarray`);
//! a result has the float type and the device of its inputs. Images, losses and projections panic for tensors of
//! another backend; every function panics for another float type, or for mixed ones.

#[cfg(not(any(feature = "flex", feature = "ndarray")))]
compile_error!("softrast-burn needs a backend: turn on one of the features flex, ndarray");

mod colours;
mod extension;
mod numbers;
mod op;
mod project;
mod silhouettes;

pub use burn;
pub use colours::Colours;
pub use project::{project, project_orbits, vertex_tensor};
pub use silhouettes::{Objective, Silhouettes};
#[doc(no_inline)]
pub use softrast;

/// Compiles and runs the README's example.
#[cfg(all(doctest, feature = "flex"))]
#[doc = include_str!("../README.md")]
pub struct Readme;
