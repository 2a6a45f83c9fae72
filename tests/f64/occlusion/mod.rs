//! OCCLUSION.

mod bad_cases;
mod golden;
mod gradient;
