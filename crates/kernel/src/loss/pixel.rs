//! Per-pixel losses of silhouettes, and their derivatives with respect to the sums of profiles.

use crate::{float::Float, lanes::Lanes, real::splat};

/// Keeps the ratio of two empty images finite.
pub const EMPTY: f64 = 1e-6;

/// The loss between a silhouette and its target.
///
/// ```
/// use softrast_kernel::{Grid, Inputs, Judged, Kernels, PixelLoss, bands_of_losses};
///
/// let grid = Grid { outer: 0.6, inner: 0.6, from: [0.0; 2], octaves: 24, far: 0, bits: 4 };
/// let table = grid.table(|d| [(d / 0.05).exp().ln_1p(), (1.0 + (-d / 0.05).exp()).recip() / 0.05]);
/// let vertices = [-0.5, 0.5, 0.0, -0.5, -0.4, 0.5, 1.0, 1.0, 1.0];
/// let (faces, size, views) = ([[0, 1, 2]], [8, 8].into(), 1);
/// let bands = bands_of_losses(views, size);
/// let inputs = Inputs { vertices: &vertices, table: &table, faces: &faces, grid, size, near: 0.01, culls: false, views, bands };
/// let lists = f64::bands(&inputs);
///
/// // Without a target, the squared error is the mean of the squared coverage, and nothing overlaps.
/// let judged = Judged { target: &[0.0; 64], counted: None };
/// let [loss, gradient] = f64::losses(&inputs, &lists, judged, PixelLoss::SquaredError, true);
/// let coverage = f64::sums(&inputs, &lists).into_iter().map(|sum| 1.0 - (-sum).exp());
/// assert!((loss[0] - coverage.map(|a| a * a).sum::<f64>() / 64.0).abs() < 1e-12);
/// // The topmost corner should sink.
/// assert!(gradient[5] > 0.0);
/// assert_eq!(f64::losses(&inputs, &lists, judged, PixelLoss::Iou, false)[0], [1.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelLoss {
    /// The mean over pixels of the squared difference.
    SquaredError,
    /// One minus the intersection over union of soft images: `1 - Σ c t / (Σ (c + t - c t) + 1e-6)`.
    Iou,
}

/// Number of sums over pixels in a loss, and of derivatives at each pixel in its gradient: two at most.
pub(super) const PARTS: usize = 2;

impl PixelLoss {
    /// The loss of a view, and the factors of the parts of its gradient, from its sums over `pixels` pixels.
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

/// Sums of profiles over the pixels of a band, the target, and the weight of each pixel, 1 if absent.
#[derive(Clone, Copy)]
pub(super) struct Compared<'a, F> {
    pub(super) sums: &'a [F],
    pub(super) target: &'a [F],
    pub(super) counted: Option<&'a [F]>,
}

impl<F: Float> Compared<'_, F> {
    /// Group `k` of eight pixels: the coverage `w (1 - exp(-sum))` for the weight `w`, its derivative with respect to the sum, and the
    /// target.
    ///
    /// Not an iterator: its closure would be compiled without the vectors of its caller, and each operation would become a call.
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

/// `Σ (c - t)²` for coverages `c` and targets `t`, lane by lane; `part` becomes half its derivatives with respect to the sums.
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

/// `Σ c t` and `Σ (c + t - c t)` for coverages `c` and targets `t`, lane by lane, and the derivatives of each with respect to the sums.
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
