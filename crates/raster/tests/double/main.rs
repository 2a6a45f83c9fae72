//! What is tested in f64: one binary, because burn is slow to build and fixes the float type of a
//! device per process.

mod bad_cases;
mod colour;
mod common;
mod fused;
mod tolerance;
