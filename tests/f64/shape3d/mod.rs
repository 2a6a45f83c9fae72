//! 3D SHAPE.

mod golden;
mod gradient;
