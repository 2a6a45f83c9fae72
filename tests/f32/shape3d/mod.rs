//! What keeps the surface of 3D SHAPE smooth.

mod flatness;
mod laplacian;
