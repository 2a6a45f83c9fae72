//! The program as its user sees it, and the parts that cross crates.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod checkpoint;
mod files;
mod npz;
mod program;
mod shapes;
