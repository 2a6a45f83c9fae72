//! What is tested in f32, a file or folder for each crate; see the tests in f64.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod exact_rows;
mod meta;
mod own_softness;
mod raster;
mod reconstruct;
mod shape3d;
mod softness;
