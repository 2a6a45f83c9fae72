//! Soft step functions for differentiable rasterizers, as burn tensor ops.

mod logistic;
mod softness;

pub use logistic::Logistic;
pub use softness::Softness;
