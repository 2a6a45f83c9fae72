//! The place of a silhouette in a picture that cuts it off: searches all places at low resolution, with rows as bit masks.

/// Cells between the places of the first pass.
const STRIDE: isize = 2;
/// Silhouettes are skipped if their area within the picture differs from that of the mask by more than this factor.
const AREAS: f64 = 1.3;

/// A mask, and the covered part of its square.
pub(super) struct Window {
    rows: [u32; Self::SIDE],
    area: u32,
    /// First column and row that the picture covers, and those after the last.
    covered: [[isize; 2]; 2],
}

/// A whole silhouette at some size, with the middle of the mesh at its centre.
pub(super) struct Stencil {
    rows: [u64; Self::SIDE],
    /// Summed-area table: number of cells that are on above and to the left of each corner.
    sums: Vec<u16>,
}

impl Stencil {
    /// Cells a side.
    pub(super) const SIDE: usize = 64;

    /// An image `[SIDE * SIDE]`, enlarged by this factor about its centre and cropped.
    pub(super) fn new(image: &[f64], larger: f64) -> Self {
        let half = Self::SIDE as f64 / 2.0;
        let from = |k: usize| {
            let at = half + (k as f64 + 0.5 - half) / larger;
            (at >= 0.0 && at < Self::SIDE as f64).then_some(at as usize)
        };
        let places: Vec<Option<usize>> = (0..Self::SIDE).map(from).collect();
        let mut rows = [0; Self::SIDE];
        for (row, y) in rows.iter_mut().zip(&places) {
            let Some(line) = y.map(|y| &image[y * Self::SIDE..][..Self::SIDE]) else { continue };
            for (x, place) in places.iter().enumerate() {
                *row |= u64::from(place.is_some_and(|place| line[place] > 0.5)) << x;
            }
        }
        let across = Self::SIDE + 1;
        let mut sums = vec![0; across * across];
        for (y, row) in rows.iter().enumerate() {
            let mut sum = 0;
            for x in 0..Self::SIDE {
                sum += (row >> x & 1) as u16;
                sums[(y + 1) * across + x + 1] = sums[y * across + x + 1] + sum;
            }
        }
        Self { rows, sums }
    }

    /// Number of cells that are on between these columns and rows.
    fn area(&self, [low, high]: [[isize; 2]; 2]) -> u32 {
        let held = |at: isize| at.clamp(0, Self::SIDE as isize) as usize;
        let sum = |x: isize, y: isize| u32::from(self.sums[held(y) * (Self::SIDE + 1) + held(x)]);
        sum(high[0], high[1]) + sum(low[0], low[1]) - sum(low[0], high[1]) - sum(high[0], low[1])
    }
}

impl Window {
    /// Cells a side.
    pub(super) const SIDE: usize = 32;

    /// A mask at low resolution, and the share of each pixel that the picture covers.
    pub(super) fn new(levels: &[f64], covered: &[f64]) -> Self {
        let mut rows = [0; Window::SIDE];
        let [mut low, mut high] = [[Window::SIDE as isize; 2], [0; 2]];
        for (k, (&level, &covered)) in levels.iter().zip(covered).enumerate() {
            let (x, y) = (k % Window::SIDE, k / Window::SIDE);
            rows[y] |= u32::from(level >= 0.5) << x;
            if covered >= 0.5 {
                for (axis, at) in [x as isize, y as isize].into_iter().enumerate() {
                    (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at + 1));
                }
            }
        }
        let area = rows.iter().map(|row: &u32| row.count_ones()).sum();
        Self { rows, area, covered: [low, high] }
    }

    /// Number of mask cells.
    pub(super) fn area(&self) -> f64 {
        f64::from(self.area)
    }

    /// The position of a silhouette's middle in the window, in cells, at the largest overlap with
    /// the mask within the picture, and the intersection over union there.
    pub(super) fn best(&self, stencil: &Stencil) -> Option<([f64; 2], f64)> {
        let (side, window) = (Stencil::SIDE as isize, Window::SIDE as isize);
        let all = || (1 - side..window).step_by(STRIDE as usize);
        let every = all().flat_map(|y| all().map(move |x| [x, y]));
        let best = |places: &mut dyn Iterator<Item = [isize; 2]>| {
            let scored = places.filter_map(|at| Some((at, self.overlap(stencil, at)?)));
            scored.max_by(|(_, a), (_, b)| a.total_cmp(b))
        };
        let (at, _) = best(&mut every.into_iter())?;
        let beside = (0..9).map(|k| [at[0] + k % 3 - 1, at[1] + k / 3 - 1]);
        let (at, overlap) = best(&mut beside.into_iter())?;
        Some((at.map(|k| (k + side / 2) as f64), overlap))
    }

    /// Intersection over union of the mask and a silhouette at this first cell; `None` if their areas differ too much.
    fn overlap(&self, stencil: &Stencil, [left, top]: [isize; 2]) -> Option<f64> {
        let shown = stencil.area(self.covered.map(|[x, y]| [x - left, y - top]));
        let larger = f64::from(shown) / f64::from(self.area);
        if !(1.0 / AREAS..=AREAS).contains(&larger) {
            return None;
        }
        let row = |y: isize| {
            let Ok(row) = usize::try_from(y - top) else { return 0 };
            let bits = stencil.rows.get(row).copied().unwrap_or(0);
            if left >= 0 { bits << left } else { bits >> -left }
        };
        let both = |(y, mask): (usize, &u32)| match mask {
            0 => 0,
            _ => (row(y as isize) as u32 & mask).count_ones(),
        };
        let both: u32 = self.rows.iter().enumerate().map(both).sum();
        Some(f64::from(both) / f64::from(shown + self.area - both))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silhouette_is_found_where_the_picture_cuts_it_off() {
        // A flag on a pole; the picture covers the columns right of column 10 of the window.
        let on = |x: f64, y: f64| {
            (x.abs() < 9.0 && y.abs() < 4.0) || (x + 7.0).abs() < 2.0 && y > 0.0 && y < 15.0
        };
        let half = Stencil::SIDE as f64 / 2.0;
        let stencil = |k: usize| {
            let [x, y] = [k % Stencil::SIDE, k / Stencil::SIDE].map(|k| k as f64 + 0.5 - half);
            f64::from(u8::from(on(x, y)))
        };
        let image: Vec<f64> = (0..Stencil::SIDE * Stencil::SIDE).map(stencil).collect();
        let covered = |k: usize| f64::from(u8::from(k % Window::SIDE >= 10));
        for (middle, larger) in [([13.0, 14.0], 1.0), ([17.0, 11.0], 1.25)] {
            let mask = |k: usize| {
                let place = [k % Window::SIDE, k / Window::SIDE].map(|k| k as f64 + 0.5);
                let at = [0, 1].map(|axis| (place[axis] - middle[axis]) / larger);
                covered(k) * f64::from(u8::from(on(at[0], at[1])))
            };
            let window = Window::new(
                &(0..Window::SIDE * Window::SIDE).map(mask).collect::<Vec<_>>(),
                &(0..Window::SIDE * Window::SIDE).map(covered).collect::<Vec<_>>(),
            );
            let (at, overlap) = window.best(&Stencil::new(&image, larger)).unwrap();
            assert!(overlap > 0.95 && at == middle, "{at:?} and not {middle:?}: {overlap}");
            let (_, other) = window.best(&Stencil::new(&image, 0.75 * larger)).unwrap();
            assert!(other < overlap, "{other}");
        }
    }
}
