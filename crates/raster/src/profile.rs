use burn::tensor::{DType, Tensor, TensorData, backend::Backend};
use softrast_softness::{Softness, support};

use crate::{TConorm, kernel::Grid};

/// Octaves of the squared distance that a table may resolve, and cells in an octave (as a power of
/// two) that it may use, coarsest first.
const OCTAVES: [u32; 7] = [12, 16, 24, 36, 56, 80, 120];
const BITS: std::ops::RangeInclusive<u32> = 2..=7;
/// Octaves of the distance to the end of the support that a table may resolve, coarsest first, where
/// cells that are spaced from the edge of the face are not enough.
pub(crate) const FAR: [u32; 4] = [8, 16, 26, 36];
/// There, the terms of a second derivative all but cancel; this many bits more keep what is left.
const SHARPER: u32 = 2;
/// Stands in for a support that does not end, in NDC.
const EVERYWHERE: f64 = 4e6;
/// No drawn face is farther from a pixel, in NDC.
const FARTHEST_DRAWN: f64 = 1.5e6;
/// The largest radius that a profile may be stretched to, in NDC: its square fits an f32.
const WIDEST: f64 = 1e9;
/// Tails have the value of a place this many times as far as the support. Any place beyond it is as
/// good for the image; but where the profile ends with a steep slope, its parameters must not move
/// all that lies in the tail.
const BEYOND: f64 = 1.1;
/// Where coverage is begun to be asked how fast it rises with the sum.
const LEAST_SUM: f64 = 1e-5;
/// A side that is constant still needs a cell.
const NARROWEST: f64 = 1e-9;

/// A softness under a T-conorm as a piecewise cubic function of the squared distance: what
/// [`profile_sum`](crate::profile_sum) adds up over the faces of a pixel.
///
/// The table consists of two one-sided halves that meet at the edge of the face, where families
/// kink or rise with infinite slope. Its cells are spaced by the leading bits of the squared
/// distance: each octave holds the same number of cells, so that no family needs a spacing of its
/// own, and a look-up needs no logarithm, no square root and no search.
///
/// Only the values and slopes at the knots touch the softness. They are tensor ops, so gradients of
/// any order reach its parameters, and an MLP costs no more per pixel than a logistic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    pub(crate) grid: Grid,
    pub(crate) t_conorm: TConorm,
    pub(crate) error: f64,
}

impl Profile {
    /// Chooses support and knots for a softness with parameters `phi` in scenes of up to `faces`
    /// faces, such that no pixel is off by more than `tolerance` (in alpha, in exact arithmetic).
    ///
    /// Half of the tolerance goes to culling. A face that is farther from the pixel than the outer
    /// radius adds `g(s)` within `e = slack / faces` of its left limit, so all of them together
    /// change the sum by at most `slack` and the coverage by at most `tolerance / 2`
    /// ([`TConorm::slack`]). Deeper inside than the inner radius one face alone covers the pixel to
    /// within `tolerance / 2`, and a T-conorm never falls below its largest argument.
    ///
    /// The other half goes to interpolation: the cells are refined until, at four samples of each,
    /// the error is below `tolerance / 4` times the value plus a share of `e / 2`; the value being
    /// the term or, where one face all but covers the pixel, the coverage that it alone makes. A
    /// relative error ρ of every term moves `1 - exp(-S)` by at most `ρ S exp(-S) <= 0.37 ρ`; a
    /// relative error ρ of every coverage moves it by at most ρ times the probability that exactly
    /// one face covers the pixel. Under a T-conorm whose coverage steepens with the sum, the coverage
    /// is taken beside faces that bring the sum to where it is steepest. [`Profile::error`] tells what
    /// was reached: for a kink away from the edge that no knot meets it can be more.
    ///
    /// **Gradients.** A culled face gives no gradient, and Adam would have moved it however small
    /// its gradient was. At the default tolerance of 1e-5 the gradient of a face that lies wholly in
    /// the culled tail is below Adam's usual epsilon of 1e-8 times the image's own; choose a
    /// smaller tolerance where faces must be drawn in from afar (docs/notes.md, Culling: gradient).
    ///
    /// `device` belongs to the backend that evaluates the softness, in f64 where it can.
    ///
    /// # Panics
    ///
    /// If `tolerance` is not in (0, 1), `faces` is 0, or `phi` has the wrong length.
    pub fn new<B: Backend>(
        softness: &impl Softness,
        t_conorm: TConorm,
        phi: &[f64],
        faces: usize,
        tolerance: f64,
        device: &B::Device,
    ) -> Self {
        Self::for_all::<B>(softness, t_conorm, &[phi], faces, tolerance, device)
    }

    /// [`Profile::new`] for several parameters `phi`, none of which is off by more.
    pub(crate) fn for_all<B: Backend>(
        softness: &impl Softness,
        t_conorm: TConorm,
        phi: &[&[f64]],
        faces: usize,
        tolerance: f64,
        device: &B::Device,
    ) -> Self {
        Self::chosen::<B>(softness, t_conorm, phi, faces, tolerance, &FAR, device)
    }

    /// [`Profile::for_all`] with the choice of octaves at the end of the support; none of them if `far`
    /// is empty, for look-ups that know none.
    pub(crate) fn chosen<B: Backend>(
        softness: &impl Softness,
        t_conorm: TConorm,
        phi: &[&[f64]],
        faces: usize,
        tolerance: f64,
        far: &[u32],
        device: &B::Device,
    ) -> Self {
        assert!(tolerance > 0.0 && tolerance < 1.0, "tolerance {tolerance} is not in (0, 1)");
        assert!(faces > 0, "a profile needs at least one face");
        assert!(!phi.is_empty(), "a profile needs parameters");
        let excess = t_conorm.slack(tolerance / 2.0) / faces as f64;
        let radii = |phi: &[f64]| {
            // The T-conorm bends the optical depth: ask for the depth that makes up the excess.
            let limits = support::<B>(softness, phi, excess, device);
            let depth = depth_of_excess(t_conorm, limits.left, excess);
            let support = support::<B>(softness, phi, depth, device);
            // Deep inside, what counts is the light left, which knows nothing of the number of faces.
            let shallow = support_inside::<B>(softness, phi, tolerance / 2.0, device);
            [support.outer, support.inner.min(shallow)]
        };
        let larger = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a.max(c), b.max(d)];
        let [outer, inner] = phi.iter().map(|phi| radii(phi)).fold([0.0; 2], larger);
        let (grid, reached) = refined([outer, inner], far, |grid: Grid| {
            let of = |&phi: &&[f64]| {
                interpolation_error::<B>(softness, t_conorm, phi, grid, tolerance, faces, device)
            };
            phi.iter().map(of).fold(Reached::NOTHING, Reached::larger)
        });
        let error = reached.innermost.max(reached.rest) * tolerance / 2.0;
        Self { grid, t_conorm, error }
    }

    /// The profile of the same softness stretched by `factor` along the distance, with the same bounds:
    /// all that they were proven and measured from is stretched alike.
    ///
    /// None where a radius would leave the range that can be drawn, so that it has to be chosen anew.
    pub(crate) fn stretched(mut self, factor: f64) -> Option<Self> {
        let stretch = |radius: &mut f64| {
            let least = if *radius >= EVERYWHERE { FARTHEST_DRAWN } else { NARROWEST };
            // A side of the least radius is constant, or all but that: a narrower one suits it no better.
            if *radius > NARROWEST || factor > 1.0 {
                *radius *= factor;
            }
            (least..=WIDEST).contains(radius)
        };
        (stretch(&mut self.grid.outer) && stretch(&mut self.grid.inner)).then_some(self)
    }

    /// Distances, in NDC, beyond which a pixel outside and inside sees a constant.
    pub fn support(&self) -> [f64; 2] {
        [self.grid.outer, self.grid.inner]
    }

    /// Number of knots of the table, both sides together.
    pub fn knots(&self) -> usize {
        2 * (self.grid.cells() + 1)
    }

    /// Largest error of a pixel that interpolation leaves, measured between the knots; at most half
    /// the tolerance unless the knots ran out.
    pub fn error(&self) -> f64 {
        self.error
    }

    /// The T-conorm that turns sums into coverage.
    pub fn t_conorm(&self) -> TConorm {
        self.t_conorm
    }

    /// Coefficients of the cubics, `[rows, 4]`, in the float type of `phi` `[parameters]`.
    ///
    /// The cubic of a cell has the profile's value at the near end, and its slopes at both ends and
    /// in the middle. Its error is that of the cubic with the values and slopes of both ends,
    /// `t² (1 - t)²` times a 24th of the fourth derivative, to leading order. But differences of slopes
    /// of neighbours keep their digits where differences of values do not, next to the edge above all:
    /// in f32 these would leave the second derivative nothing.
    ///
    /// `softness` may differ from the one the profile was chosen for only in its parameters.
    pub fn table<B: Backend>(&self, softness: &impl Softness, phi: Tensor<B, 1>) -> Tensor<B, 2> {
        let knots = self.grid.knots();
        let cells = self.grid.cells();
        let (device, dtype) = (phi.device(), phi.dtype());
        let constant = |values: Vec<f64>| {
            let shape = [values.len()];
            Tensor::<B, 1>::from_data(TensorData::new(values, shape), (&device, dtype))
        };
        // Behind the knots stand the middles of all cells but the innermost, whose slopes count, and
        // the tail.
        let middle = |pair: &[f64]| 0.5 * (pair[0] + pair[1]);
        let middles = knots[1..].windows(2).map(middle);
        let places = knots.iter().copied().chain(middles).chain([BEYOND * BEYOND]);
        let places: Vec<f64> = places.collect();
        // A distance of 0 has no side; this one has, and is next to nothing also in a wide support.
        let nudged = |r: f64, y: f64| {
            if y == 0.0 { r.clamp(-1.0, 1.0) * 1e-15 } else { r * y.sqrt() }
        };
        // dy/dd at the knots, to turn slopes by distance into slopes by cell. Where the distance is
        // 0 the slope by its square may be infinite; the innermost cell is linear and needs none.
        let rate = |r: f64, y: f64| if y == 0.0 { 0.0 } else { r / (2.0 * y.sqrt()) };
        let sides = [-self.grid.outer, self.grid.inner];
        let of_sides = |sides: &[f64]| {
            let at = |of: &dyn Fn(f64, f64) -> f64| {
                constant(
                    sides.iter().flat_map(|&r| places.iter().map(move |&y| of(r, y))).collect(),
                )
            };
            let (value, slope) = self.t_conorm.profile(softness, phi.clone(), at(&nudged));
            (value, slope * at(&rate))
        };
        // An op that is recorded costs more than its few hundred numbers, so both sides are one tensor there. Else each has a thread.
        let sides = if B::ad_enabled(&device) {
            let (value, slope) = of_sides(&sides);
            let side = |k: usize| {
                let of = |tensor: &Tensor<B, 1>| {
                    tensor.clone().narrow(0, k * places.len(), places.len())
                };
                (of(&value), of(&slope))
            };
            [side(0), side(1)]
        } else {
            let (outer, inner) = rayon::join(|| of_sides(&sides[..1]), || of_sides(&sides[1..]));
            [outer, inner]
        };

        let widths = constant(knots[1..].windows(2).map(|pair| pair[1] - pair[0]).collect());
        let mut rows = Vec::with_capacity(6);
        for (value, slope) in sides {
            let at = |k: usize| value.clone().narrow(0, k, 1).reshape([1, 1]);
            let (first, tail) = (at(0), at(places.len() - 1));
            let zero = first.clone() * 0.0;
            let rise = at(1) - first.clone();
            rows.push(Tensor::cat(vec![first, rise, zero.clone(), zero.clone()], 1));
            let inner = |k: usize| slope.clone().narrow(0, k, cells - 1) * widths.clone();
            let [left, right, middle] = [1, 2, cells + 1].map(inner);
            let (half, whole) = (middle - left.clone(), right - left.clone());
            let square = half.clone() * 2.0 - whole.clone() * 0.5;
            let cube = (whole - half * 2.0) * (2.0 / 3.0);
            let values = value.clone().narrow(0, 1, cells - 1);
            rows.push(Tensor::stack(vec![values, left, square, cube], 1));
            rows.push(Tensor::cat(vec![tail, zero.clone(), zero.clone(), zero], 1));
        }
        Tensor::cat(rows, 0)
    }
}

/// A grid with these radii that is fine enough for `error` to be at most 1, or as fine as it may be, and the error.
pub(crate) fn refined(
    [outer, inner]: [f64; 2],
    far: &[u32],
    error: impl Fn(Grid) -> Reached,
) -> (Grid, Reached) {
    let radius = |r: f64| r.clamp(NARROWEST, EVERYWHERE);
    let mut grid = Grid {
        outer: radius(outer),
        inner: radius(inner),
        octaves: OCTAVES[0],
        far: 0,
        bits: *BITS.start(),
    };
    // The innermost cell decides the octaves, all others the cells in an octave.
    for octaves in OCTAVES {
        grid.octaves = octaves;
        if error(grid).innermost <= 1.0 {
            break;
        }
    }
    let finer = |mut grid: Grid, enough: f64| {
        let mut reached = Reached { innermost: f64::INFINITY, rest: f64::INFINITY };
        for bits in BITS {
            grid.bits = bits;
            reached = error(grid);
            if reached.rest <= enough {
                break;
            }
        }
        (grid, reached)
    };
    let (mut grid, mut reached) = finer(grid, 1.0);
    // Knots are left wanting where the profile rises without bound at the end of its support, or
    // at a corner in the middle, where more of them at the end are of no use.
    if let (true, Some(&most)) = (reached.rest > 1.0, far.last()) {
        let best = error(Grid { far: most, ..grid }).rest;
        if best < 0.5 * reached.rest {
            let enough = best.max(1.0);
            let suffices = |&&far: &&u32| error(Grid { far, ..grid }).rest <= enough;
            grid.far = *far.iter().find(suffices).unwrap_or(&most);
            grid = finer(grid, enough).0;
            grid.bits += SHARPER;
            reached = error(grid);
        }
    }
    (grid, reached)
}

/// How far interpolation misses its target, as multiples of it.
pub(crate) struct Reached {
    pub(crate) innermost: f64,
    pub(crate) rest: f64,
}

impl Reached {
    pub(crate) const NOTHING: Self = Self { innermost: 0.0, rest: 0.0 };

    fn larger(self, other: Self) -> Self {
        Self { innermost: self.innermost.max(other.innermost), rest: self.rest.max(other.rest) }
    }
}

/// A profile and its cubics, at a place between knots.
pub(crate) struct Sample {
    pub(crate) exact: f64,
    pub(crate) interpolated: f64,
    /// Whether it lies in the innermost cell of its side.
    pub(crate) innermost: bool,
}

/// Compares a profile with its cubics at four places in each cell; and what rounding alone makes of a value of 1.
pub(crate) fn samples<B: Backend>(
    softness: &impl Softness,
    t_conorm: TConorm,
    phi: &[f64],
    grid: Grid,
    device: &B::Device,
) -> (Vec<Sample>, f64) {
    let dtype = if B::supports_dtype(device, DType::F64) { DType::F64 } else { DType::F32 };
    let tensor = |values: Vec<f64>| {
        let shape = [values.len()];
        Tensor::<B, 1>::from_data(TensorData::new(values, shape), (device, dtype))
    };
    let profile = Profile { grid, t_conorm, error: 0.0 };
    let numbers = |tensor: Tensor<B, 1>| tensor.into_data().iter::<f64>().collect::<Vec<_>>();
    let table = profile.table(softness, tensor(phi.to_vec()));
    let table = numbers(table.reshape([4 * grid.rows() as i64]));
    let knots = grid.knots();
    let places = [0.25, 0.5, 0.75, 1.0];
    let mut distances = Vec::with_capacity(2 * places.len() * knots.len());
    let mut interpolated = Vec::with_capacity(2 * places.len() * knots.len());
    for (side, radius) in [-grid.outer, grid.inner].into_iter().enumerate() {
        for (cell, ends) in knots.windows(2).enumerate() {
            let row = 4 * (side * (grid.cells() + 1) + cell);
            for t in places {
                distances.push(radius * (ends[0] + t * (ends[1] - ends[0])).sqrt());
                let c = &table[row..row + 4];
                interpolated.push(c[0] + t * (c[1] + t * (c[2] + t * c[3])));
            }
        }
    }
    let (exact, _) = t_conorm.profile(softness, tensor(phi.to_vec()), tensor(distances));
    let per_side = places.len() * grid.cells();
    let pairs = numbers(exact).into_iter().zip(interpolated).enumerate();
    let sample = |(i, (exact, interpolated))| Sample {
        exact,
        interpolated,
        innermost: i % per_side < places.len(),
    };
    (pairs.map(sample).collect(), if dtype == DType::F64 { 1e-14 } else { 1e-6 })
}

/// Compares the cubics of a grid with the profile itself at four places in each cell.
fn interpolation_error<B: Backend>(
    softness: &impl Softness,
    t_conorm: TConorm,
    phi: &[f64],
    grid: Grid,
    tolerance: f64,
    faces: usize,
    device: &B::Device,
) -> Reached {
    let faces = faces as f64;
    let excess = t_conorm.slack(tolerance / 2.0) / faces;
    let (samples, rounding) = samples::<B>(softness, t_conorm, phi, grid, device);
    let mut reached = Reached::NOTHING;
    let steepest = steepest(t_conorm);
    for Sample { exact, interpolated, innermost } in samples {
        // Either the term itself is right, or the coverage that it alone makes.
        let relative = tolerance / 4.0 + rounding;
        let term = (exact - interpolated).abs() / (relative * exact.abs() + excess / 2.0);
        // Beside other faces an error of the term counts for more where coverage steepens with the sum.
        let company = (steepest - exact).max(0.0);
        let covered = |sum: f64| t_conorm.coverage_of(sum.max(0.0));
        let moved = covered(interpolated + company) - covered(exact + company);
        let alone = moved.abs() / (relative * covered(exact) + tolerance / (4.0 * faces));
        let error = term.min(alone);
        let place = if innermost { &mut reached.innermost } else { &mut reached.rest };
        *place = place.max(error);
    }
    reached
}

/// The sum, to a fifth, at which the coverage of a pixel rises fastest: 0 for T-conorms under which it only flattens,
/// as under the probabilistic sum.
fn steepest(t_conorm: TConorm) -> f64 {
    let slope = |sum: f64| (t_conorm.coverage_of(1.01 * sum) - t_conorm.coverage_of(sum)) / sum;
    let (mut at, mut most) = (0.0, slope(LEAST_SUM));
    for k in 1..80 {
        let sum = LEAST_SUM * (0.25 * f64::from(k)).exp2();
        let found = slope(sum);
        // By more than rounding makes of a straight line.
        if found > most * (1.0 + 1e-6) {
            (at, most) = (sum, found);
        }
    }
    at
}

/// The optical depth above `left` that makes up `excess` of the generator's sum.
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

/// Depth inside a face beyond which it lets less than `light` through; infinite if there is none.
fn support_inside<B: Backend>(
    softness: &impl Softness,
    phi: &[f64],
    light: f64,
    device: &B::Device,
) -> f64 {
    let support = support::<B>(softness, phi, light, device);
    if (-support.right).exp() <= light { support.inner } else { f64::INFINITY }
}
