//! POSE.

mod golden;
mod gradient;
