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

impl<'a, F: Float> Compared<'a, F> {
    /// Eight pixels at a time: the coverage `w (1 - exp(-sum))` of the share `w` that counts, its derivative by the sum, and the target.
    #[inline(always)]
    fn pixels<L: Lanes<Float = F>>(self) -> impl Iterator<Item = [L; 3]> + use<'a, F, L> {
        let one = splat::<L>(1.0);
        let pixels = self.sums.as_chunks().0.iter().zip(self.target.as_chunks().0);
        let counted = self.counted.map(|counted| counted.as_chunks().0);
        pixels.enumerate().map(move |(k, (sums, target))| {
            let rest = L::of(sums).neg().exp();
            let [coverage, slope] = match counted {
                None => [one - rest, rest],
                Some(counted) => [one - rest, rest].map(|number| number * L::of(&counted[k])),
            };
            [coverage, slope, L::of(target)]
        })
    }
}

/// `Σ (c - t)²` for coverages `c` and targets `t`, lane by lane; `part` becomes half its derivatives by the sums.
#[inline(always)]
pub(super) fn squared_error<L: Lanes>(
    compared: Compared<L::Float>,
    part: &mut [L::Float],
) -> [L; 2] {
    let mut total = splat::<L>(0.0);
    let parts = part.as_chunks_mut().0.iter_mut();
    for (part, [coverage, slope, target]) in parts.zip(compared.pixels::<L>()) {
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
    let pixels = compared.pixels::<L>();
    for ((to_overlap, to_union), [coverage, slope, target]) in parts.zip(pixels) {
        let both = coverage * target;
        overlap += both;
        union += coverage + target - both;
        *to_overlap = (target * slope).array();
        *to_union = ((one - target) * slope).array();
    }
    [overlap, union]
}
