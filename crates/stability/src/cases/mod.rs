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

/// Identifiers of the cases of the quick part.
pub const QUICK: [&str; 8] = ["G01", "O02", "O06", "O12", "O30", "O13", "F24", "G08"];

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
