//! The steps that every task takes, and the softness they are taken with.

mod descent;
mod learned_edge;
mod surrogate;
