//! POSE.

mod colour;
mod golden;
mod gradient;
