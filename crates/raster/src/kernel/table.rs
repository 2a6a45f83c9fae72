//! Where a squared distance lies in a profile table.

use super::real::Float;

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

/// A [`Grid`] prepared for look-ups in one float type.
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

/// Place of a squared distance: row of the table, and the affine map to the place in the cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<F> {
    pub(crate) row: u32,
    /// `t = (y - start) * rate`, in [0, 1] within the cell.
    pub(crate) start: F,
    pub(crate) rate: F,
    /// Whether the cell is counted from the far end. Then `start` is `1 - y` where the cell starts, so
    /// that `t = (start - (1 - y)) * rate` keeps its digits.
    pub(crate) far: bool,
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

    /// Place of the squared distance `d2`, scaled: `y = d2 * inverse` of its side.
    #[inline(always)]
    pub(crate) fn inverse(&self, inside: bool) -> F {
        if inside { self.inverse_inner } else { self.inverse_outer }
    }

    /// Place of `y` (not negative; NaN counts as far away) on the given side. `FAR` is
    /// [`Lookup::has_far_cells`].
    #[inline(always)]
    pub(crate) fn place<const FAR: bool>(&self, y: F, inside: bool) -> Place<F> {
        let two = F::from_f64(2.0);
        let y = if y < two { y } else { two };
        let (index, lower, inverse_width) = y.cell(self.octaves, self.bits);
        let first = index <= 0;
        let index = if first { 0 } else { index };
        let index = if index > self.cells { self.cells } else { index };
        let mut place = Place {
            row: index as u32,
            start: if first { F::ZERO } else { lower },
            rate: if first { self.innermost } else { inverse_width },
            far: false,
        };
        if FAR && y > F::from_f64(0.5) {
            let z = if y < F::ONE { F::ONE - y } else { F::ZERO };
            let (index, lower, inverse_width) = z.cell(self.far + 1, self.bits);
            let last = index <= 0;
            let row = self.cells - 1 - if last { 0 } else { index };
            let rate = if last { self.outermost } else { inverse_width };
            let start = if last { F::ZERO } else { lower } + rate.recip();
            let row = if y < F::ONE { row } else { self.cells };
            place = Place { row: row as u32, start, rate, far: true };
        }
        place.row += if inside { self.cells as u32 + 1 } else { 0 };
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_lies_between_the_knots_of_its_cell() {
        let grid = Grid { outer: 1.0, inner: 1.0, octaves: 12, far: 0, bits: 3 };
        let knots = grid.knots();
        assert_eq!(knots.len(), grid.cells() + 1);
        let lookup = Lookup::<f32>::new(&grid);
        for i in 0..20_000 {
            let y = (f64::from(i) / 10_000.0).powi(3) * 0.2;
            let place = lookup.place::<false>(y as f32, false);
            let row = place.row as usize;
            if y >= 1.0 {
                assert_eq!(row, grid.tail());
                continue;
            }
            let t = (y as f32 - place.start) * place.rate;
            assert!((0.0..=1.0).contains(&t), "y {y} row {row} t {t}");
            assert!(knots[row] <= y * (1.0 + 1e-7) && y <= knots[row + 1] * (1.0 + 1e-7));
            assert_eq!(lookup.place::<false>(y as f32, true).row as usize, row + grid.cells() + 1);
        }
    }

    #[test]
    fn cells_of_both_ends_meet_in_the_middle() {
        let grid = Grid { outer: 1.0, inner: 1.0, octaves: 7, far: 9, bits: 2 };
        let knots = grid.knots();
        assert_eq!(knots.len(), grid.cells() + 1);
        assert!(knots.is_sorted());
        let lookup = Lookup::<f32>::new(&grid);
        let middles = knots.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        for y in middles.chain(knots[..grid.cells()].iter().copied()) {
            let place = lookup.place::<true>(y as f32, false);
            let row = place.row as usize;
            let from = if place.far { 1.0 - y as f32 } else { y as f32 };
            let t = f64::from((from - place.start).abs() * place.rate);
            let wanted = (y - knots[row]) / (knots[row + 1] - knots[row]);
            assert!((t - wanted).abs() < 1e-4, "y {y} row {row} t {t} instead of {wanted}");
        }
    }

    #[test]
    fn infinity_and_nan_fall_into_the_tail() {
        for far in [0, 5] {
            let grid = Grid { outer: 1.0, inner: 1.0, octaves: 4, far, bits: 2 };
            let lookup = Lookup::<f64>::new(&grid);
            for y in [f64::INFINITY, f64::NAN, 1.0, 1e300] {
                let place = if far > 0 { Lookup::place::<true> } else { Lookup::place::<false> };
                assert_eq!(place(&lookup, y, false).row as usize, grid.tail());
            }
        }
    }
}
