//! Where a squared distance lies in a profile table.

use super::real::Float;

/// Places of the cells of a profile table: two one-sided tables over the squared distance that
/// meet at the edge of the face.
///
/// With `y = d² / radius²` of the side, cell 0 is `y < 2^-octaves`; above it each octave of y up to
/// 1 holds `2^bits` cells; the last cell is the constant tail `y >= 1`. The place is read off the
/// bits of the float, so the look-up needs no transcendental function and no square root.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Distance outside the face beyond which the profile is constant, in NDC.
    pub(crate) outer: f64,
    /// Distance inside the face beyond which the profile is constant, in NDC.
    pub(crate) inner: f64,
    /// Octaves of y that are resolved.
    pub(crate) octaves: u32,
    /// Cells in an octave, as a power of two.
    pub(crate) bits: u32,
}

impl Grid {
    /// Cells of one side, without its constant tail.
    pub(crate) fn cells(&self) -> usize {
        1 + ((self.octaves as usize) << self.bits)
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
        let octave = |o: u32| {
            let start = f64::exp2(f64::from(o) - f64::from(self.octaves));
            (0..per_octave).map(move |j| start * (1.0 + f64::from(j) / f64::from(per_octave)))
        };
        std::iter::once(0.0).chain((0..self.octaves).flat_map(octave)).chain([1.0]).collect()
    }
}

/// A [`Grid`] prepared for look-ups in one float type.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lookup<F> {
    inverse_outer: F,
    inverse_inner: F,
    innermost: F,
    octaves: u32,
    bits: u32,
    cells: i32,
}

/// Place of a squared distance: row of the table, and the affine map to the place in the cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<F> {
    pub(crate) row: u32,
    /// `t = (d2 - start) * rate`, in [0, 1] within the cell.
    pub(crate) start: F,
    pub(crate) rate: F,
}

impl<F: Float> Lookup<F> {
    pub(crate) fn new(grid: &Grid) -> Self {
        Self {
            inverse_outer: F::from_f64(grid.outer.powi(-2)),
            inverse_inner: F::from_f64(grid.inner.powi(-2)),
            innermost: F::from_f64(f64::exp2(f64::from(grid.octaves))),
            octaves: grid.octaves,
            bits: grid.bits,
            cells: grid.cells() as i32,
        }
    }

    /// Place of the squared distance `d2`, scaled: `y = d2 * inverse` of its side.
    #[inline(always)]
    pub(crate) fn inverse(&self, inside: bool) -> F {
        if inside { self.inverse_inner } else { self.inverse_outer }
    }

    /// Place of `y` (not negative; NaN counts as far away) on the given side.
    #[inline(always)]
    pub(crate) fn place(&self, y: F, inside: bool) -> Place<F> {
        let two = F::from_f64(2.0);
        let y = if y < two { y } else { two };
        let (index, lower, inverse_width) = y.cell(self.octaves, self.bits);
        let first = index <= 0;
        let index = if first { 0 } else { index };
        let index = if index > self.cells { self.cells } else { index };
        let row = if inside { index + self.cells + 1 } else { index };
        Place {
            row: row as u32,
            start: if first { F::ZERO } else { lower },
            rate: if first { self.innermost } else { inverse_width },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_lies_between_the_knots_of_its_cell() {
        let grid = Grid { outer: 1.0, inner: 1.0, octaves: 12, bits: 3 };
        let knots = grid.knots();
        assert_eq!(knots.len(), grid.cells() + 1);
        let lookup = Lookup::<f32>::new(&grid);
        for i in 0..20_000 {
            let y = (f64::from(i) / 10_000.0).powi(3) * 0.2;
            let place = lookup.place(y as f32, false);
            let row = place.row as usize;
            if y >= 1.0 {
                assert_eq!(row, grid.tail());
                continue;
            }
            let t = (y as f32 - place.start) * place.rate;
            assert!((0.0..=1.0).contains(&t), "y {y} row {row} t {t}");
            assert!(knots[row] <= y * (1.0 + 1e-7) && y <= knots[row + 1] * (1.0 + 1e-7));
            assert_eq!(lookup.place(y as f32, true).row as usize, row + grid.cells() + 1);
        }
    }

    #[test]
    fn infinity_and_nan_fall_into_the_tail() {
        let grid = Grid { outer: 1.0, inner: 1.0, octaves: 4, bits: 2 };
        let lookup = Lookup::<f64>::new(&grid);
        for y in [f64::INFINITY, f64::NAN, 1.0, 1e300] {
            assert_eq!(lookup.place(y, false).row as usize, grid.tail());
        }
    }
}
