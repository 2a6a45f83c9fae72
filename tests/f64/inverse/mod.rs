//! Inverse rendering, on problems small enough to know every number.

mod layout;
mod minimize;
mod square;
mod surrogate;
