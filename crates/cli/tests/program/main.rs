//! A whole task behind the command line, on the smallest one: files, numbers, bad input, damage.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod comparison;
#[path = "../../examples/disc.rs"]
mod disc;
mod folder;
mod learn;
mod line;
mod results;
mod resume;
mod search;
mod shards;
