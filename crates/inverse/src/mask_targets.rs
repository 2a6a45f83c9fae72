use std::sync::Arc;

use burn::tensor::{Tensor, backend::Backend};
use softrast_raster::{RasterBackend, iou_loss};
use softrast_softness::tensor;

use crate::{Picture, Targets};

/// Squares of masks as targets. What lies outside of a picture does not count.
#[derive(Clone, Debug)]
pub struct MaskTargets<B: Backend> {
    levels: Targets<B>,
    /// How much of each pixel the picture covers, unless that is all of every pixel.
    covered: Option<Targets<B>>,
}

impl<B: RasterBackend> MaskTargets<B> {
    /// A square of each mask, given by its left, its top and its extent in pixels, on `size` × `size` pixels.
    pub fn new<'a>(masks: impl IntoIterator<Item = (&'a Picture, [f64; 3])>, size: usize) -> Self {
        let parts = parts(masks, size);
        let images = |k: usize| {
            let numbers = parts.iter().flat_map(|part| part[k].iter().copied()).collect();
            Targets::new(tensor::<B, 3>(numbers, [parts.len(), size, size]))
        };
        let whole = parts.iter().flat_map(|part| &part[1]).all(|&share| share > 1.0 - 1e-9);
        Self { levels: images(0), covered: (!whole).then(|| images(1)) }
    }

    /// The [`iou_loss`] `[views]` of an image `[views, side, side]`, where `side` is the size or a half of a half of it.
    pub fn iou_loss(&self, image: Tensor<B, 3>) -> Tensor<B, 1> {
        let target = self.levels.of(&image);
        let image = match &self.covered {
            Some(covered) => image.clone() * covered.of(&image),
            None => image,
        };
        iou_loss(image, target)
    }
}

/// Squares of pictures on `size` × `size` pixels, each with how much of each pixel the picture covers.
pub(crate) fn parts<'a>(
    pictures: impl IntoIterator<Item = (&'a Picture, [f64; 3])>,
    size: usize,
) -> Vec<Arc<[Vec<f64>; 2]>> {
    let mut parts: Vec<Arc<[Vec<f64>; 2]>> = Vec::new();
    let mut last = None;
    for (picture, square) in pictures {
        // Instances mostly share one picture, which may be large.
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
