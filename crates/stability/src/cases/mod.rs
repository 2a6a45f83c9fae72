//! The cases, one file for each part of a rasterizer or task.

mod colours;
mod common;
mod depths;
mod gradients;
pub mod learning;
pub mod poses;
mod shapes;
pub mod triangle;

pub use common::SCALE;

use crate::Case;

/// All cases, in the order of the report.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    let parts = [
        gradients::CASES,
        triangle::CASES,
        poses::CASES,
        shapes::CASES,
        depths::CASES,
        colours::CASES,
        learning::CASES,
    ];
    parts.into_iter().flatten()
}
