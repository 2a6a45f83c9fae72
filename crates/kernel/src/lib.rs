//! Soft rasterization of triangles on the CPU, over slices of `f32` or `f64`: it depends on no tensor library.
//!
//! Two ops: sums of a profile of the distance over [`Inputs`] (silhouettes), and means of colours over [`blend::Inputs`]. [`Kernels`] runs
//! their passes: the result, its gradient, and the gradient of that. `softrast-raster` wraps them as ops on tensors. [`Nearest`] measures
//! distances between sets of points.
//!
//! # Example: a silhouette and its derivatives
//!
//! The profile of a softness `s` is its optical depth `-ln(1 - s)`: the coverage of a pixel is `1 - exp(-sum)`.
//!
//! ```
//! use softrast_kernel::{Bands, Grid, Inputs, Kernels, bands_of_view};
//!
//! // The logistic of scale 0.05 NDC, drawn up to 12 scales from the edge.
//! let grid = Grid { outer: 0.6, inner: 0.6, from: [0.0; 2], octaves: 24, far: 0, bits: 4 };
//! let table = grid.table(|d| [(d / 0.05).exp().ln_1p(), (1.0 + (-d / 0.05).exp()).recip() / 0.05]);
//!
//! // x of all vertices, then y, then depth: [views, 3, vertices].
//! let vertices = [-0.5, 0.5, 0.0, -0.5, -0.4, 0.5, 1.0, 1.0, 1.0];
//! let (faces, size, views) = ([[0, 1, 2]], [8, 8].into(), 1);
//! let bands = bands_of_view(views, size);
//! let inputs = Inputs { vertices: &vertices, table: &table, faces: &faces, grid, size, near: 0.01, culls: false, views, bands };
//! let lists: Bands = f64::bands(&inputs); // serve all passes over the same vertices
//!
//! // Forward: the sums [views, height, width].
//! let sums = f64::sums(&inputs, &lists);
//! let coverage: Vec<f64> = sums.iter().map(|sum| 1.0 - (-sum).exp()).collect();
//! assert!(coverage[8 * 4 + 4] > 0.95 && coverage[0] < 0.01);
//!
//! // vjp: gradients of the sum of `upstream * sums` with respect to the vertices [views, 3, vertices], and not to the table.
//! let upstream: Vec<f64> = coverage.iter().map(|a| 1.0 - a).collect();
//! let gradient = f64::sums_vjp(&inputs, &lists, &upstream, [true, false]);
//!
//! // The gradient of `direction * gradient`: for the vertices, the second derivative times the direction; for upstream, the jvp.
//! let direction = [0.3, -0.1, 0.2, 0.5, -0.4, 0.1, 0.0, 0.0, 0.0];
//! let along = [true, false]; // the direction is one of vertices, as the gradient is
//! let second = f64::sums_vjp_of_vjp(&inputs, &lists, &upstream, &direction, along, [true, false, false]);
//! let jvp = f64::sums_vjp_of_vjp(&inputs, &lists, &upstream, &direction, along, [false, false, true]);
//!
//! // Both agree with finite differences.
//! let moved = |h: f64| -> [f64; 9] { std::array::from_fn(|k| vertices[k] + h * direction[k]) };
//! let at = |vertices: &[f64; 9]| {
//!     let inputs = Inputs { vertices, ..inputs };
//!     let lists = f64::bands(&inputs);
//!     [f64::sums(&inputs, &lists), f64::sums_vjp(&inputs, &lists, &upstream, [true, false])]
//! };
//! let (h, [less, more]) = (1e-7, [at(&moved(-1e-7)), at(&moved(1e-7))]);
//! for (found, [less, more]) in [(&jvp, [&less[0], &more[0]]), (&second, [&less[1], &more[1]])] {
//!     for (k, found) in found.iter().enumerate() {
//!         let expected = (more[k] - less[k]) / (2.0 * h);
//!         assert!((found - expected).abs() < 1e-4 * expected.abs().max(1.0), "{found}, not {expected}");
//!     }
//! }
//! let [by_gradient, by_jvp] = [(&gradient[..], &direction[..]), (&upstream[..], &jvp[..])]
//!     .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>());
//! assert!((by_gradient - by_jvp).abs() < 1e-9);
//! ```
//!
//! # Implementation
//!
//! One traversal serves every pass of silhouettes, another every pass of colours, over the same
//! bands and lists. A view is cut into bands of rows; each band lists the faces
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
mod rooms;
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
pub use reach::{FAR_AWAY, inside_spans, is_seen_clockwise};
pub use real::Dual;
pub use sum::Inputs;
pub use table::Grid;
pub use tasks::{filled, recorded_tasks, task};

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
