//! The Rust side of the page: what is solved and drawn there, one step at a time.
//!
//! Runs are [`Settings`] as JSON that become a [`Run`]: [`PoseRun`], [`MaskRun`] or [`ShapeRun`]. Each step of it is a [`Frame`].
//! [`Playground`] draws triangles and the gradient of every pixel. All of it is plain Rust, so that the same runs on a computer; only
//! `exports` knows of browsers.

mod camera;
mod exports;
mod frame;
mod mask;
mod meshes;
mod picture;
mod playground;
mod pose;
mod settings;
mod shape;

pub use camera::CameraView;
pub use frame::{Coming, Frame, Run};
pub use mask::MaskRun;
pub use meshes::{Loaded, MOST_FACES, loaded};
pub use picture::{luminance, mask};
pub use playground::{Field, Playground, Scene};
pub use pose::PoseRun;
pub use settings::{Settings, SoftnessChoice, curves};
pub use shape::ShapeRun;

/// What everything is computed on unless a GPU was chosen: the CPU, in one thread where there is no other.
pub type Backend = softrast_tensor::NdArray<f32>;
/// What runs are computed on where a GPU was chosen, through WebGPU. On a computer it stands for the CPU.
#[cfg(target_family = "wasm")]
pub type Gpu = softrast_raster::Wgpu;
/// What runs are computed on where a GPU was chosen. On a computer it stands for the CPU.
#[cfg(not(target_family = "wasm"))]
pub type Gpu = Backend;
