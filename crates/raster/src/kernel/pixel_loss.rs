//! Losses of silhouettes pixel by pixel, and what the gradient to the sums of profiles is made of.

use super::{float::Float, lanes::Lanes, real::splat};

/// Keeps the ratio of two empty images defined.
pub(crate) const EMPTY: f64 = 1e-6;

/// What compares a silhouette with its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PixelLoss {
    /// See [`crate::mse_loss`].
    SquaredError,
    /// See [`crate::iou_loss`].
    Iou,
}

/// Sums over pixels that a loss is made of, and derivatives by the sum of profiles at each pixel that its gradient is made of: two at most.
pub(super) const PARTS: usize = 2;

impl PixelLoss {
    /// The loss of a view, and the factors of the parts of its gradient, from its sums over so many pixels.
    pub(super) fn of_sums<F: Float>(
        self,
        [first, second]: [F; PARTS],
        pixels: usize,
    ) -> (F, [F; PARTS]) {
        let number = F::from_f64;
        match self {
            Self::SquaredError => {
                let share = F::ONE / number(pixels as f64);
                (first * share, [number(2.0) * share, F::ZERO])
            }
            // d(1 - overlap / union) = -(1 / union) d overlap + (overlap / union²) d union.
            Self::Iou => {
                let inverse = F::ONE / (second + number(EMPTY));
                let ratio = first * inverse;
                (F::ONE - ratio, [-inverse, ratio * inverse])
            }
        }
    }
}

/// `Σ (c - t)²` for the coverages `c = 1 - exp(-sum)`, lane by lane; `part` becomes half its derivatives by the sums.
#[inline(always)]
pub(super) fn squared_error<L: Lanes>(
    sums: &[L::Float],
    target: &[L::Float],
    part: &mut [L::Float],
) -> [L; 2] {
    let one = splat::<L>(1.0);
    let mut total = splat::<L>(0.0);
    let pixels = sums.as_chunks().0.iter().zip(target.as_chunks().0);
    for (part, (sums, target)) in part.as_chunks_mut().0.iter_mut().zip(pixels) {
        let rest = L::of(sums).neg().exp();
        let difference = one - rest - L::of(target);
        total += difference * difference;
        *part = (difference * rest).array();
    }
    [total, splat(0.0)]
}

/// `Σ c t` and `Σ (c + t - c t)` for the coverages `c = 1 - exp(-sum)`, lane by lane, and the derivatives of each by the sums.
#[inline(always)]
pub(super) fn overlap_and_union<L: Lanes>(
    sums: &[L::Float],
    target: &[L::Float],
    to_overlap: &mut [L::Float],
    to_union: &mut [L::Float],
) -> [L; 2] {
    let one = splat::<L>(1.0);
    let (mut overlap, mut union) = (splat::<L>(0.0), splat::<L>(0.0));
    let pixels = sums.as_chunks().0.iter().zip(target.as_chunks().0);
    let parts = to_overlap.as_chunks_mut().0.iter_mut().zip(to_union.as_chunks_mut().0);
    for ((to_overlap, to_union), (sums, target)) in parts.zip(pixels) {
        let (rest, target) = (L::of(sums).neg().exp(), L::of(target));
        let coverage = one - rest;
        let both = coverage * target;
        overlap += both;
        union += coverage + target - both;
        *to_overlap = (target * rest).array();
        *to_union = ((one - target) * rest).array();
    }
    [overlap, union]
}
