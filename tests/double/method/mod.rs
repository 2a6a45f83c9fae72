//! The steps that every task takes.

mod descent;
mod surrogate;
