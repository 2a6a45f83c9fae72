//! Position of a squared distance in a profile table.

use super::{
    float::Float,
    lanes::{Lanes, Places},
    real::{Mask, Real, splat},
};

/// Largest rate at which a position in a cell changes with the squared distance, in pixels⁻². Reached only next to the edge, with a
/// softness that f32 cannot distinguish from a step.
const STEEPEST: f64 = 1e30;

/// Layout of the cells of a profile table: two one-sided tables over the squared distance that meet at the edge of the face.
///
/// A side has cells between two distances; `y` is the fraction of the way between their squares. The profile is constant before and beyond.
/// With `y` and `c = 2^-octaves`, positions are the bits of the float `z = y (1 - c) + c`: each of the octaves of z from c to 1 holds
/// `2^bits` cells, and the last cell is the constant tail `y >= 1`. The look-up therefore needs no transcendental function, no square root,
/// and no special case for the first cell, at the edge.
///
/// With `far`, the octave of z from 1/2 to 1 is divided likewise from its other end: with `C = 2^-(far + 1)`, the `far` octaves of
/// `(1 - z) (1 - 2 C) + C` below 1/2 hold `2^bits` cells each. This suits profiles that increase without bound towards the end of their
/// support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Distance outside the face beyond which the profile is constant, in NDC.
    pub outer: f64,
    /// Distance inside the face beyond which the profile is constant, in NDC.
    pub inner: f64,
    /// Distances outside and inside the face up to which the profile has its value at the edge, in NDC; only with `far`.
    pub from: [f64; 2],
    /// Octaves resolved from the edge on.
    pub octaves: u32,
    /// Octaves resolved before the end; 0 for none.
    pub far: u32,
    /// Cells per octave, as a power of two.
    pub bits: u32,
}

impl Grid {
    /// Cells of one side, without its constant tail.
    pub fn cells(&self) -> usize {
        let octaves = if self.far == 0 { self.octaves } else { self.octaves - 1 + self.far };
        (octaves as usize) << self.bits
    }

    /// Start of the positions: `2^-octaves`, and with `far` that of the positions from the other end.
    fn starts(&self) -> [f64; 2] {
        [self.octaves, self.far + 1].map(|octaves| f64::exp2(-f64::from(octaves)))
    }

    /// The distance on a side, outer or inner, at the fraction `y` of the way between the squares of its ends.
    pub fn distance(&self, side: usize, y: f64) -> f64 {
        let [from, to] = self.ends(side);
        // Without rounding where a side starts at the edge.
        if from == 0.0 { to * y.sqrt() } else { (from * from + y * (to * to - from * from)).sqrt() }
    }

    /// The derivative of [`Grid::distance`] with respect to `y`.
    pub fn rate(&self, side: usize, y: f64) -> f64 {
        let [from, to] = self.ends(side);
        (to - from) * (to + from) / (2.0 * self.distance(side, y))
    }

    /// The inverse of [`Grid::distance`]; below 0 before the cells.
    pub fn position(&self, side: usize, distance: f64) -> f64 {
        let [from, to] = self.ends(side);
        if from == 0.0 {
            return (distance / to).powi(2);
        }
        (distance - from) * (distance + from) / ((to - from) * (to + from))
    }

    /// Distances at which the cells of a side start and end.
    fn ends(&self, side: usize) -> [f64; 2] {
        [self.from[side], [self.outer, self.inner][side]]
    }

    /// For each side the factor from squared distances to positions relative to their start, and the product of this factor and the squared
    /// distance where the cells start. `unit` is the length of a unit of the grid.
    pub fn lookups(&self, unit: f64) -> [[f64; 2]; 2] {
        let [start, _] = self.starts();
        [0, 1].map(|side| {
            let [from, to] = self.ends(side).map(|end| end * unit);
            let factor = (1.0 - start) / ((to - from) * (to + from));
            [factor, factor * from * from]
        })
    }

    /// Rows of the coefficient table: both sides with their tails, outside first.
    pub fn rows(&self) -> usize {
        2 * (self.cells() + 1)
    }

    /// Row of the constant tail outside.
    pub fn tail(&self) -> usize {
        self.cells()
    }

    /// The table `[rows, 4]` of a profile, a function from a signed distance in NDC (positive inside) to its value and slope: a cubic
    /// through both at the ends of each cell, and a straight line in the cell at the edge of the face. Beyond the ends it is constant.
    ///
    /// ```
    /// use softrast_kernel::Grid;
    ///
    /// let grid = Grid { outer: 0.2, inner: 0.2, from: [0.0; 2], octaves: 16, far: 0, bits: 3 };
    /// let table = grid.table(|d| [d, 1.0]);
    /// assert_eq!(table.len(), 4 * grid.rows());
    /// assert_eq!(table[4 * grid.tail()], -0.2); // the constant of the tail outside
    /// ```
    pub fn table(&self, profile: impl Fn(f64) -> [f64; 2]) -> Vec<f64> {
        let knots = self.knots();
        let mut table = Vec::with_capacity(4 * self.rows());
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let at = |y: f64| profile(sign * self.distance(side, y));
            for cell in knots.windows(2) {
                let [[start, slope], [end, end_slope]] = [at(cell[0]), at(cell[1])];
                let rise = end - start;
                let by_place =
                    |slope: f64, y: f64| sign * slope * self.rate(side, y) * (cell[1] - cell[0]);
                // At the edge the derivative of a distance with respect to its square is infinite.
                table.extend(if cell[0] == 0.0 {
                    [start, rise, 0.0, 0.0]
                } else {
                    let [a, b] = [by_place(slope, cell[0]), by_place(end_slope, cell[1])];
                    [start, a, 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise]
                });
            }
            table.extend([at(1.0)[0], 0.0, 0.0, 0.0]);
        }
        table
    }

    /// Ends of the cells of one side in y, ascending: `cells + 1` numbers from 0 to 1.
    pub fn knots(&self) -> Vec<f64> {
        let per_octave = 1u32 << self.bits;
        let octave = |start: f64| {
            (0..per_octave).map(move |j| start * (1.0 + f64::from(j) / f64::from(per_octave)))
        };
        let octaves = |first: u32, last: u32| {
            (last..=first).rev().flat_map(move |o| octave(f64::exp2(-f64::from(o))))
        };
        let [start, end] = self.starts();
        let y = |z: f64| (z - start) / (1.0 - start);
        if self.far == 0 {
            return octaves(self.octaves, 1).chain([1.0]).map(y).collect();
        }
        let from_far: Vec<f64> = octaves(self.far + 1, 2).chain([0.5]).collect();
        // Avoids the cancellation in 1 - z.
        let far = from_far.into_iter().rev().map(|v| {
            let rest = (v - end) / (1.0 - 2.0 * end);
            1.0 - rest / (1.0 - start)
        });
        octaves(self.octaves, 2).map(y).chain(far).collect()
    }
}

/// A [`Grid`] prepared for look-ups.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lookup<F> {
    /// Factor from squared distances to z, relative to its start.
    inverse_outer: F,
    inverse_inner: F,
    /// Scaled squared distances at which the cells start.
    before_outer: F,
    before_inner: F,
    start: F,
    /// Factor from `1 - z` to positions from the far end, and the start of these.
    shrunk: F,
    end: F,
    octaves: u32,
    far: u32,
    bits: u32,
    cells: i32,
}

/// Positions of squared distances in a table.
pub(crate) struct TablePosition<T: Real> {
    pub(crate) row: Places,
    /// Positions within the cells, in [0, 1].
    pub(crate) t: T,
    /// Derivatives of these positions with respect to the squared distance.
    pub(crate) rate: T::Lanes,
}

impl<F: Float> Lookup<F> {
    /// A look-up for distances in units of which `unit` make one unit of the grid.
    pub(crate) fn new(grid: &Grid, unit: f64) -> Self {
        let [start, end] = grid.starts();
        let [outer, inner] = grid.lookups(unit).map(|side| side.map(F::from_f64));
        Self {
            inverse_outer: outer[0],
            inverse_inner: inner[0],
            before_outer: outer[1],
            before_inner: inner[1],
            start: F::from_f64(start),
            shrunk: F::from_f64(1.0 - 2.0 * end),
            end: F::from_f64(end),
            octaves: grid.octaves,
            far: grid.far,
            bits: grid.bits,
            cells: grid.cells() as i32,
        }
    }

    /// Whether some cells are counted from the far end.
    #[inline(always)]
    pub(crate) fn has_far_cells(&self) -> bool {
        self.far > 0
    }

    /// Positions of squared distances (not negative; NaN counts as infinite), on the inner side where `inside` holds. Without `FAR` no cell
    /// may be counted from the far end.
    #[inline(always)]
    pub(crate) fn place<T: Real, const FAR: bool>(
        &self,
        distance2: T,
        inside: Mask<T>,
    ) -> TablePosition<T>
    where
        T::Lanes: Lanes<Float = F>,
    {
        let pick = <T::Lanes as Lanes>::pick;
        let pick_index = <T::Lanes as Lanes>::pick_index;
        let index = <T::Lanes as Lanes>::index;
        let one = splat::<T::Lanes>(1.0);
        let inverse =
            pick(inside, T::Lanes::splat(self.inverse_inner), T::Lanes::splat(self.inverse_outer));
        let scaled = distance2.scale(inverse);
        let mut z = scaled.value() + T::Lanes::splat(self.start);
        let mut begun = None;
        if FAR {
            let before = pick(
                inside,
                T::Lanes::splat(self.before_inner),
                T::Lanes::splat(self.before_outer),
            );
            let start = T::Lanes::splat(self.start);
            let place = scaled.value() - before;
            begun = Some(splat::<T::Lanes>(0.0).at_most(place));
            // NaN stays NaN.
            z = splat::<T::Lanes>(0.0).max(place) + start;
        }
        let (cell, mut t, mut rate) = z.cell(self.octaves, self.bits);
        let mut row = cell;
        if FAR && self.far > 0 {
            let half = splat::<T::Lanes>(0.5);
            let rest = (one - z.min(one)).min(half);
            let shrunk = T::Lanes::splat(self.shrunk);
            let rest = rest * shrunk + T::Lanes::splat(self.end);
            let (cell, place, far_rate) = rest.cell(self.far + 1, self.bits);
            // Counted from the end; the cell that starts at the middle is never reached.
            let last = T::Lanes::minus(index(self.cells - 1), cell);
            let far = half.less(z);
            let far_row = pick_index(z.less(one), last, index(self.cells));
            row = pick_index(far, far_row, row);
            t = pick(far, one - place, t);
            rate = pick(far, far_rate * shrunk, rate);
        }
        let row = T::Lanes::places(row, self.cells, inside);
        // The cubic of the tail is constant. A constant position there avoids overflow.
        let mut moves = (scaled.output() * rate).only(z.less(one));
        let mut rate = (rate * inverse).min(splat(STEEPEST));
        if let Some(begun) = begun {
            (moves, rate) = (moves.only(begun), rate.only(begun));
        }
        TablePosition { row, t: T::new(t, moves), rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{LANES, Plain};

    /// Row, and position within the cell, of `y` on the outer side.
    fn place<F: Float>(grid: &Grid, y: F) -> (usize, f64) {
        let inside = [false; LANES];
        let (lookup, y) = (Lookup::new(grid, 1.0), Plain::splat(y));
        let place: TablePosition<Plain<F>> = match grid.far {
            0 => lookup.place::<_, false>(y, inside),
            _ => lookup.place::<_, true>(y, inside),
        };
        (place.row.numbers::<Plain<F>>()[0], place.t.array()[0].to_f64())
    }

    #[test]
    fn every_place_lies_between_the_knots_of_its_cell() {
        let near = Grid { outer: 1.0, inner: 1.0, from: [0.0; 2], octaves: 12, far: 0, bits: 3 };
        let both = Grid { outer: 1.0, inner: 1.0, from: [0.0; 2], octaves: 7, far: 9, bits: 2 };
        for grid in [near, both] {
            let knots = grid.knots();
            assert_eq!(knots.len(), grid.cells() + 1);
            assert!(knots.is_sorted());
            for i in 0..20_000 {
                let y = (f64::from(i) / 10_000.0).powi(3) * 0.2;
                let (row, t) = place(&grid, y as f32);
                if y >= 1.0 {
                    assert_eq!(row, grid.tail());
                    continue;
                }
                assert!((0.0..=1.0 + 1e-6).contains(&t), "y {y} row {row} t {t}");
                let width = knots[row + 1] - knots[row];
                let wanted = (y - knots[row]) / width;
                // Three units in the last place of the float that holds the position: z, or 1 - z, which has lost digits.
                let far = grid.far > 0 && y > 0.5;
                let size = if far { 1.0 } else { y + f64::exp2(-f64::from(grid.octaves)) };
                let rounded = 1.5 * f64::from(f32::EPSILON) * size / width;
                assert!((t - wanted).abs() < rounded, "y {y} row {row} t {t} instead of {wanted}");
            }
        }
    }

    #[test]
    fn the_inner_side_has_rows_of_its_own() {
        let grid = Grid { outer: 1.0, inner: 0.5, from: [0.0; 2], octaves: 4, far: 0, bits: 2 };
        let y = Plain::splat(0.3f64);
        let inside =
            Lookup::new(&grid, 1.0).place::<_, false>(y.scale(Plain::splat(0.25)), [true; LANES]);
        assert_eq!(
            inside.row.numbers::<Plain<f64>>()[0],
            place(&grid, 0.3f64).0 + grid.cells() + 1
        );
    }

    #[test]
    fn infinity_and_nan_fall_into_the_tail() {
        for far in [0, 5] {
            let grid = Grid { outer: 1.0, inner: 1.0, from: [0.0; 2], octaves: 4, far, bits: 2 };
            for y in [f64::INFINITY, f64::NAN, 1.0, 1e300] {
                assert_eq!(place(&grid, y).0, grid.tail());
            }
        }
    }
}
