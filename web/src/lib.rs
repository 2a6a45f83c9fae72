//! The Rust side of the page: its tasks, one step at a time.
//!
//! [`Settings`] as JSON become a [`Run`]: [`PoseRun`], [`MaskRun`] or [`ShapeRun`]. Each of its
//! steps is a [`Frame`]. [`Playground`] draws triangles and the gradient of every pixel. All of it
//! is plain Rust and also runs outside a browser; only `exports` depends on browsers.

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

/// The default backend: the CPU, in a single thread if there are no others.
pub type Backend = softrast_tensor::NdArray<f32>;
/// The backend for a GPU, through WebGPU. Outside a browser it is the CPU.
#[cfg(target_family = "wasm")]
pub type Gpu = softrast_raster::Wgpu;
/// The backend for a GPU. Outside a browser it is the CPU.
#[cfg(not(target_family = "wasm"))]
pub type Gpu = Backend;
