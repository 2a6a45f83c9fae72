//! Losses of silhouettes pixel by pixel, and what the gradient to the sums of profiles is made of.

use crate::{float::Float, lanes::Lanes, real::splat};

/// Keeps the ratio of two empty images defined.
pub const EMPTY: f64 = 1e-6;

/// What compares a silhouette with its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelLoss {
    /// The mean over pixels of the squared difference.
    SquaredError,
    /// One less the overlap over the union, of soft images: `1 - Σ c t / (Σ (c + t - c t) + 1e-6)`.
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

/// Sums of profiles over the pixels of a band, what they are compared with, and the share of each pixel that counts, unless all do.
#[derive(Clone, Copy)]
pub(super) struct Compared<'a, F> {
    pub(super) sums: &'a [F],
    pub(super) target: &'a [F],
    pub(super) counted: Option<&'a [F]>,
}

impl<F: Float> Compared<'_, F> {
    /// Eight pixels, number `k` of such groups: the coverage `w (1 - exp(-sum))` of the share `w` that counts, its derivative by the sum, and the
    /// target.
    ///
    /// Not an iterator: the closure of one is compiled without the vectors of its caller, and each operation becomes a call.
    #[inline(always)]
    fn pixels<L: Lanes<Float = F>>(&self, k: usize) -> [L; 3] {
        let rest = L::of(&self.sums.as_chunks().0[k]).neg().exp();
        let target = L::of(&self.target.as_chunks().0[k]);
        let coverage = splat::<L>(1.0) - rest;
        match self.counted {
            None => [coverage, rest, target],
            Some(counted) => {
                let share = L::of(&counted.as_chunks().0[k]);
                [coverage * share, rest * share, target]
            }
        }
    }
}

/// `Σ (c - t)²` for coverages `c` and targets `t`, lane by lane; `part` becomes half its derivatives by the sums.
#[inline(always)]
pub(super) fn squared_error<L: Lanes>(
    compared: Compared<L::Float>,
    part: &mut [L::Float],
) -> [L; 2] {
    let mut total = splat::<L>(0.0);
    for (k, part) in part.as_chunks_mut().0.iter_mut().enumerate() {
        let [coverage, slope, target] = compared.pixels::<L>(k);
        let difference = coverage - target;
        total += difference * difference;
        *part = (difference * slope).array();
    }
    [total, splat(0.0)]
}

/// `Σ c t` and `Σ (c + t - c t)` for coverages `c` and targets `t`, lane by lane, and the derivatives of each by the sums.
#[inline(always)]
pub(super) fn overlap_and_union<L: Lanes>(
    compared: Compared<L::Float>,
    to_overlap: &mut [L::Float],
    to_union: &mut [L::Float],
) -> [L; 2] {
    let one = splat::<L>(1.0);
    let (mut overlap, mut union) = (splat::<L>(0.0), splat::<L>(0.0));
    let parts = to_overlap.as_chunks_mut().0.iter_mut().zip(to_union.as_chunks_mut().0);
    for (k, (to_overlap, to_union)) in parts.enumerate() {
        let [coverage, slope, target] = compared.pixels::<L>(k);
        let both = coverage * target;
        overlap += both;
        union += coverage + target - both;
        *to_overlap = (target * slope).array();
        *to_union = ((one - target) * slope).array();
    }
    [overlap, union]
}
