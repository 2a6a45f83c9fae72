//! A mesh from pictures that the user gives.

mod answer;
mod flags;
mod painted;
mod problem;
mod solve;
mod surface;
mod template;
mod textured;

pub use flags::{Begin, Views};
pub(crate) use solve::solve_views;
