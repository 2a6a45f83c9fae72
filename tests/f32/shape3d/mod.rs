//! Smoothness losses of 3D SHAPE.

mod flatness;
mod laplacian;
