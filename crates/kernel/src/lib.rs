//! Soft rasterization of triangles on the CPU, over slices of `f32` or `f64`: no tensor in sight.
//!
//! Two ops: sums of a profile of the distance over [`Inputs`] (silhouettes), and means of colours over [`blend::Inputs`].
//! [`Kernels`] runs their passes: the result, its gradient, and the gradient of that. `softrast-raster` makes ops of tensors of them.
//! [`Nearest`] measures how far sets of points are from one another.
//!
//! One traversal serves every pass. A view is cut into bands of rows; each band lists the faces
//! whose support reaches it and walks their pixels in blocks of a row. Bands are independent, so
//! they run in parallel, and every sum is taken in an order that does not depend on the number of
//! threads. The arithmetic of a pixel-face pair is written once, generic over `Real`: floats give
//! the image and its gradient, dual numbers give both second-order products.

mod bands;
pub mod blend;
mod face;
mod float;
mod gather;
mod image_size;
mod kernels;
mod lanes;
mod list;
mod loss;
mod nearest;
mod pair;
mod pairs;
mod reach;
mod real;
mod scene;
mod sum;
mod table;
mod tasks;
mod walk;

pub use bands::{Bands, bands_of_view};
pub use image_size::ImageSize;
pub use kernels::Kernels;
pub use lanes::{Float, use_vectors};
pub use loss::{EMPTY, Judged, PixelLoss, bands_of_losses};
pub use nearest::Nearest;
pub use reach::{FAR_AWAY, inside_spans};
pub use real::Dual;
pub use sum::Inputs;
pub use table::Grid;
pub use tasks::{recorded_tasks, task};
