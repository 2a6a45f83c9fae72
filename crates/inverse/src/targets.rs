use std::sync::Arc;

use softrast_raster::{ImageSize, RasterBackend, iou_loss, mse_loss};
use softrast_tensor::{Backend, Tensor, tensor};

use crate::Resolution;
use softrast_views::Picture;

/// A target image at every size that a run may draw at: its own and, by averaging over areas, each
/// half of the one before while that is a whole number.
///
/// ```
/// use softrast_inverse::Targets;
/// use softrast_raster::HostBackend;
/// use softrast_tensor::{numbers, tensor};
///
/// let targets = Targets::<HostBackend>::new(tensor(vec![0.0, 1.0, 0.0, 1.0], [1, 2, 2]));
/// assert_eq!(targets.levels().len(), 2);
/// // The mean of the target is one half.
/// let coarse = tensor(vec![1.0], [1, 1, 1]);
/// assert_eq!(numbers(targets.mse_loss(coarse)), [0.25]);
/// ```
#[derive(Clone, Debug)]
pub struct Targets<B: Backend> {
    /// `[views, height, width]`, the largest first.
    levels: Vec<Tensor<B, 3>>,
    /// The weight of each pixel, at the same sizes, unless all pixels count in full.
    counted: Option<Vec<Tensor<B, 3>>>,
}

impl<B: Backend> Targets<B> {
    /// All sizes of `target` `[views, height, width]`.
    pub fn new(target: Tensor<B, 3>) -> Self {
        Self { levels: halves(target), counted: None }
    }

    /// Squares of masks, each given by its left, top and extent in pixels, on `size` × `size`
    /// pixels. Pixels outside a picture do not count.
    pub fn of_masks<'a>(
        masks: impl IntoIterator<Item = (&'a Picture, [f64; 3])>,
        size: usize,
    ) -> Self {
        let parts = parts(masks, size);
        let images = |k: usize| {
            let numbers = parts.iter().flat_map(|part| part[k].iter().copied()).collect();
            halves(tensor::<B, 3>(numbers, [parts.len(), size, size]))
        };
        let whole = parts.iter().flat_map(|part| &part[1]).all(|&share| share > 1.0 - 1e-9);
        Self { levels: images(0), counted: (!whole).then(|| images(1)) }
    }

    /// The target at its full size.
    pub fn full(&self) -> Tensor<B, 3> {
        self.levels[0].clone()
    }

    /// The target at all sizes, the largest first.
    pub fn levels(&self) -> &[Tensor<B, 3>] {
        &self.levels
    }

    /// The target for an `image` `[views, height, width]`.
    ///
    /// # Panics
    ///
    /// If no size is that of the image.
    pub fn of(&self, image: &Tensor<B, 3>) -> Tensor<B, 3> {
        self.at(size_of(image)).0
    }

    /// The target of this size, and the weight of each pixel, unless all pixels count in
    /// full; both `[views, height, width]`.
    ///
    /// # Panics
    ///
    /// If there is no such size.
    pub fn at(&self, size: ImageSize) -> (Tensor<B, 3>, Option<Tensor<B, 3>>) {
        let level = self.levels.iter().position(|level| size_of(level) == size);
        let level = level.unwrap_or_else(|| {
            panic!("there is no target of {} x {} pixels", size.width, size.height)
        });
        let counted = self.counted.as_ref().map(|counted| counted[level].clone());
        (self.levels[level].clone(), counted)
    }
}

impl<B: RasterBackend> Targets<B> {
    /// The [`iou_loss`] `[views]` of an `image` `[views, height, width]`, weighted by pixel.
    ///
    /// # Panics
    ///
    /// If no size is that of the image.
    pub fn iou_loss(&self, image: Tensor<B, 3>) -> Tensor<B, 1> {
        let (image, target) = self.judged(image);
        iou_loss(image, target)
    }

    /// The [`mse_loss`] `[views]` of an `image` `[views, height, width]`, weighted by pixel.
    ///
    /// # Panics
    ///
    /// If no size is that of the image.
    pub fn mse_loss(&self, image: Tensor<B, 3>) -> Tensor<B, 1> {
        let (image, target) = self.judged(image);
        mse_loss(image, target)
    }

    /// The weighted difference of an image `[views, size, size]` and the target, averaged down to
    /// `side` × `side` pixels: `[views, side, side]`.
    ///
    /// # Panics
    ///
    /// If no size is that of the image, or `side` is not reached by halving it.
    pub fn differences(&self, image: Tensor<B, 3>, side: usize) -> Tensor<B, 3> {
        let (mut image, mut target) = self.judged(image);
        while image.dims()[1] > side {
            (image, target) = (halved(image), halved(target));
        }
        image - target
    }

    fn judged(&self, image: Tensor<B, 3>) -> (Tensor<B, 3>, Tensor<B, 3>) {
        match self.at(size_of(&image)) {
            (target, Some(counted)) => (image * counted, target),
            (target, None) => (image, target),
        }
    }
}

/// Size of an image `[views, height, width]`.
fn size_of<B: Backend>(image: &Tensor<B, 3>) -> ImageSize {
    let [_, height, width] = image.dims();
    [height, width].into()
}

/// An image `[views, height, width]` at all sizes, the largest first.
fn halves<B: Backend>(image: Tensor<B, 3>) -> Vec<Tensor<B, 3>> {
    let smaller = Resolution::sizes(size_of(&image)).skip(1);
    smaller.fold(vec![image], |mut levels, _| {
        let next = halved(levels[levels.len() - 1].clone());
        levels.push(next);
        levels
    })
}

/// Squares of pictures on `size` × `size` pixels, each with the share of each pixel that the picture covers.
pub(crate) fn parts<'a>(
    pictures: impl IntoIterator<Item = (&'a Picture, [f64; 3])>,
    size: usize,
) -> Vec<Arc<[Vec<f64>; 2]>> {
    let mut parts: Vec<Arc<[Vec<f64>; 2]>> = Vec::new();
    let mut last = None;
    for (picture, square) in pictures {
        // Instances often share one picture, which may be large.
        let same = |&(other, at): &(&Picture, [f64; 3])| {
            std::ptr::eq(other.pixels(), picture.pixels()) && at == square
        };
        let part = match parts.last().filter(|_| last.as_ref().is_some_and(same)) {
            Some(part) => part.clone(),
            None => picture.part(square, size).into(),
        };
        parts.push(part);
        last = Some((picture, square));
    }
    parts
}

/// Means of two by two pixels: `[views, height, width]` to `[views, height / 2, width / 2]`.
fn halved<B: Backend>(image: Tensor<B, 3>) -> Tensor<B, 3> {
    let [views, height, width] = image.dims();
    let (rows, columns) = (height / 2, width / 2);
    let across = image.reshape([views, height, columns, 2]).mean_dim(3);
    across.reshape([views, rows, 2, columns]).mean_dim(2).reshape([views, rows, columns])
}

#[cfg(test)]
mod tests {
    use softrast_raster::HostBackend;

    use super::*;
    use softrast_tensor::{numbers, tensor};

    #[test]
    fn a_smaller_target_has_the_means_of_areas() {
        let image =
            vec![0.0, 1.0, 0.5, 0.5, 1.0, 0.0, 0.5, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0];
        let image = tensor::<HostBackend, 3>(image, [1, 4, 4]);
        let targets = Targets::new(image.clone());
        let at = |side| numbers(targets.of(&Tensor::zeros([1, side, side], &Default::default())));
        assert_eq!(at(4), numbers(image.clone()));
        assert_eq!(at(2), [0.5, 0.375, 1.0, 0.25]);
        assert_eq!(at(1), numbers(image.mean()));
    }

    #[test]
    #[should_panic(expected = "no target of 2 x 2 pixels")]
    fn a_size_that_is_no_half_of_a_half_has_no_target() {
        let targets = Targets::new(Tensor::<HostBackend, 3>::zeros([2, 6, 6], &Default::default()));
        let _ = targets.of(&Tensor::zeros([2, 3, 3], &Default::default()));
        let _ = targets.of(&Tensor::zeros([2, 2, 2], &Default::default()));
    }
}
