use softrast_raster::{Projected, RasterBackend, mse_loss};
use softrast_tensor::{Tensor, tensor};

use super::VertexColours;
use crate::{Targets, targets::parts};
use softrast_views::{PaintedView, Picture};

/// Weight of the error of colours beside the `IoU` loss. With 5, 10 and 20, colours found 25, 24 and 24 of 28 poses that silhouettes did not
/// (docs/notes.md, Pose by colour).
const COLOURS: f64 = 5.0;
/// Colours are compared on pictures of so many pixels a side: on more, only what nearly fits pulls.
const SIDES: std::ops::RangeInclusive<usize> = 4..=8;

/// Views of a mesh with colours, and the pictures that they should be.
///
/// An image `[views, 4, side, side]` has red, green and blue over black, from 0 to 1, then the coverage. The side is the size of the
/// pictures, or that halved some times.
#[derive(Debug)]
pub struct ColouredViews<B: RasterBackend> {
    coat: VertexColours<B>,
    /// Red, green and blue over black, `[3 views, size, size]`, and halves of halves of it.
    over_black: Targets<B>,
    /// The part of each pixel whose colour is known, unless that is all of every pixel; `[views, size, size]`.
    known: Option<Targets<B>>,
    /// The part of each picture that shows the mesh, `[views]`, or a pixel of it.
    covered: Tensor<B, 1>,
}

impl<B: RasterBackend> ColouredViews<B> {
    /// Views that should show these pictures: `over_black` `[views, 3, size, size]`, of which the mesh covers `coverage`
    /// `[views, size, size]`.
    pub fn new(coat: VertexColours<B>, over_black: Tensor<B, 4>, coverage: Tensor<B, 3>) -> Self {
        let [views, _, size, _] = over_black.dims();
        let mean = coverage.flatten::<2>(1, 2).mean_dim(1).reshape([views]);
        Self {
            coat,
            over_black: Targets::new(over_black.reshape([3 * views, size, size])),
            known: None,
            covered: mean.clamp_min(((size * size) as f64).recip()),
        }
    }

    /// Views that should show these parts of pictures, each given by its left, its top and its extent in pixels, on `size` × `size` pixels.
    /// What lies outside of a picture does not count, nor does an outline whose colours are not known.
    pub fn of_pictures(
        coat: VertexColours<B>,
        pictures: &[(&PaintedView, [f64; 3])],
        size: usize,
    ) -> Self {
        let of = |which: &dyn Fn(&'_ PaintedView) -> &'_ Picture| {
            parts(pictures.iter().map(|&(view, square)| (which(view), square)), size)
        };
        let channels = [0, 1, 2].map(|k| of(&|view| &view.over_black[k]));
        let (masks, shown) = (of(&|view| &view.view.mask), of(&|view| &view.part));
        let views = masks.len();
        let over_black = (0..views).flat_map(|v| channels.each_ref().map(|channel| &channel[v][0]));
        let over_black = over_black.flatten().copied().collect();
        let coverage = shown.iter().flat_map(|part| part[0].iter().copied()).collect();
        let known = masks.iter().zip(&shown).flat_map(|(mask, shown)| {
            let pixels = mask[0].iter().zip(&mask[1]).zip(&shown[0]);
            pixels.map(|((mask, inside), shown)| inside - mask + shown)
        });
        let known: Vec<f64> = known.collect();
        let all = known.iter().all(|&part| part > 1.0 - 1e-6);
        let known = (!all).then(|| Targets::new(tensor(known, [views, size, size])));
        let over_black = tensor(over_black, [views, 3, size, size]);
        Self { known, ..Self::new(coat, over_black, tensor(coverage, [views, size, size])) }
    }

    /// The image to arrive at, with its coverage `[views, size, size]`.
    pub fn target(&self, coverage: Tensor<B, 3>) -> Tensor<B, 4> {
        let [views, size, _] = coverage.dims();
        joined(self.over_black.full().reshape([views, 3, size, size]), coverage)
    }

    /// The soft image `[views, 4, side, side]` of what is `seen`, `[views, vertices, 3]`, by cameras at this `distance` `[views, 1]` of the
    /// mesh, with its soft `coverage` `[views, side, side]`.
    ///
    /// Colours are hardly softened, but multiplied by the coverage.
    pub fn image(
        &self,
        seen: Projected<B>,
        distance: Tensor<B, 2>,
        coverage: Tensor<B, 3>,
    ) -> Tensor<B, 4> {
        let colours = self.coat.soft(seen, distance, coverage.dims()[1]);
        let shape = colours.dims();
        joined(colours * coverage.clone().unsqueeze_dim::<4>(1).expand(shape), coverage)
    }

    /// The hard image `[views, 4, size, size]` of what is seen, with its hard `coverage`. It has no gradient.
    pub fn hard_image(&self, seen: Projected<B>, coverage: Tensor<B, 3>) -> Tensor<B, 4> {
        joined(self.coat.hard(seen, coverage.dims()[1]), coverage)
    }

    /// [`ColouredViews::loss`] of the hard colours of what is seen, on `size` × `size` pixels.
    pub(crate) fn hard_loss(&self, seen: Projected<B>, size: usize) -> Tensor<B, 1> {
        self.loss(self.coat.hard(seen, size))
    }

    /// What is wrong with the colours `[views, 3, side, side]` of an image, `[views]`: 5 times their error.
    ///
    /// The error is their mean squared difference over black, divided by the part of the picture that shows the mesh, so that it does
    /// not depend on how large the mesh is seen: the mean of it on pictures of 8 and 4 pixels a side, or whatever halves of halves of the
    /// side there are from 4 to 8. Where there is none, it is that of the fewest pixels that halving leads to.
    pub fn loss(&self, colours: Tensor<B, 4>) -> Tensor<B, 1> {
        let [views, _, side, _] = colours.dims();
        let colours = match &self.known {
            Some(known) => {
                let known = known.of(&Tensor::zeros([1, side, side], &colours.device()));
                colours.clone() * known.unsqueeze_dim::<4>(1).expand(colours.dims())
            }
            None => colours,
        };
        let colours = Targets::new(colours.reshape([3 * views, side, side]));
        let mut errors = Vec::new();
        let fewest = colours.levels().last().map_or(side, |level| level.dims()[1]);
        for level in colours.levels() {
            let [_, side, _] = level.dims();
            if SIDES.contains(&side) || (errors.is_empty() && side == fewest) {
                let both = [level.clone(), self.over_black.of(level)];
                let [found, wanted] = both.map(|of| of.reshape([views, 3, side, side]));
                errors.push(mse_loss(found, wanted));
            }
        }
        let count = errors.len() as f64;
        let error =
            Tensor::stack::<2>(errors, 0).sum_dim(0).reshape([views]) / self.covered.clone();
        error * (COLOURS / count)
    }
}

/// Colours `[views, 3, side, side]` and coverage `[views, side, side]` as an image.
fn joined<B: RasterBackend>(colours: Tensor<B, 4>, coverage: Tensor<B, 3>) -> Tensor<B, 4> {
    Tensor::cat(vec![colours, coverage.unsqueeze_dim(1)], 1)
}

/// Colours `[views, 3, side, side]` and coverage `[views, side, side]` of an image `[views, 4, side, side]`.
pub fn split_coverage<B: RasterBackend>(image: Tensor<B, 4>) -> (Tensor<B, 4>, Tensor<B, 3>) {
    let coverage = image.clone().narrow(1, 3, 1).squeeze_dim(1);
    (image.narrow(1, 0, 3), coverage)
}
