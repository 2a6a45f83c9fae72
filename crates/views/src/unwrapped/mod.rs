//! A mesh unwrapped onto a square picture.

mod charts;
mod packing;
mod triangle;

pub use packing::Unwrapped;
pub use triangle::covered_texels;
