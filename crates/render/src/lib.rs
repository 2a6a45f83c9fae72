//! Draws soft silhouettes or colours of a mesh, from one view or many, and measures what they cost.
//!
//! For silhouettes with a target, it also computes the mean squared difference over views and pixels, and its gradient with respect to the
//! vertices. `--reference` does the same in f64 tensor ops over every pixel-face pair, as a reference for the fused op.

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu", feature = "cuda")))]
compile_error!("render needs a backend: turn on one of the features ndarray, flex, wgpu and cuda");

mod args;
mod coloured;
mod fused;
mod paint;
mod program;
mod reference;
mod scene;

pub use program::execute;
