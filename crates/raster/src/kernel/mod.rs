//! The fused op on the CPU: plain Rust over slices, no burn type in sight.
//!
//! One traversal serves every pass. A view is cut into bands of rows; each band lists the faces
//! whose support reaches it and walks their pixels in blocks of a row. Bands are independent, so
//! they run in parallel, and every sum is taken in an order that does not depend on the number of
//! threads. The arithmetic of a pixel-face pair is written once, generic over [`Real`]: floats give
//! the image and its gradient, dual numbers give both second-order products.

mod bands;
pub(crate) mod blend;
mod face;
mod float;
mod lanes;
mod list;
mod loss;
mod pair;
mod pairs;
mod reach;
mod real;
mod scene;
mod sum;
mod table;
mod walk;

pub(crate) use bands::Bands;
pub(crate) use float::Float;
pub(crate) use list::rows_of_bands;
pub(crate) use loss::{EMPTY, Judged, PixelLoss, losses, rows_of_losses};
pub(crate) use pairs::pairs;
pub(crate) use reach::{FAR_AWAY, inside_spans};
pub(crate) use real::Dual;
pub(crate) use sum::{Inputs, forward, vjp, vjp_of_vjp};
pub(crate) use table::Grid;
