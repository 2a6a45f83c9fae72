//! Number and positions of the knots of a curve.

use softrast_kernel::Grid;

/// Octaves of the squared distance that a table may resolve, and cells in an octave (as a power of
/// two) that it may use, coarsest first.
const OCTAVES: [u32; 7] = [12, 16, 24, 36, 56, 80, 120];
const BITS: std::ops::RangeInclusive<u32> = 2..=7;
/// Finer cells are used, up to this many per side, as long as each halving reduces the error at least by the factor [`GAIN`]: a corner
/// gains half, a jump nothing.
const MOST_CELLS: usize = 1 << 15;
const GAIN: f64 = 0.7;
/// Octaves of the distance to the end of the support that a table may resolve, coarsest first, if cells that are spaced from the edge of
/// the face are not enough.
pub(crate) const FAR: [u32; 4] = [8, 16, 26, 36];
/// There, the terms of a second derivative nearly cancel; this many more bits preserve the remainder.
const SHARPER: u32 = 2;
/// Radius of an unbounded support, in NDC.
pub(super) const EVERYWHERE: f64 = 4e6;
/// A side that is constant still has a cell, of this size.
pub(super) const NARROWEST: f64 = 1e-9;

/// A grid with these radii that is fine enough for `error` to be at most 1, or as fine as allowed, and the error. `from` returns the
/// distances from the edge at which the sides start to change; it is called if knots close to the edge are not enough.
pub(super) fn refined(
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
    // The innermost cell determines the octaves, all others the cells per octave.
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
    // More knots are needed where the profile increases without bound at the end of its support, or at a corner in the middle, where more
    // of them at the end do not help.
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

/// Interpolation errors, as multiples of their targets.
pub(super) struct Reached {
    pub(super) innermost: f64,
    pub(super) rest: f64,
}

impl Reached {
    pub(super) const NOTHING: Self = Self { innermost: 0.0, rest: 0.0 };

    pub(super) fn most(&self) -> f64 {
        self.innermost.max(self.rest)
    }
}
