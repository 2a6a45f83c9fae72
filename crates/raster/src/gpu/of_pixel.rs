//! Per-pixel inputs of the gradient kernels.

use cubecl::prelude::*;

use super::{
    blend_inputs::{BlendInputs, BlendSpec},
    dual::Dual,
};

/// Numbers per pixel: the logarithm of the sum of all weights, and the dot product of image and upstream, with their derivatives.
pub(super) const OF_PIXEL: usize = 4;

/// The numbers of a pixel.
#[derive(CubeType, Clone, Copy)]
pub(super) struct OfPixel {
    pub(super) log: Dual,
    pub(super) draw: Dual,
}

#[cube]
impl OfPixel {
    /// Start of the numbers of a pixel of a view of the launch; the gradient of the background follows them.
    pub(super) fn at(
        drawn: &BlendInputs,
        view: u32,
        row: u32,
        column: u32,
        #[comptime] kind: BlendSpec,
    ) -> usize {
        drawn.frame.pixel(drawn.first_view + view, row, column) as usize
            * comptime!(OF_PIXEL + kind.channels + 1)
    }

    pub(super) fn load(pixels: &Array<f32>, at: usize) -> OfPixel {
        OfPixel {
            log: Dual { value: pixels[at], tangent: pixels[at + 1] },
            draw: Dual { value: pixels[at + 2], tangent: pixels[at + 3] },
        }
    }
}
