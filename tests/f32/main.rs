//! Tests in f32, one file or folder per crate; see also the tests in f64.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod exact_rows;
mod meta;
mod own_softness;
mod raster;
mod reconstruct;
mod shape3d;
mod softness;
