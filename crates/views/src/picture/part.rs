//! Resampling of parts of a picture, by means over areas.

use anyhow::{Context, ensure};
use softrast_raster::ImageSize;
use softrast_tensor::{Backend, Tensor, tensor_on};

use super::Picture;

/// Size of the view square relative to the white part of a mask.
const MARGIN: f64 = 1.5;
/// Largest change of the longer side of a picture for the sake of halving, relative to it.
const MOST_ROUNDED: f64 = 0.01;

impl Picture {
    /// The least square around the pixels that are at least half white, with its centre at theirs: left, top and extent in pixels. `None`
    /// if there are none.
    ///
    /// A pixel counts if most of the nine around it are white too, unless there is no such pixel: specks are ignored.
    pub fn square(&self) -> Option<[f64; 3]> {
        let height = self.levels.len() / self.width;
        let white = |x: usize, y: usize| {
            x < self.width && y < height && self.levels[y * self.width + x] >= 0.5
        };
        let firmly = |[x, y]: [usize; 2]| {
            let around = (0..9).map(|k| ((x + k % 3).wrapping_sub(1), (y + k / 3).wrapping_sub(1)));
            around.filter(|&(x, y)| white(x, y)).count() >= 5
        };
        let all = || {
            let pixels = (0..self.levels.len()).filter(|&k| self.levels[k] >= 0.5);
            pixels.map(|k| [k % self.width, k / self.width])
        };
        let [low, high] = bounds(all(), firmly).or_else(|| bounds(all(), |_| true))?;
        let extent = [0, 1].map(|k| (high[k] - low[k] + 1) as f64);
        let longest = extent[0].max(extent[1]);
        let corner = [0, 1].map(|k| low[k] as f64 + (extent[k] - longest) / 2.0);
        Some([corner[0], corner[1], longest])
    }

    /// The view square of a mask, one and a half times as large as [`Picture::square`]: left, top and extent in pixels.
    ///
    /// # Errors
    ///
    /// If no pixel or every pixel of the mask is white.
    pub fn view_square(&self) -> anyhow::Result<[f64; 3]> {
        let [left, top, extent] =
            self.square().context("the mask is empty: no pixel is half white or more")?;
        ensure!(
            self.levels.iter().any(|&level| level < 0.5),
            "the mask is full: all pixels are white, and there is no outline to fit"
        );
        let margin = (MARGIN - 1.0) / 2.0 * extent;
        Ok([left - margin, top - margin, MARGIN * extent])
    }

    /// A square of the picture, given by left, top and extent in pixels, resampled to `side` × `side` pixels: the mean of the picture over
    /// each pixel, black outside, and the fraction of each that the picture covers.
    pub fn part(&self, [left, top, extent]: [f64; 3], side: usize) -> [Vec<f64>; 2] {
        let (height, cell) = (self.levels.len() / self.width, extent / side as f64);
        let columns = shares(self.width, left, cell, side);
        let rows = shares(height, top, cell, side);
        [means(&columns, &rows, self.width, &self.levels), covered(&columns, &rows)]
    }

    /// The image `[size * size]`, top row first, 0 black to 1 white.
    ///
    /// The longer side of a picture fills the image; the rest is black. Each pixel is the mean of the picture over its area.
    pub fn levels(&self, size: usize) -> Vec<f64> {
        let (width, height) = (self.width as f64, (self.levels.len() / self.width) as f64);
        let longest = width.max(height);
        let (left, top) = ((width - longest) / 2.0, (height - longest) / 2.0);
        let [levels, _] = self.part([left, top, longest], size);
        levels
    }

    /// The size of this picture where its shorter side has `size` pixels. The longer one is rounded, by up to 1 % to a side that can be
    /// halved three times, or as often as the shorter one.
    pub fn size_at(&self, size: usize) -> ImageSize {
        let own = self.size();
        let side = |of: usize| {
            let exact = of as f64 * size as f64 / own.shorter() as f64;
            let rounded = |halvings: u32| {
                let least = f64::from(1 << halvings);
                (exact / least).round() * least
            };
            let is_near = |side: &f64| (side - exact).abs() <= MOST_ROUNDED * exact;
            let coarse = (1..=size.trailing_zeros().min(3)).rev().map(rounded).find(is_near);
            coarse.unwrap_or_else(|| rounded(0)) as usize
        };
        [side(own.height), side(own.width)].into()
    }

    /// The whole picture at this size, `[height * width]`: its means over the pixels.
    pub fn resized(&self, size: ImageSize) -> Vec<f64> {
        let own = self.size();
        let shares =
            |count: usize, cells: usize| shares(count, 0.0, count as f64 / cells as f64, cells);
        let (columns, rows) = (shares(own.width, size.width), shares(own.height, size.height));
        means(&columns, &rows, own.width, &self.levels)
    }

    /// [`Picture::levels`] as a tensor `[1, size, size]`.
    pub fn tensor<B: Backend>(&self, size: usize, device: &B::Device) -> Tensor<B, 3> {
        tensor_on(self.levels(size), [1, size, size], device)
    }
}

/// Least and largest of the places that count, along each axis.
fn bounds(
    places: impl Iterator<Item = [usize; 2]>,
    counts: impl Fn([usize; 2]) -> bool,
) -> Option<[[usize; 2]; 2]> {
    let [mut low, mut high] = [[usize::MAX; 2], [0; 2]];
    for at in places {
        // Within the bounds it changes nothing.
        let is_within = (0..2).all(|k| low[k] <= at[k] && at[k] <= high[k]);
        if !is_within && counts(at) {
            (low, high) = ([0, 1].map(|k| low[k].min(at[k])), [0, 1].map(|k| high[k].max(at[k])));
        }
    }
    (low[0] != usize::MAX).then_some([low, high])
}

/// Means over cells, row by row, of levels `[height * width]`.
fn means(columns: &[Shares], rows: &[Shares], width: usize, levels: &[f32]) -> Vec<f64> {
    let mut means = vec![0.0; rows.len() * columns.len()];
    // Rows of the picture over the cells of a row: the last one may begin the next row of cells too.
    let (mut last, mut along) = (None, vec![0.0; columns.len()]);
    for (row, means) in rows.iter().zip(means.chunks_mut(columns.len().max(1))) {
        for &(y, share) in row {
            if last != Some(y) {
                let levels = &levels[y * width..(y + 1) * width];
                let sum = |column: &Shares| {
                    column.iter().map(|&(x, part)| part * f64::from(levels[x])).sum::<f64>()
                };
                along.iter_mut().zip(columns).for_each(|(along, column)| *along = sum(column));
                last = Some(y);
            }
            means.iter_mut().zip(&along).for_each(|(mean, along)| *mean += share * along);
        }
    }
    means
}

/// The part of each cell that is within the picture, row by row.
fn covered(columns: &[Shares], rows: &[Shares]) -> Vec<f64> {
    let sums = |cells: &[Shares]| -> Vec<f64> {
        cells.iter().map(|cell| cell.iter().map(|(_, share)| share).sum()).collect()
    };
    let (columns, rows) = (sums(columns), sums(rows));
    rows.iter().flat_map(|row| columns.iter().map(move |column| row * column)).collect()
}

/// The picture elements of a cell, and the fraction of the cell that each fills.
type Shares = Vec<(usize, f64)>;

/// The shares in cells of length `cell`, the first of which starts at `from`, of `count` picture elements of length 1 from 0 on.
fn shares(count: usize, from: f64, cell: f64, cells: usize) -> Vec<Shares> {
    let of_cell = |k: usize| {
        let (from, to) = (from + k as f64 * cell, from + (k + 1) as f64 * cell);
        let (first, last) = (from.max(0.0) as usize, (to.max(0.0).ceil() as usize).min(count));
        let share = |x: usize| ((x + 1) as f64).min(to) - (x as f64).max(from);
        (first..last).map(|x| (x, share(x) / cell)).filter(|&(_, share)| share > 0.0).collect()
    };
    (0..cells).map(of_cell).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(found: &[f64], expected: &[f64]) {
        let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7);
        assert!(close && found.len() == expected.len(), "{found:?}");
    }

    #[test]
    fn smaller_is_the_mean_and_larger_repeats() {
        let picture = Picture::new(vec![0.0, 1.0, 1.0, 0.0], 2);
        assert_close(&picture.levels(1), &[0.5]);
        assert_close(&picture.levels(2), &[0.0, 1.0, 1.0, 0.0]);
        let middle = 0.5;
        let expected = [0.0, middle, 1.0, middle, middle, middle, 1.0, middle, 0.0];
        assert_close(&picture.levels(3), &expected);
    }

    #[test]
    fn a_resized_picture_keeps_its_proportions_and_has_the_means_of_its_pixels() {
        let picture = Picture::new(vec![0.0, 1.0, 1.0, 0.0, 0.5, 0.5, 0.0, 0.0], 4);
        let size = picture.size_at(1);
        assert_eq!([size.height, size.width], [1, 2]);
        assert_close(&picture.resized(size), &[0.5, 0.25]);
        assert_close(&picture.resized(picture.size_at(2)), &picture.levels(4)[4..12]);
        assert_eq!(Picture::new(vec![0.0; 6], 3).size_at(5), [5, 8].into());
        // Exactly 341.3 and 60.
        assert_eq!(Picture::new(vec![0.0; 12], 4).size_at(256), [256, 344].into());
        assert_eq!(Picture::new(vec![0.0; 10], 2).size_at(24), [60, 24].into());
    }

    #[test]
    fn a_wide_picture_has_black_above_and_below() {
        let picture = Picture::new(vec![1.0; 8], 4);
        let expected: Vec<f64> =
            (0..16).map(|k| f64::from(u8::from((4..12).contains(&k)))).collect();
        assert_close(&picture.levels(4), &expected);
    }

    #[test]
    fn a_part_is_black_where_it_leaves_the_picture_and_says_how_much_of_it_does() {
        let picture = Picture::new(vec![0.0, 0.0, 0.0, 1.0, 1.0, 0.0], 3);
        assert_eq!(picture.square(), Some([0.0, 0.5, 2.0]));
        let [levels, covered] = picture.part([0.0, 0.5, 2.0], 2);
        assert_close(&levels, &[0.5, 0.5, 0.5, 0.5]);
        assert_close(&covered, &[1.0, 1.0, 0.5, 0.5]);
        let speckled = |k: usize| {
            let (x, y) = (k % 9, k / 9);
            f32::from(u8::from(x * y == 36 || (x > 1 && x < 5 && y < 5)))
        };
        let speckled = Picture::new((0..81).map(speckled).collect(), 9);
        assert_eq!(speckled.square(), Some([1.0, 0.0, 5.0]));
        assert_eq!(picture.clone().thresholded(2.0).square(), None);
        assert!(
            picture
                .clone()
                .thresholded(2.0)
                .view_square()
                .unwrap_err()
                .to_string()
                .contains("empty")
        );
        assert!(
            picture
                .clone()
                .thresholded(0.0)
                .view_square()
                .unwrap_err()
                .to_string()
                .contains("full")
        );
        assert_eq!(picture.view_square().unwrap(), [-0.5, 0.0, 3.0]);
        assert_eq!(picture.inverted().square(), Some([0.0, -0.5, 3.0]));
    }
}
