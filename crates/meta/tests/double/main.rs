//! What is tested in f64: one binary, because burn is slow to build and fixes the float type of a
//! device per process.

mod learner;
mod meta_gradient;
#[path = "../waves/mod.rs"]
mod waves;
