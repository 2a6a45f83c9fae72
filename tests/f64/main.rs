//! Tests in f64, one folder per crate, and tests that span crates.
//!
//! One binary, because burn is slow to build and fixes the float type of a device per process.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod differences;
mod exact_rows;
mod inverse;
mod meta;
mod meta_gradients;
mod occlusion;
mod pose;
mod raster;
mod reconstruct;
mod shape2d;
mod shape3d;
mod softness;
mod task_meta_gradients;
