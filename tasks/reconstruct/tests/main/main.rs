//! The whole program, and tests across crates.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod checkpoint;
mod files;
mod npz;
mod program;
mod shapes;
