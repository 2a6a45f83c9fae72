//! Inverse rendering, on problems small enough to compute by hand.

mod another_phi;
mod layout;
mod minimize;
mod own_softness;
mod paint;
mod schedule;
mod square;
mod surrogate;
