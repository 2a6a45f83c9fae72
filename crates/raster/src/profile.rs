use softrast_kernel::Grid;
use softrast_softness::{Softness, support};
use softrast_tensor::{Backend, DType, Element, Tensor, numbers};

use crate::{
    RasterBackend, TConorm,
    curve::{
        BEYOND, CubicCurve, FAR, FARTHEST_DRAWN, SIGNS, precise, rounding, settled_until, worse,
    },
};

/// Least sum at which the slope of the coverage is sampled.
const LEAST_SUM: f64 = 1e-5;
/// Relative rounding of an error that equals its bound.
const ROUNDING: f64 = 1e-3;
/// Number of distances beyond the end of a side, up to the farthest drawn, at which the profile is compared with the constant.
const BEYOND_END: u32 = 24;

/// A softness with a T-conorm as a piecewise cubic function of the squared distance, the term of a face in
/// [`profile_sum`](crate::low_level::profile_sum).
///
/// The spacing of its cells suits all families equally, so no family needs custom knots, and an MLP costs no more per pixel than a
/// logistic. Gradients of any order reach the parameters through the values and slopes at the knots.
///
/// The module [`low_level`](crate::low_level) has an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    curve: CubicCurve,
    t_conorm: TConorm,
    /// Float type of the sums.
    sums: DType,
    error: f64,
}

impl Profile {
    /// Chooses support and knots for a softness with parameters `phi` in scenes of up to `faces` faces, such that the error of every pixel
    /// is at most `tolerance` (in alpha, in exact arithmetic).
    ///
    /// Half of the tolerance goes to culling. The term `g(s)` of a face farther from the pixel than the outer radius is within
    /// `e = slack / faces` of its left limit, so all of them together change the sum by at most `slack` and the coverage by at most
    /// `tolerance / 2` ([`TConorm::slack`]). Deeper inside than the inner radius one face alone covers the pixel to within `tolerance / 2`,
    /// and a T-conorm never falls below its largest argument.
    ///
    /// The other half goes to interpolation: the cells are refined until, at four samples of each, the error is below `tolerance / 4` times
    /// the value plus a share of `e / 2`; the value is the term or, where one face nearly covers the pixel, the coverage of this face
    /// alone. A relative error ρ of every term moves `1 - exp(-S)` by at most `ρ S exp(-S) <= 0.37 ρ`; a relative error ρ of every coverage
    /// moves it by at most ρ times the probability that exactly one face covers the pixel. With a T-conorm whose coverage steepens with the
    /// sum, the coverage is evaluated together with faces that bring the sum to its steepest point, and the error of terms is bounded more
    /// tightly where a relative error of the sum moves the coverage by more than itself. The number of knots may be insufficient: at a
    /// jump, at a corner far from the edge, with a steep T-conorm at a tolerance far below the default. [`Profile::error`] states the
    /// remaining error.
    ///
    /// **Gradients.** A culled face has no gradient, although Adam would move it however small its gradient is. At the default tolerance of
    /// 1e-5 the gradient of a face that lies wholly in the culled tail is below Adam's usual epsilon of 1e-8 times the image's own; choose
    /// a smaller tolerance where faces must be attracted from afar (docs/notes.md, Culling: gradient).
    ///
    /// `B` is the backend that draws; support and knots are chosen on `H`, in f64 if it supports that.
    ///
    /// # Panics
    ///
    /// If `tolerance` is not in (0, 1), `faces` is 0, or `phi` has the wrong length.
    pub fn new<B: RasterBackend, H: Backend>(
        softness: &impl Softness,
        t_conorm: TConorm,
        phi: &[f64],
        faces: usize,
        tolerance: f64,
    ) -> Self {
        let sums = <B::FloatElem as Element>::dtype();
        // The look-up of a GPU does not support cells counted from the far end.
        let far = if B::ON_HOST { &FAR[..] } else { &[] };
        let device = &H::Device::default();
        assert!(tolerance > 0.0 && tolerance < 1.0, "tolerance {tolerance} is not in (0, 1)");
        assert!(faces > 0, "a profile needs at least one face");
        let excess = t_conorm.slack(tolerance / 2.0) / faces as f64;
        // The T-conorm transforms the optical depth: determine the depth whose generator equals the excess.
        let limits = support::<H>(softness, phi, excess, device);
        let depth = depth_of_excess(t_conorm, limits.left, excess);
        let support = support::<H>(softness, phi, depth, device);
        // Deep inside, the remaining light matters, which does not depend on the number of faces.
        let shallow = support_inside::<H>(softness, phi, tolerance / 2.0);
        let radii = [support.outer, support.inner.min(shallow)];
        let from = || {
            // The remaining budget of interpolation then suffices for the first cells.
            let (depth, light) = (depth_of_excess(t_conorm, 0.0, excess), tolerance / 2.0);
            let settled = |edge: f64, q: f64| {
                (q - edge).abs() <= depth / 4.0 || (-q.min(edge)).exp() <= light / 4.0
            };
            let depths = |x: &[f64]| {
                numbers(softness.optical_depth(precise::<H>(phi, device), precise::<H>(x, device)))
            };
            settled_until(depths, radii, settled)
        };
        let phi = precise::<H>(phi, device);
        let terms =
            |x: Tensor<H, 1>| <[_; 2]>::from(t_conorm.profile_for(sums, softness, phi.clone(), x));
        let bound = Bound::new(t_conorm, tolerance, faces, rounding::<H>(device));
        let miss = |exact: f64, interpolated: f64| bound.of_interpolation(exact, interpolated);
        let (curve, missed) = CubicCurve::chosen::<H>(terms, radii, from, far, miss, sums, device);
        let values = |x: &[f64]| {
            let [values, _] = terms(precise::<H>(x, device));
            numbers(values)
        };
        let of_half = |error: f64| if error <= 1.0 + ROUNDING { 1.0 } else { error };
        let culled = bound.of_constants(&curve.grid, values);
        let end = precise::<H>(&[BEYOND * curve.grid.inner], device);
        let [deepest] = numbers(softness.optical_depth(phi, end))[..] else {
            unreachable!("a distance has an optical depth")
        };
        let lost = t_conorm.lost_to_range(sums, deepest);
        let error = tolerance / 2.0 * (of_half(missed) + of_half(culled)) + lost;
        Self { curve, t_conorm, sums, error }
    }

    /// The profile of the softness stretched by `factor` along the distance, with the same bounds: the quantities in their derivation are
    /// stretched alike.
    ///
    /// `None` if a radius would leave the drawable range, so that the profile has to be chosen anew.
    pub(crate) fn stretched(self, factor: f64) -> Option<Self> {
        Some(Self { curve: self.curve.stretched(factor)?, ..self })
    }

    /// Coefficients of the cubics, `[rows, 4]`, in the float type of `phi` `[parameters]`.
    ///
    /// `softness` may differ from the one the profile was chosen for only in its parameters.
    pub fn table<B: Backend>(&self, softness: &impl Softness, phi: Tensor<B, 1>) -> Tensor<B, 2> {
        let like = (&phi.device(), phi.dtype());
        let terms = |x| self.t_conorm.profile_for(self.sums, softness, phi.clone(), x).into();
        self.curve.table(terms, like)
    }

    /// The layout of the cells.
    pub(crate) fn grid(&self) -> Grid {
        self.curve.grid
    }

    /// Sets the number of cells to `2^bits` per octave, in the same support; their error is not measured.
    pub(crate) fn with_cells(mut self, bits: u32) -> Self {
        self.curve.grid.bits = bits;
        self
    }

    /// Distances, in NDC, outside and inside beyond which the profile is constant.
    pub fn support(&self) -> [f64; 2] {
        [self.curve.grid.outer, self.curve.grid.inner]
    }

    /// Number of knots of the table, on both sides together.
    pub fn knots(&self) -> usize {
        self.curve.grid.rows()
    }

    /// Largest error of a pixel in exact arithmetic, in coverage: the tolerance, or more if no table of this kind can meet it.
    ///
    /// Measured between the knots and beyond the support.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// The T-conorm that turns sums into coverage.
    pub fn t_conorm(&self) -> TConorm {
        self.t_conorm
    }
}

/// Largest errors of terms, for a tolerance and a number of faces.
struct Bound {
    t_conorm: TConorm,
    tolerance: f64,
    faces: f64,
    /// Largest culling error of the sum, per face.
    excess: f64,
    /// Sum at which the coverage increases fastest.
    steepest: f64,
    /// Relative rounding of a term, and relative interpolation errors allowed for a term and for the coverage of this term alone.
    rounding: f64,
    of_term: f64,
    of_coverage: f64,
}

impl Bound {
    fn new(t_conorm: TConorm, tolerance: f64, faces: usize, rounding: f64) -> Self {
        let faces = faces as f64;
        let excess = t_conorm.slack(tolerance / 2.0) / faces;
        let of_coverage = tolerance / 4.0 + rounding;
        let of_term = tolerance / (4.0 * t_conorm.sensitivity().max(1.0)) + rounding;
        let steepest = steepest(t_conorm);
        Self { t_conorm, tolerance, faces, excess, steepest, rounding, of_term, of_coverage }
    }

    /// The coverage of a sum that is below 0 only by rounding.
    fn covered(&self, sum: f64) -> f64 {
        self.t_conorm.coverage_of(sum.max(0.0))
    }

    /// Change of the coverage between two terms, with other faces that bring the sum to the steepest point.
    fn moved(&self, from: f64, to: f64) -> f64 {
        let company = (self.steepest - from).max(0.0);
        (self.covered(to + company) - self.covered(from + company)).abs()
    }

    /// Error of a term, as a multiple of the allowed interpolation error: of the term itself or of the coverage of this term alone,
    /// whichever is smaller.
    fn of_interpolation(&self, exact: f64, interpolated: f64) -> f64 {
        let of_term = self.of_term * exact.abs() + self.excess / 2.0;
        let of_coverage =
            self.of_coverage * self.covered(exact) + self.tolerance / (4.0 * self.faces);
        let term = (exact - interpolated).abs() / of_term;
        term.min(self.moved(exact, interpolated) / of_coverage)
    }

    /// Errors of the constants before the cells and beyond them, as multiples of the culling error allowed per face; of half the tolerance
    /// where both values alone cover a pixel.
    fn of_constants(&self, grid: &Grid, terms: impl Fn(&[f64]) -> Vec<f64>) -> f64 {
        let mut distances = Vec::new();
        for (side, sign) in SIGNS.into_iter().enumerate() {
            let end = grid.distance(side, 1.0);
            let ratio = (FARTHEST_DRAWN / end).max(1.0).powf(1.0 / f64::from(BEYOND_END));
            // Nothing is drawn beyond a side that ends farther away.
            let nearest = if end < FARTHEST_DRAWN { end } else { BEYOND * end };
            distances.push(sign * BEYOND * end);
            distances.extend((0..=BEYOND_END).map(|k| sign * nearest * ratio.powi(k as i32)));
            distances.push(sign * grid.distance(side, 0.0).max(1e-15));
            distances.extend((1..8).map(|k| sign * grid.from[side] * f64::from(k) / 8.0));
        }
        let values = terms(&distances);
        let [of_side, beyond] = [distances.len() / 2, BEYOND_END as usize + 2];
        let mut most: f64 = 0.0;
        for side in [0, 1] {
            let values = &values[side * of_side..(side + 1) * of_side];
            let before = if grid.from[side] > 0.0 { &values[beyond..] } else { &[] };
            for values in [&values[..beyond], before] {
                let Some((&constant, rest)) = values.split_first() else { continue };
                most = rest
                    .iter()
                    .fold(most, |most, &value| worse(most, self.of_constant(constant, value)));
            }
        }
        most
    }

    fn of_constant(&self, constant: f64, value: f64) -> f64 {
        let term = (value - constant).abs() / (self.excess + self.rounding * constant.abs());
        let [least, most] = [value.min(constant), value.max(constant)];
        let alone = self.moved(least, most) * self.faces;
        let open = 1.0 - self.covered(least);
        term.min(alone.min(open) / (self.tolerance / 2.0))
    }
}

/// The sum, to a fifth, at which the coverage of a pixel increases fastest: 0 for T-conorms whose coverage only flattens, such as the
/// probabilistic sum.
fn steepest(t_conorm: TConorm) -> f64 {
    let slope = |sum: f64| (t_conorm.coverage_of(1.01 * sum) - t_conorm.coverage_of(sum)) / sum;
    let (mut at, mut most) = (0.0, slope(LEAST_SUM));
    for k in 1..80 {
        let sum = LEAST_SUM * (0.25 * f64::from(k)).exp2();
        let found = slope(sum);
        // By more than rounding of a straight line.
        if found > most * (1.0 + 1e-6) {
            (at, most) = (sum, found);
        }
    }
    at
}

/// The optical depth above `left` whose generator contributes `excess` to the sum.
fn depth_of_excess(t_conorm: TConorm, left: f64, excess: f64) -> f64 {
    if t_conorm == TConorm::Probabilistic {
        return excess;
    }
    let base = t_conorm.generator(left);
    let (mut low, mut high): (f64, f64) = (1e-300, 40.0);
    for _ in 0..200 {
        let middle = (low * high).sqrt();
        if t_conorm.generator(left + middle) - base <= excess {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Depth inside a face beyond which it transmits less than `light`; infinite if there is none.
fn support_inside<H: Backend>(softness: &impl Softness, phi: &[f64], light: f64) -> f64 {
    let support = support::<H>(softness, phi, light, &Default::default());
    if (-support.right).exp() <= light { support.inner } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Error of these terms' constants as a multiple of the error allowed for each of ten faces, at a tolerance of 1e-5.
    fn off(from: [f64; 2], terms: impl Fn(f64) -> f64) -> f64 {
        let bound = Bound::new(TConorm::Probabilistic, 1e-5, 10, 1e-14);
        let grid = Grid { outer: 0.1, inner: 0.2, from, octaves: 20, far: 0, bits: 3 };
        bound.of_constants(&grid, |x| x.iter().map(|&x| terms(x)).collect())
    }

    #[test]
    fn terms_that_leave_their_constant_count_on_either_side_before_the_cells_and_beyond_them() {
        let [near, far] = [[0.0, 0.0], [0.05, 0.05]];
        let within = |x: f64| x.abs() < 0.09;
        assert_eq!(off(near, |x| if within(x) { x } else { 0.0 }), 0.0);
        // An error of 1e-3 of a term is 2000 times the culling error of 5e-7 allowed per face.
        let beyond =
            [off(near, |x| f64::from(x < -3.0) * 1e-3), off(near, |x| f64::from(x > 3.0) * 1e-3)];
        let before = |side: f64| off(far, |x| f64::from((0.01..0.04).contains(&(side * x))) * 1e-3);
        for found in [beyond, [before(-1.0), before(1.0)]].concat() {
            assert!((found / 2000.0 - 1.0).abs() < 0.01, "{found}");
        }
        // With `from` at the edge, terms there are in the cells.
        assert_eq!(off(near, |x| f64::from((0.01..0.04).contains(&x)) * 1e-3), 0.0);
    }

    #[test]
    fn a_side_that_covers_the_pixel_may_change_by_the_light_that_it_lets_through() {
        // The remaining light is exp(-16) = 1.1e-7, of 5e-6 allowed.
        assert!(off([0.0; 2], |x| if x > 3.0 { 16.0 } else { 17.0 }) < 0.03);
        assert!(off([0.0; 2], |x| if x > 3.0 { 9.0 } else { 17.0 }) > 20.0);
    }
}
