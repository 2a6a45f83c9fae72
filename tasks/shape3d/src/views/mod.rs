//! A mesh from pictures that the user gives.

mod answer;
mod painted;
mod problem;
mod solve;
mod surface;
mod template;

pub(crate) use solve::solve_views;
pub use solve::{Begin, Views};
