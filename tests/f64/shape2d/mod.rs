//! 2D SHAPE.

mod colour;
mod golden;
mod gradient;
