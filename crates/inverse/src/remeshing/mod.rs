//! A surface that remeshes itself while an optimiser moves it.

mod adam;
mod geometry;

pub use adam::RemeshingAdam;
pub(crate) use geometry::{normals, normals_pulled_back};
