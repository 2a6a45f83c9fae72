//! Where a squared distance lies in a profile table.

use super::{
    float::Float,
    lanes::Lanes,
    real::{Mask, Real, splat},
};

/// Largest rate at which a place in a cell moves with the squared distance, in NDC⁻². Reached only
/// next to the edge under a softness narrower than f32 can tell from a step.
const STEEPEST: f64 = 1e30;

/// Places of the cells of a profile table: two one-sided tables over the squared distance that
/// meet at the edge of the face.
///
/// With `y = d² / radius²` of the side, cell 0 is `y < 2^-octaves`; above it each octave of y up to
/// 1 holds `2^bits` cells; the last cell is the constant tail `y >= 1`. The place is read off the
/// bits of the float, so the look-up needs no transcendental function and no square root.
///
/// With `far`, the octave from 1/2 to 1 is cut like that from its other end: `far` octaves of
/// `1 - y` below 1/2 hold `2^bits` cells each, and one cell is what remains next to 1. It serves
/// profiles that rise without bound towards the end of their support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Distance outside the face beyond which the profile is constant, in NDC.
    pub(crate) outer: f64,
    /// Distance inside the face beyond which the profile is constant, in NDC.
    pub(crate) inner: f64,
    /// Octaves of y that are resolved.
    pub(crate) octaves: u32,
    /// Octaves of 1 - y that are resolved; 0 for none.
    pub(crate) far: u32,
    /// Cells in an octave, as a power of two.
    pub(crate) bits: u32,
}

impl Grid {
    /// Cells of one side, without its constant tail.
    pub(crate) fn cells(&self) -> usize {
        match self.far {
            0 => 1 + ((self.octaves as usize) << self.bits),
            far => 2 + (((self.octaves - 1 + far) as usize) << self.bits),
        }
    }

    /// Rows of the coefficient table: both sides with their tails, outside first.
    pub(crate) fn rows(&self) -> usize {
        2 * (self.cells() + 1)
    }

    /// Row of the constant tail outside.
    pub(crate) fn tail(&self) -> usize {
        self.cells()
    }

    /// Ends of the cells of one side in y, ascending, `cells + 1` numbers from 0 to 1.
    pub(crate) fn knots(&self) -> Vec<f64> {
        let per_octave = 1u32 << self.bits;
        let octave = |start: f64| {
            (0..per_octave).map(move |j| start * (1.0 + f64::from(j) / f64::from(per_octave)))
        };
        let near = (1..=self.octaves).rev().map(|o| f64::exp2(-f64::from(o)));
        // The last octave is cut from the other end if it is cut at all.
        let near = near.filter(|&start| self.far == 0 || start < 0.5);
        let mut knots = vec![0.0];
        knots.extend(near.flat_map(octave));
        let far = (2..=self.far + 1).rev().map(|o| f64::exp2(-f64::from(o)));
        let from_far: Vec<_> = far.flat_map(octave).chain((self.far > 0).then_some(0.5)).collect();
        knots.extend(from_far.into_iter().rev().map(|z| 1.0 - z));
        knots.push(1.0);
        knots
    }
}

/// A [`Grid`] prepared for look-ups.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lookup<F> {
    inverse_outer: F,
    inverse_inner: F,
    innermost: F,
    outermost: F,
    octaves: u32,
    far: u32,
    bits: u32,
    cells: i32,
}

/// Places of squared distances in a table.
pub(crate) struct Place<T: Real> {
    pub(crate) row: <T::Lanes as Lanes>::Index,
    /// Places within the cells, in [0, 1].
    pub(crate) t: T,
    /// Rates at which they change with the squared distance.
    pub(crate) rate: T::Lanes,
}

impl<F: Float> Lookup<F> {
    pub(crate) fn new(grid: &Grid) -> Self {
        Self {
            inverse_outer: F::from_f64(grid.outer.powi(-2)),
            inverse_inner: F::from_f64(grid.inner.powi(-2)),
            innermost: F::from_f64(f64::exp2(f64::from(grid.octaves))),
            outermost: F::from_f64(f64::exp2(f64::from(grid.far + 1))),
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

    /// Places of squared distances (not negative; NaN counts as far away) on the inner side where the mask holds. Without
    /// `FAR` none may be counted from the far end.
    #[inline(always)]
    pub(crate) fn place<T: Real, const FAR: bool>(&self, distance2: T, inside: Mask<T>) -> Place<T>
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
        let y = scaled.value();
        let (cell, lower, inverse_width) = y.cell(self.octaves, self.bits);
        let first = T::Lanes::not_positive(cell);
        let mut row = T::Lanes::limited(cell, self.cells);
        let start = pick(first, splat(0.0), lower);
        let mut rate = pick(first, T::Lanes::splat(self.innermost), inverse_width);
        let mut along = scaled - T::constant(start);
        if FAR && self.far > 0 {
            let z = (one - y).only(y.less(one));
            let (cell, lower, inverse_width) = z.cell(self.far + 1, self.bits);
            let last = T::Lanes::not_positive(cell);
            let far_rate = pick(last, T::Lanes::splat(self.outermost), inverse_width);
            // Counted from where the cell starts, 1 - y keeps its digits.
            let start = pick(last, splat(0.0), lower) + Lanes::recip(far_rate);
            let far_row =
                T::Lanes::minus(index(self.cells - 1), T::Lanes::limited(cell, self.cells));
            let far_row = pick_index(y.less(one), far_row, index(self.cells));
            let far = splat::<T::Lanes>(0.5).less(y);
            row = pick_index(far, far_row, row);
            rate = pick(far, far_rate, rate);
            let from_end = T::constant(start) - (T::constant(one) - scaled);
            along = T::choose(far, from_end, along);
        }
        // In the tail the cubic is constant; a place of 0 keeps overflow out of it.
        let t = along.scale(rate).masked(y.less(one));
        let side = pick_index(inside, index(self.cells + 1), index(0));
        let rate = (rate * inverse).min(splat(STEEPEST));
        Place { row: T::Lanes::plus(row, side), t, rate }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::lanes::{LANES, Plain};

    /// Row and place within the cell of `y` outside.
    fn place<F: Float>(grid: &Grid, y: F) -> (usize, f64) {
        let inside = [false; LANES];
        let (lookup, y) = (Lookup::new(grid), Plain::splat(y));
        let place: Place<Plain<F>> = match grid.far {
            0 => lookup.place::<_, false>(y, inside),
            _ => lookup.place::<_, true>(y, inside),
        };
        (place.row[0] as usize, place.t.array()[0].to_f64())
    }

    #[test]
    fn every_place_lies_between_the_knots_of_its_cell() {
        let near = Grid { outer: 1.0, inner: 1.0, octaves: 12, far: 0, bits: 3 };
        let both = Grid { outer: 1.0, inner: 1.0, octaves: 7, far: 9, bits: 2 };
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
                let wanted = (y - knots[row]) / (knots[row + 1] - knots[row]);
                assert!((t - wanted).abs() < 2e-4, "y {y} row {row} t {t} instead of {wanted}");
            }
        }
    }

    #[test]
    fn the_inner_side_has_rows_of_its_own() {
        let grid = Grid { outer: 1.0, inner: 0.5, octaves: 4, far: 0, bits: 2 };
        let y = Plain::splat(0.3f64);
        let inside =
            Lookup::new(&grid).place::<_, false>(y.scale(Plain::splat(0.25)), [true; LANES]);
        assert_eq!(inside.row[0] as usize, place(&grid, 0.3f64).0 + grid.cells() + 1);
    }

    #[test]
    fn infinity_and_nan_fall_into_the_tail() {
        for far in [0, 5] {
            let grid = Grid { outer: 1.0, inner: 1.0, octaves: 4, far, bits: 2 };
            for y in [f64::INFINITY, f64::NAN, 1.0, 1e300] {
                assert_eq!(place(&grid, y), (grid.tail(), 0.0));
            }
        }
    }
}
