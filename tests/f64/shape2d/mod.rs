//! 2D SHAPE.

mod golden;
mod gradient;
