//! Failure modes of each softness: scenes that break rasterizers and optimisers, worse level by level.
//!
//! A [`Case`] is a scene, a perturbation in levels, a measure and a target. [`run`] runs every case with every [`Tested`] softness; the
//! [`Matrix`] reports the share of trials that reach the target, with an interval, and the level at which a softness begins to fail.
//!
//! Guarantees of this project, such as that all numbers are finite, are not cases but tests: `tests/invariants`.

mod case;
pub mod cases;
pub mod drawing;
mod matrix;
pub mod planar_scene;
mod program;
mod report;
mod tested;

pub use case::{Case, Level, Trial};
pub use cases::cases;
pub use matrix::{LevelOutcome, Matrix, Outcome, Row, run};
pub use program::{chosen, execute};
pub use tested::{Config, Descended, Tested, descend};
