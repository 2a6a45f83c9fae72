use softrast_tensor::{Backend, Tensor, tensor};

use softrast_views::PaintedView;

/// Lower limit of the divisor: in views where fewer pixels count, the loss is about 0 for any image.
const LEAST_PIXELS: f64 = 1e-6;

/// Colours of squares of views, as targets.
#[derive(Clone, Debug)]
pub struct PaintTargets<B: Backend> {
    /// Red, green and blue over black, `[views, 3, size, size]`.
    over_black: Tensor<B, 4>,
    /// Weight of each pixel, `[views, 1, size, size]`.
    part: Tensor<B, 4>,
    /// Sum of the weights.
    pixels: f64,
}

impl<B: Backend> PaintTargets<B> {
    /// Squares of views, each given by its left, top and extent in pixels, resampled to `size` × `size` pixels.
    pub fn new<'a>(
        views: impl IntoIterator<Item = (&'a PaintedView, [f64; 3])>,
        size: usize,
    ) -> Self {
        let (mut colours, mut parts, mut count) = (Vec::new(), Vec::new(), 0);
        for (view, square) in views {
            for channel in view.over_black() {
                let [levels, _] = channel.part(square, size);
                colours.extend(levels);
            }
            let [levels, _] = view.part.part(square, size);
            parts.extend(levels);
            count += 1;
        }
        let pixels = parts.iter().sum();
        Self {
            over_black: tensor(colours, [count, 3, size, size]),
            part: tensor(parts, [count, 1, size, size]),
            pixels,
        }
    }

    /// Sum of the pixel weights over all views.
    pub fn pixels(&self) -> f64 {
        self.pixels
    }

    /// The mean squared difference `[1]` of colours where both a view and an image show the object, for an image
    /// `[views, 4, size, size]` that a `ColourRenderer` drew over black, with the faces' share last.
    ///
    /// With S the share, S c the drawn colour, a the weight and a C the known colour over black,
    /// this is `Σ (a S c - S a C)² / (3 Σ a)`: a pixel is weighted by `(a S)²`, no division can
    /// fail, and neither the view's nor the image's background contributes.
    pub fn loss(&self, image: Tensor<B, 4>) -> Tensor<B, 1> {
        let drawn = image.clone().narrow(1, 0, 3);
        let share = image.narrow(1, 3, 1);
        let shape = drawn.dims();
        let off =
            drawn * self.part.clone().expand(shape) - self.over_black.clone() * share.expand(shape);
        (off.clone() * off).sum() * (3.0 * self.pixels.max(LEAST_PIXELS)).recip()
    }
}
