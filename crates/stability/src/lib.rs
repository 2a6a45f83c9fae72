//! Where each softness fails: scenes that break rasterizers and optimisers, made worse step by step.
//!
//! A [`Case`] is a scene, a perturbation in levels, a measure and a target. [`run`] puts every [`Tested`] softness through every case; the
//! [`Matrix`] says which share of trials reaches the target, with an interval, and at which level a softness begins to fail.
//!
//! What this project promises, such as that no number is ever not finite, is no case but a test: `tests/invariants`.

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
