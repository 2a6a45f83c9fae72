//! A function of the signed distance as cubics of its square, in the layout of the tables of kernels.

mod knots;
mod precise;
mod settled;

use softrast_kernel::Grid;
use softrast_tensor::{Backend, DType, Tensor, TensorData, numbers};

pub(crate) use knots::FAR;
use knots::{EVERYWHERE, NARROWEST, Reached, refined};
pub(crate) use precise::{precise, rounding};
pub(crate) use settled::settled_until;

/// Signs of the distances on each side: outer, inner.
pub(crate) const SIGNS: [f64; 2] = [-1.0, 1.0];
/// No drawn face is farther from a pixel, in NDC.
pub(crate) const FARTHEST_DRAWN: f64 = 1.5e6;
/// The largest radius that a curve may be stretched to, in NDC: its square fits an f32.
const WIDEST: f64 = 1e9;
/// Tails have the value at this multiple of the support. Any position beyond the support is equally good for the image; but if the curve
/// ends with a steep slope, its parameters must not move the whole tail.
pub(crate) const BEYOND: f64 = 1.1;
/// Distance before its end at which the slope of the last cell is taken, as a fraction of the cell.
const INSIDE: f64 = 1.0 / 1024.0;
/// Distance before the start of the cells at which the constant is taken, as a fraction of the distance: more than the rounding of f32.
const SHORT: f64 = 2e-6;
/// Positions in a cell at which its error is measured: those of the largest error of a smooth curve; and how many if it may be elsewhere.
const PLACES: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
const DENSE: u32 = 16;
/// The innermost cell is a straight line over all smaller distances: exponents of the positions at which it is measured as well, each at a
/// quarter of the distance of the previous one.
const INNERMOST: std::ops::RangeInclusive<i32> = 1..=20;
const NEARER: f64 = 1.0 / 16.0;
/// The fraction of its rise by which a cubic may miss the next knot.
const WIDE_OF: f64 = 0.1;

/// The layout of the cells of a curve, and the computation of its cubics.
///
/// The table consists of two one-sided halves that meet at the edge of the face, where curves kink or rise with infinite slope. Its cells
/// are spaced by the leading bits of the squared distance: each octave holds the same number of cells, so no curve needs a special spacing,
/// and a look-up needs no logarithm, no square root and no search.
///
/// The curve is evaluated only for values and slopes at the knots. These are tensor ops, so gradients of any order reach its parameters,
/// and an MLP costs no more per pixel than a logistic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CubicCurve {
    pub(crate) grid: Grid,
    /// Whether some cells are too wide for their cubics.
    rough: bool,
}

impl CubicCurve {
    /// Cells between the `radii`, outer and inner, that are fine enough for `error` to be at most 1, or as fine as allowed; and the largest
    /// error.
    ///
    /// `curve` returns value and slope at distances in the most precise float type of the device; `error` rates an exact value and that of
    /// a cubic, looked up in the float type `sums`. `from` returns the distances from the edge at which the sides start to change; it is
    /// called if knots close to the edge are not enough. `far` holds octaves to try at the end of the support; empty for look-ups without
    /// them.
    pub(crate) fn chosen<B: Backend>(
        curve: impl Fn(Tensor<B, 1>) -> [Tensor<B, 1>; 2],
        radii: [f64; 2],
        from: impl FnOnce() -> [f64; 2],
        far: &[u32],
        error: impl Fn(f64, f64) -> f64,
        sums: DType,
        device: &B::Device,
    ) -> (Self, f64) {
        let missed = |cells: Self, places: &[f64]| {
            let mut reached = Reached::NOTHING;
            for sample in cells.samples(&curve, places, sums, device) {
                let place =
                    if sample.innermost { &mut reached.innermost } else { &mut reached.rest };
                for interpolated in sample.interpolated {
                    *place = worse(*place, error(sample.exact, interpolated));
                }
            }
            reached
        };
        let smooth = |grid: Grid| Self { grid, rough: false };
        let (grid, reached) = refined(radii, from, far, |grid| missed(smooth(grid), &PLACES));
        if reached.most() <= 1.0 {
            return (smooth(grid), reached.most());
        }
        let rough = Self { grid, rough: true };
        let dense: Vec<f64> = (1..=DENSE).map(|k| f64::from(k) / f64::from(DENSE)).collect();
        (rough, missed(rough, &dense).most())
    }

    /// The cells of the curve stretched by `factor` along the distance, with the same errors.
    ///
    /// `None` if a radius would leave the drawable range, so that the cells have to be chosen anew.
    pub(crate) fn stretched(mut self, factor: f64) -> Option<Self> {
        let stretch = |radius: &mut f64| {
            let least = if *radius >= EVERYWHERE { FARTHEST_DRAWN } else { NARROWEST };
            // A side of the least radius is constant, or nearly so: a narrower one would be no better.
            if *radius > NARROWEST || factor > 1.0 {
                *radius *= factor;
            }
            (least..=WIDEST).contains(radius)
        };
        self.grid.from = self.grid.from.map(|from| from * factor);
        (stretch(&mut self.grid.outer) && stretch(&mut self.grid.inner)).then_some(self)
    }

    /// Coefficients of the cubics, `[rows, 4]`, of a `curve` that returns value and slope at distances `[N]` on this device and in this
    /// float type.
    ///
    /// The cubic of a cell has the curve's value at the near end, and its slopes at both ends and in the middle. Its error is that of the
    /// cubic with the values and slopes of both ends, `t² (1 - t)²` times a 24th of the fourth derivative, to leading order. Differences of
    /// slopes of neighbours keep their digits where differences of values do not, especially next to the edge: in f32 the latter would lose
    /// the second derivative.
    pub(crate) fn table<B: Backend>(
        &self,
        curve: impl Fn(Tensor<B, 1>) -> [Tensor<B, 1>; 2],
        (device, dtype): (&B::Device, DType),
    ) -> Tensor<B, 2> {
        let knots = self.grid.knots();
        let cells = self.grid.cells();
        let constant = |values: Vec<f64>| {
            let shape = [values.len()];
            Tensor::<B, 1>::from_data(TensorData::new(values, shape), (device, dtype))
        };
        // After the knots come the middles of all cells except the innermost, whose slopes are needed, and the tail.
        let middle = |pair: &[f64]| 0.5 * (pair[0] + pair[1]);
        let middles = knots[1..].windows(2).map(middle);
        let mut places: Vec<f64> =
            knots.iter().copied().chain(middles).chain([BEYOND * BEYOND]).collect();
        // A support often ends at a corner: rounding must not determine which of its slopes the last cell gets.
        places[cells] -= INSIDE * (knots[cells] - knots[cells - 1]);
        let grid = self.grid;
        // A distance of 0 has no side; this one has, and is negligible also in a wide support. If a side is constant before its cells,
        // rounding must not determine on which side of a corner their start lies.
        let nudged = |side: usize, y: f64| {
            let least = grid.distance(side, 1.0).min(1.0) * 1e-15;
            let distance = match y {
                0.0 => least.max((1.0 - SHORT) * grid.from[side]),
                _ => grid.distance(side, y),
            };
            SIGNS[side] * distance
        };
        let both = |side: usize| places.iter().map(move |&y| nudged(side, y));
        let both = curve(constant([0, 1].into_iter().flat_map(both).collect()));
        let sides = [0, 1].map(|side| {
            both.each_ref().map(|of| of.clone().narrow(0, side * places.len(), places.len()))
        });

        let mut rows = Vec::with_capacity(6);
        for (side, [value, slope]) in sides.into_iter().enumerate() {
            let at = |k: usize| value.clone().narrow(0, k, 1).reshape([1, 1]);
            let (first, tail) = (at(0), at(places.len() - 1));
            let zero = first.clone() * 0.0;
            let rise = at(1) - first.clone();
            rows.push(Tensor::cat(vec![first, rise, zero.clone(), zero.clone()], 1));
            // From slopes with respect to distance to slopes with respect to the position in the cell, as one factor: each of two may leave
            // the range of f32. At distance 0 the slope with respect to its square may be infinite; the innermost cell is linear and needs
            // none.
            let inner = |k: usize| {
                let rate = |(pair, &y): (&[f64], &f64)| {
                    SIGNS[side] * grid.rate(side, y) * (pair[1] - pair[0])
                };
                let rates = knots[1..].windows(2).zip(&places[k..]).map(rate).collect();
                slope.clone().narrow(0, k, cells - 1) * constant(rates)
            };
            let [left, right, middle] = [1, 2, cells + 1].map(inner);
            let (half, whole) = (middle - left.clone(), right - left.clone());
            let square = half.clone() * 2.0 - whole.clone() * 0.5;
            let cube = (whole - half * 2.0) * (2.0 / 3.0);
            let values = value.clone().narrow(0, 1, cells - 1);
            let mut cubic = [left, square, cube];
            if self.rough {
                let next = value.clone().narrow(0, 2, cells - 1);
                cubic = bounded(&values, next, cubic);
            }
            let [left, square, cube] = cubic;
            rows.push(Tensor::stack(vec![values, left, square, cube], 1));
            rows.push(Tensor::cat(vec![tail, zero.clone(), zero.clone(), zero], 1));
        }
        Tensor::cat(rows, 0)
    }

    /// Values and cubics of a curve at these positions in each cell, and at smaller ones in the innermost.
    fn samples<B: Backend>(
        &self,
        curve: impl Fn(Tensor<B, 1>) -> [Tensor<B, 1>; 2],
        places: &[f64],
        sums: DType,
        device: &B::Device,
    ) -> Vec<Sample> {
        let grid = self.grid;
        let dtype = precise::<B>(&[], device).dtype();
        let table = self.table(&curve, (device, dtype));
        let table = numbers(table);
        let knots = grid.knots();
        let nearer: Vec<f64> =
            INNERMOST.map(|power| NEARER.powi(power)).chain(places.iter().copied()).collect();
        // A position is the remainder of a number at least 2^bits times as large as the width of a cell.
        let digits = if sums == DType::F64 { 53 } else { 24 };
        let rounding = f64::exp2(f64::from(grid.bits) - f64::from(digits));
        let mut distances = Vec::with_capacity(2 * places.len() * knots.len());
        let mut samples = Vec::with_capacity(2 * places.len() * knots.len());
        for side in [0, 1] {
            for (cell, ends) in knots.windows(2).enumerate() {
                let row = 4 * (side * (grid.cells() + 1) + cell);
                let innermost = cell == 0;
                for &t in if innermost { &nearer } else { places } {
                    let y = ends[0] + t * (ends[1] - ends[0]);
                    distances.push(SIGNS[side] * grid.distance(side, y));
                    let c = &table[row..row + 4];
                    let value = |t: f64| c[0] + t * (c[1] + t * (c[2] + t * c[3]));
                    let interpolated = match innermost {
                        true => [value((t - rounding).max(0.0)), value(t + rounding)],
                        false => [value(t); 2],
                    };
                    samples.push(Sample { exact: 0.0, interpolated, innermost });
                }
            }
        }
        let [exact, _] = curve(precise::<B>(&distances, device));
        for (sample, exact) in samples.iter_mut().zip(numbers(exact)) {
            sample.exact = exact;
        }
        samples
    }
}

/// The larger of two errors; infinite if the second is NaN.
pub(crate) fn worse(most: f64, error: f64) -> f64 {
    if error.is_nan() { f64::INFINITY } else { most.max(error) }
}

/// A curve and its cubics, at a position between knots.
struct Sample {
    exact: f64,
    /// Values at the neighbouring positions to which a look-up may round.
    interpolated: [f64; 2],
    /// Whether the position is in the innermost cell of its side.
    innermost: bool,
}

/// Coefficients of cubics from these `values` to the `next`, replaced by straight lines where they miss them by more than a fraction of the
/// rise: the slopes at a cell with a jump or a pole are meaningless.
fn bounded<B: Backend>(
    values: &Tensor<B, 1>,
    next: Tensor<B, 1>,
    [left, square, cube]: [Tensor<B, 1>; 3],
) -> [Tensor<B, 1>; 3] {
    let end = left.clone() + square.clone() + cube.clone();
    let rise = next.clone() - values.clone();
    let rounding = (values.clone().abs() + next.abs()) * WIDE_OF;
    let missed = (end - rise.clone()).abs().greater(rise.clone().abs() * WIDE_OF + rounding * 1e-5);
    [
        left.mask_where(missed.clone(), rise),
        square.mask_fill(missed.clone(), 0.0),
        cube.mask_fill(missed, 0.0),
    ]
}
