use burn::tensor::{DType, Tensor, TensorData, backend::Backend};
use softrast_softness::{Softness, numbers, support};

use crate::{TConorm, kernel::Grid};

/// Octaves of the squared distance that a table may resolve, and cells in an octave (as a power of
/// two) that it may use, coarsest first.
const OCTAVES: [u32; 7] = [12, 16, 24, 36, 56, 80, 120];
const BITS: std::ops::RangeInclusive<u32> = 2..=7;
/// Finer cells, up to so many on a side, as long as each halving of a cell makes the error this much smaller: a corner gains half, a
/// jump nothing.
const MOST_CELLS: usize = 1 << 15;
const GAIN: f64 = 0.7;
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
/// How far before its end the slope at the end of the last cell is taken, as a part of the cell.
const INSIDE: f64 = 1.0 / 1024.0;
/// How far before the beginning of the cells the constant there is taken, as a part of the distance: more than an f32 is rounded by.
const SHORT: f64 = 2e-6;
/// Where coverage is begun to be asked how fast it rises with the sum.
const LEAST_SUM: f64 = 1e-5;
/// Distances at which a side is looked at for where it begins to change, in constant ratio, and those by which each refinement divides
/// what lies between two of them.
const COARSE: usize = 1024;
const FINE: usize = 128;
const REFINEMENTS: usize = 4;
/// Places in a cell at which its error is measured: those of a smooth profile's largest; and how many there are where it may lie elsewhere.
pub(crate) const PLACES: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
const DENSE: u32 = 16;
/// Relative rounding of an error that is exactly as large as allowed.
const ROUNDING: f64 = 1e-3;
/// The part of its rise that a cubic may miss the next knot by.
const WIDE_OF: f64 = 0.1;
/// Distances beyond the end of a side, as far as anything is drawn, at which the profile is compared with the constant.
const BEYOND_END: u32 = 24;
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
    /// Whether some cells are too wide for their cubics.
    pub(crate) rough: bool,
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
    /// is taken beside faces that bring the sum to where it is steepest, and terms are held to less where a relative error of the sum
    /// moves the coverage by more than itself. Knots may run out: at a jump, at a corner far from the edge, under a steep T-conorm at a
    /// tolerance far below the default. [`Profile::error`] states the error that is left.
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
        let radii = phi.iter().map(|phi| radii(phi)).fold([0.0; 2], larger);
        let from = || {
            let of = |&phi: &&[f64]| {
                // What is left of the budget of interpolation then suffices for the first cells.
                let (depth, light) = (depth_of_excess(t_conorm, 0.0, excess), tolerance / 2.0);
                let settled = |edge: f64, q: f64| {
                    (q - edge).abs() <= depth / 4.0 || (-q.min(edge)).exp() <= light / 4.0
                };
                settled_until::<B>(softness, phi, radii, settled, device)
            };
            let smaller = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a.min(c), b.min(d)];
            phi.iter().map(of).fold([f64::INFINITY; 2], smaller)
        };
        let missed = |profile: Self, places: &[f64]| {
            let of = |&phi: &&[f64]| {
                interpolation_error::<B>(
                    softness,
                    profile,
                    phi,
                    places,
                    [tolerance, faces as f64],
                    device,
                )
            };
            phi.iter().map(of).fold(Reached::NOTHING, Reached::larger)
        };
        let profile = |grid: Grid, rough: bool| Self { grid, t_conorm, error: tolerance, rough };
        let (grid, mut reached) =
            refined(radii, from, far, |grid: Grid| missed(profile(grid, false), &PLACES));
        let rough = reached.most() > 1.0;
        if rough {
            reached = missed(profile(grid, true), &dense());
        }
        let profile = profile(grid, rough);
        let culled = phi
            .iter()
            .map(|phi| constancy_error::<B>(softness, profile, phi, [tolerance, excess], device));
        let of_half = |error: f64| if error <= 1.0 + ROUNDING { 1.0 } else { error };
        let culled = of_half(culled.fold(0.0, f64::max));
        Self { error: tolerance / 2.0 * (of_half(reached.most()) + culled), ..profile }
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
        self.grid.from = self.grid.from.map(|from| from * factor);
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

    /// Largest error of a pixel in exact arithmetic, in coverage: the tolerance, or more where no table of this kind can meet it.
    ///
    /// Measured between the knots and beyond the support.
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
        let mut places: Vec<f64> =
            knots.iter().copied().chain(middles).chain([BEYOND * BEYOND]).collect();
        // A support often ends at a corner: rounding must not decide which of its slopes the last cell gets.
        places[cells] -= INSIDE * (knots[cells] - knots[cells - 1]);
        let grid = self.grid;
        // A distance of 0 has no side; this one has, and is next to nothing also in a wide support. Where a side is constant before its
        // cells, rounding must not decide on which side of a corner their beginning lies.
        let nudged = |side: usize, y: f64| {
            let least = grid.distance(side, 1.0).min(1.0) * 1e-15;
            let distance = match y {
                0.0 => least.max((1.0 - SHORT) * grid.from[side]),
                _ => grid.distance(side, y),
            };
            SIGNS[side] * distance
        };
        let of_sides = |sides: &[usize]| {
            let at = |of: &dyn Fn(usize, f64) -> f64| {
                constant(
                    sides
                        .iter()
                        .flat_map(|&side| places.iter().map(move |&y| of(side, y)))
                        .collect(),
                )
            };
            self.t_conorm.profile(softness, phi.clone(), at(&nudged))
        };
        // An op that is recorded costs more than its few hundred numbers, so both sides are one tensor there. Else each has a thread.
        let sides = if B::ad_enabled(&device) {
            let (value, slope) = of_sides(&[0, 1]);
            let side = |k: usize| {
                let of = |tensor: &Tensor<B, 1>| {
                    tensor.clone().narrow(0, k * places.len(), places.len())
                };
                (of(&value), of(&slope))
            };
            [side(0), side(1)]
        } else {
            let (outer, inner) = rayon::join(|| of_sides(&[0]), || of_sides(&[1]));
            [outer, inner]
        };

        let mut rows = Vec::with_capacity(6);
        for (side, (value, slope)) in sides.into_iter().enumerate() {
            let at = |k: usize| value.clone().narrow(0, k, 1).reshape([1, 1]);
            let (first, tail) = (at(0), at(places.len() - 1));
            let zero = first.clone() * 0.0;
            let rise = at(1) - first.clone();
            rows.push(Tensor::cat(vec![first, rise, zero.clone(), zero.clone()], 1));
            // From slopes by distance to slopes by place in the cell, in one factor: each of two may leave the range of f32. Where the
            // distance is 0 the slope by its square may be infinite; the innermost cell is linear and needs none.
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
}

/// Coefficients of cubics from these `values` to the `next`, where they miss those by more than a part of the rise replaced by
/// straight lines: a cell that holds a jump or a pole gives slopes that lead anywhere.
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

/// A grid with these radii that is fine enough for `error` to be at most 1, or as fine as it may be, and the error. `from` says how far
/// from the edge the sides begin to change: asked where knots that are close at the edge are not enough.
pub(crate) fn refined(
    [outer, inner]: [f64; 2],
    from: impl FnOnce() -> [f64; 2],
    far: &[u32],
    error: impl Fn(Grid) -> Reached,
) -> (Grid, Reached) {
    let radius = |r: f64| r.clamp(NARROWEST, EVERYWHERE);
    let plain = Grid {
        outer: radius(outer),
        inner: radius(inner),
        from: [0.0; 2],
        octaves: OCTAVES[0],
        far: 0,
        bits: *BITS.start(),
    };
    let found = fitted(plain, far, &error);
    let Some(&least) = far.first() else { return found };
    if found.1.most() <= 1.0 {
        return found;
    }
    let ends = [plain.outer, plain.inner];
    let begins = |side: usize, from: f64| if from < ends[side] { from } else { 0.0 };
    let [outer, inner] = from();
    let from = [begins(0, outer), begins(1, inner)];
    if from == [0.0; 2] {
        return found;
    }
    let begun = fitted(Grid { from, far: least, ..plain }, far, &error);
    if begun.1.most() < found.1.most() { begun } else { found }
}

fn fitted(mut grid: Grid, far: &[u32], error: &impl Fn(Grid) -> Reached) -> (Grid, Reached) {
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
    while reached.rest > 1.0 && 2 * grid.cells() <= MOST_CELLS {
        let next = Grid { bits: grid.bits + 1, ..grid };
        let gained = error(next);
        if gained.rest > GAIN * reached.rest {
            break;
        }
        (grid, reached) = (next, gained);
    }
    (grid, reached)
}

/// Which way the sides lie: outer, inner.
const SIGNS: [f64; 2] = [-1.0, 1.0];

/// How far from the edge the optical depth of each side, up to its radius, still is `settled`: what is said of the depth at the edge and
/// that at a place.
pub(crate) fn settled_until<B: Backend>(
    softness: &impl Softness,
    phi: &[f64],
    radii: [f64; 2],
    settled: impl Fn(f64, f64) -> bool,
    device: &B::Device,
) -> [f64; 2] {
    let depths = |x: &[f64]| {
        numbers(softness.optical_depth(precise::<B>(phi, device), precise::<B>(x, device)))
    };
    [0, 1].map(|side| {
        let [mut near, mut far] = [NARROWEST, radii[side].clamp(2.0 * NARROWEST, EVERYWHERE)];
        let edge = depths(&[SIGNS[side] * 1e-15])[0];
        for count in std::iter::once(COARSE).chain([FINE; REFINEMENTS]) {
            let ratio = (far / near).ln() / (count - 1) as f64;
            let places: Vec<f64> = (0..count).map(|k| near * (ratio * k as f64).exp()).collect();
            let signed: Vec<f64> = places.iter().map(|r| SIGNS[side] * r).collect();
            match depths(&signed).iter().position(|&q| !settled(edge, q)) {
                Some(first @ 1..) => [near, far] = [places[first - 1], places[first]],
                // Only a place that rounding has moved.
                _ if count == FINE => return near,
                _ => return 0.0,
            }
        }
        near
    })
}

/// How far interpolation misses its target, as multiples of it.
pub(crate) struct Reached {
    pub(crate) innermost: f64,
    pub(crate) rest: f64,
}

impl Reached {
    pub(crate) const NOTHING: Self = Self { innermost: 0.0, rest: 0.0 };

    pub(crate) fn most(&self) -> f64 {
        self.innermost.max(self.rest)
    }

    fn larger(self, other: Self) -> Self {
        Self { innermost: self.innermost.max(other.innermost), rest: self.rest.max(other.rest) }
    }
}

/// The places in a cell at which errors of profiles that are not smooth are looked for.
pub(crate) fn dense() -> Vec<f64> {
    (1..=DENSE).map(|k| f64::from(k) / f64::from(DENSE)).collect()
}

/// A profile and its cubics, at a place between knots.
pub(crate) struct Sample {
    pub(crate) exact: f64,
    pub(crate) interpolated: f64,
    /// Whether it lies in the innermost cell of its side.
    pub(crate) innermost: bool,
}

/// Compares a profile with its cubics at these places in each cell; and what rounding alone makes of a value of 1.
pub(crate) fn samples<B: Backend>(
    softness: &impl Softness,
    profile: Profile,
    phi: &[f64],
    places: &[f64],
    device: &B::Device,
) -> (Vec<Sample>, f64) {
    let tensor = |values: &[f64]| precise::<B>(values, device);
    let grid = profile.grid;
    let table = numbers(profile.table(softness, tensor(phi)).reshape([4 * grid.rows() as i64]));
    let knots = grid.knots();
    let mut distances = Vec::with_capacity(2 * places.len() * knots.len());
    let mut interpolated = Vec::with_capacity(2 * places.len() * knots.len());
    for side in [0, 1] {
        for (cell, ends) in knots.windows(2).enumerate() {
            let row = 4 * (side * (grid.cells() + 1) + cell);
            for &t in places {
                let y = ends[0] + t * (ends[1] - ends[0]);
                distances.push(SIGNS[side] * grid.distance(side, y));
                let c = &table[row..row + 4];
                interpolated.push(c[0] + t * (c[1] + t * (c[2] + t * c[3])));
            }
        }
    }
    let (exact, _) = profile.t_conorm.profile(softness, tensor(phi), tensor(&distances));
    let per_side = places.len() * grid.cells();
    let pairs = numbers(exact).into_iter().zip(interpolated).enumerate();
    let sample = |(i, (exact, interpolated))| Sample {
        exact,
        interpolated,
        innermost: i % per_side < places.len(),
    };
    (pairs.map(sample).collect(), rounding::<B>(device))
}

/// Compares the cubics of a profile with the profile itself at these places in each cell, for a tolerance and a number of faces.
fn interpolation_error<B: Backend>(
    softness: &impl Softness,
    profile: Profile,
    phi: &[f64],
    places: &[f64],
    [tolerance, faces]: [f64; 2],
    device: &B::Device,
) -> Reached {
    let t_conorm = profile.t_conorm;
    let excess = t_conorm.slack(tolerance / 2.0) / faces;
    let (samples, rounding) = samples::<B>(softness, profile, phi, places, device);
    let mut reached = Reached::NOTHING;
    let steepest = steepest(t_conorm);
    let of_term = tolerance / (4.0 * t_conorm.sensitivity().max(1.0)) + rounding;
    let of_coverage = tolerance / 4.0 + rounding;
    for Sample { exact, interpolated, innermost } in samples {
        // Either the term itself is right, or the coverage that it alone makes.
        let term = (exact - interpolated).abs() / (of_term * exact.abs() + excess / 2.0);
        // Beside other faces an error of the term counts for more where coverage steepens with the sum.
        let company = (steepest - exact).max(0.0);
        let covered = |sum: f64| t_conorm.coverage_of(sum.max(0.0));
        let moved = covered(interpolated + company) - covered(exact + company);
        let alone = moved.abs() / (of_coverage * covered(exact) + tolerance / (4.0 * faces));
        let error = term.min(alone);
        let place = if innermost { &mut reached.innermost } else { &mut reached.rest };
        *place = place.max(error);
    }
    reached
}

/// How far a profile is from the constants that stand for it before its cells and beyond them, in multiples of what culling may cost each
/// of so many faces; of half the tolerance where either alone covers a pixel.
fn constancy_error<B: Backend>(
    softness: &impl Softness,
    profile: Profile,
    phi: &[f64],
    [tolerance, faces]: [f64; 2],
    device: &B::Device,
) -> f64 {
    let t_conorm = profile.t_conorm;
    let excess = t_conorm.slack(tolerance / 2.0) / faces;
    let steepest = steepest(t_conorm);
    let tensor = |values: &[f64]| precise::<B>(values, device);
    let (grid, rounding) = (profile.grid, rounding::<B>(device));
    let mut distances = Vec::new();
    for (side, sign) in SIGNS.into_iter().enumerate() {
        let end = grid.distance(side, 1.0);
        let ratio = (FARTHEST_DRAWN / end).max(1.0).powf(1.0 / f64::from(BEYOND_END));
        distances.push(sign * BEYOND * end);
        distances.extend((0..=BEYOND_END).map(|k| sign * end * ratio.powi(k as i32)));
        distances.push(sign * grid.distance(side, 0.0).max(1e-15));
        distances.extend((1..8).map(|k| sign * grid.from[side] * f64::from(k) / 8.0));
    }
    let values = numbers(t_conorm.profile(softness, tensor(phi), tensor(&distances)).0);
    let [of_side, beyond] = [distances.len() / 2, BEYOND_END as usize + 2];
    let mut most: f64 = 0.0;
    for side in [0, 1] {
        let values = &values[side * of_side..(side + 1) * of_side];
        let before = if grid.from[side] > 0.0 { &values[beyond..] } else { &[] };
        for values in [&values[..beyond], before] {
            let Some((constant, rest)) = values.split_first() else { continue };
            for value in rest {
                let term = (value - constant).abs() / (excess + rounding * constant.abs());
                let least = value.min(*constant);
                let company = (steepest - least).max(0.0);
                let covered = |sum: f64| t_conorm.coverage_of(sum.max(0.0));
                let alone = (covered(value + company) - covered(constant + company)).abs() * faces;
                let open = 1.0 - covered(least);
                most = most.max(term.min(alone.min(open) / (tolerance / 2.0)));
            }
        }
    }
    most
}

/// A tensor of the most exact float type that a device has.
pub(crate) fn precise<B: Backend>(values: &[f64], device: &B::Device) -> Tensor<B, 1> {
    let data = TensorData::new(values.to_vec(), [values.len()]);
    Tensor::from_data(data, (device, finest::<B>(device)))
}

fn finest<B: Backend>(device: &B::Device) -> DType {
    if B::supports_dtype(device, DType::F64) { DType::F64 } else { DType::F32 }
}

/// Relative rounding of a value there.
fn rounding<B: Backend>(device: &B::Device) -> f64 {
    if finest::<B>(device) == DType::F64 { 1e-14 } else { 1e-6 }
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
