//! The rasterizer: cameras, the reference, and comparisons of the fused op with it.

mod bad_cases;
mod camera;
mod colour;
mod colour_loss;
mod elementary;
mod fused;
mod hard;
mod images;
mod losses;
mod pinhole;
mod pytorch3d;
mod reference;
mod shading;
mod silhouette_loss;
mod soft_blend;
mod soft_renderer;
mod threads;
mod tolerance;
#[path = "../../../crates/raster/tests/triangles/mod.rs"]
mod triangles;
