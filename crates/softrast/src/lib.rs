//! Differentiable soft rasterizer on burn whose softness is learned.
//!
//! This crate re-exports the libraries of the project under short names; each can be used alone:
//!
//! - [`mesh`]: triangle meshes, a careful OBJ loader, generators;
//! - [`softness`]: soft step functions as burn tensor ops;
//! - [`raster`]: cameras, silhouettes, losses, exact to second order;
//! - [`meta`]: optimisers and inner loops that can be differentiated;
//! - [`inverse`]: problems of inverse rendering; `minimize` solves them, `learn` learns a softness on them.
//!
//! The README of the project has a first program.

pub mod prelude;

pub use softrast_inverse as inverse;
pub use softrast_mesh as mesh;
pub use softrast_meta as meta;
pub use softrast_raster as raster;
pub use softrast_softness as softness;

/// Compiles and runs the examples of the project's README.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
pub struct ProjectReadme;

/// Compiles and runs the guide's example.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/guide/adding-a-softness.md")]
pub struct AddingASoftness;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;

/// Compiles the example of the page for newcomers from other rasterizers.
#[cfg(doctest)]
#[doc = include_str!("../../../docs/guide/coming-from-pytorch3d.md")]
pub struct ComingFromPyTorch3d;
