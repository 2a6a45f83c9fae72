//! Where each softness fails: scenes that break rasterizers and optimisers, made worse step by step.
//!
//! A [`Case`] is a scene, a perturbation in levels, a measure and a target. [`run`] puts every
//! [`Tested`] method through every case; the [`Matrix`] of their [`Outcome`]s says which share of
//! trials reaches the target, with an interval, and at which level a method begins to fail. Some
//! targets are promises of this project, such as that no number is ever not finite: to miss one is a
//! fault of the program. The others are properties of the methods.

mod case;
mod cases;
mod chart;
mod descent;
mod drawn;
mod flat;
mod matrix;
mod outcome;
mod program;
mod report;
mod suite;
mod tested;

pub use case::{Case, Level, Promise, Trial};
pub use cases::cases;
pub use matrix::{Matrix, Row};
pub use outcome::{LevelOutcome, Outcome};
pub use program::{chosen, execute, main};
pub use suite::run;
pub use tested::Tested;

use descent::{Descended, Descent};
