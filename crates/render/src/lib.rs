//! Draws soft silhouettes or colours of a mesh, from one view or many, and measures what they cost.
//!
//! Of silhouettes, with a target it also gives the mean squared difference over views and pixels, and the gradient of that to the vertices.
//! `--reference` does the same in f64 tensor ops over every pixel-face pair: the numbers that the fused op is held against.

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu")))]
compile_error!("render needs a backend: turn on one of the features ndarray, flex and wgpu");

mod args;
mod coloured;
mod fused;
mod paint;
mod program;
mod reference;
mod scene;

pub use program::execute;
