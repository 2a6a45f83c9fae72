use softrast_raster::{Projected, RasterBackend, mse_loss};
use softrast_tensor::{Tensor, tensor};

use super::VertexColours;
use crate::{Targets, targets::parts};
use softrast_views::{PaintedView, Picture};

/// Weight of the colour error relative to the `IoU` loss. With 5, 10 and 20, colours found 25, 24
/// and 24 of 28 poses that silhouettes did not (docs/notes.md, Pose by colour).
const COLOURS: f64 = 5.0;
/// Pixels a side of the images that colours are compared on: with more pixels, only nearly matching poses have a gradient.
const SIDES: std::ops::RangeInclusive<usize> = 4..=8;

/// Views of a mesh with colours, and their target pictures.
///
/// An image `[views, 4, side, side]` has red, green and blue over black, from 0 to 1, then the
/// coverage. The side is the size of the pictures, possibly halved some times.
#[derive(Debug)]
pub struct ColouredViews<B: RasterBackend> {
    coat: VertexColours<B>,
    /// Red, green and blue over black, `[3 views, size, size]`, repeatedly halved.
    over_black: Targets<B>,
    /// The share of each pixel with a known colour, unless all colours are known; `[views, size, size]`.
    known: Option<Targets<B>>,
    /// The share of each picture that shows the mesh, `[views]`, at least a pixel.
    covered: Tensor<B, 1>,
}

impl<B: RasterBackend> ColouredViews<B> {
    /// Views with these target pictures: `over_black` `[views, 3, size, size]`, where the mesh has
    /// `coverage` `[views, size, size]`.
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

    /// Views with squares of pictures as targets, each given by its left, top and extent in pixels, on `size` × `size`
    /// pixels. Pixels outside a picture do not count, nor do outlines with unknown colours.
    pub fn of_pictures(
        coat: VertexColours<B>,
        pictures: &[(&PaintedView, [f64; 3])],
        size: usize,
    ) -> Self {
        let of = |which: &dyn Fn(&'_ PaintedView) -> &'_ Picture| {
            parts(pictures.iter().map(|&(view, square)| (which(view), square)), size)
        };
        let colours: Vec<[Picture; 3]> =
            pictures.iter().map(|(view, _)| view.over_black()).collect();
        let squares = || pictures.iter().map(|&(_, square)| square);
        let channels =
            [0, 1, 2].map(|k| parts(colours.iter().map(|of| &of[k]).zip(squares()), size));
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

    /// The target image, with its coverage `[views, size, size]`.
    pub fn target(&self, coverage: Tensor<B, 3>) -> Tensor<B, 4> {
        let [views, size, _] = coverage.dims();
        stack_rgba(self.over_black.full().reshape([views, 3, size, size]), coverage)
    }

    /// The soft image `[views, 4, side, side]` of the projected mesh `seen` `[views, vertices, 3]`, for cameras at
    /// `distance` `[views, 1]` from the mesh, with its soft `coverage` `[views, side, side]`.
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
        stack_rgba(colours * coverage.clone().unsqueeze_dim::<4>(1).expand(shape), coverage)
    }

    /// The hard image `[views, 4, size, size]` of the projected mesh, with its hard `coverage`. It has no gradient.
    pub fn hard_image(&self, seen: Projected<B>, coverage: Tensor<B, 3>) -> Tensor<B, 4> {
        stack_rgba(self.coat.hard(seen, coverage.dims()[1]), coverage)
    }

    /// [`ColouredViews::loss`] of the hard colours of the projected mesh, on `size` × `size` pixels.
    pub(crate) fn hard_loss(&self, seen: Projected<B>, size: usize) -> Tensor<B, 1> {
        self.loss(self.coat.hard(seen, size))
    }

    /// The colour loss `[views]` of the colours `[views, 3, side, side]` of an image: 5 times their error.
    ///
    /// The error is the mean squared difference over black, divided by the share of the picture that shows the mesh, so that it does not
    /// depend on the mesh's size in the picture. It is averaged over the images halved to 8 and 4 pixels a side, or to any sizes from 4 to
    /// 8; if there is none, it is taken at the smallest size that halving reaches.
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

/// Joins colours `[views, 3, side, side]` and coverage `[views, side, side]` to an image.
fn stack_rgba<B: RasterBackend>(colours: Tensor<B, 4>, coverage: Tensor<B, 3>) -> Tensor<B, 4> {
    Tensor::cat(vec![colours, coverage.unsqueeze_dim(1)], 1)
}

/// Splits an image `[views, 4, side, side]` into colours `[views, 3, side, side]` and coverage `[views, side, side]`.
pub fn split_coverage<B: RasterBackend>(image: Tensor<B, 4>) -> (Tensor<B, 4>, Tensor<B, 3>) {
    let coverage = image.clone().narrow(1, 3, 1).squeeze_dim(1);
    (image.narrow(1, 0, 3), coverage)
}
