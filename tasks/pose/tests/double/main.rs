//! What is tested in f64: one binary, because burn is slow to build and fixes the float type of a
//! device per process.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod golden;
mod gradient;
