//! Test helpers without tensors: property tests with a fixed seed, and programs started as by a user.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod program;
mod property;

pub use program::{Failure, Program, assert_finite, ended, mpirun, warnings};
pub use property::cases;
