//! Helpers of all tests that need no tensors: property tests that draw from a fixed seed, and programs that are started as their user starts
//! them.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod program;
mod property;

pub use program::{Failure, Program, assert_finite, ended, mpirun, warnings};
pub use property::cases;
