//! Reduction of pictures.

use softrast_raster::ImageSize;

/// A size of nearly the same aspect ratio with at most `most` pixels.
pub(super) fn within(size: ImageSize, most: usize) -> ImageSize {
    if size.pixels() <= most {
        return size;
    }
    let factor = (size.pixels() as f64 / most as f64).sqrt();
    let [width, height] = [size.width, size.height].map(|x| ((x as f64 / factor) as usize).max(1));
    // A line of pixels stays one.
    let width = width.min(most);
    [height.min(most / width), width].into()
}

/// Channels of the pixels of a picture, row by row: means over equal rectangles, `size` in number. `fill` returns a row of pixels.
///
/// Only one row of the picture and two of the result are in memory in addition to the result.
pub(super) fn means<P: Copy, const N: usize>(
    whole: ImageSize,
    size: ImageSize,
    fill: impl Fn(usize, &mut Vec<P>),
    of: impl Fn(P) -> [f32; N],
) -> [Vec<f32>; N] {
    let mut planes = [(); N].map(|()| Vec::with_capacity(size.pixels()));
    let mut row = Vec::with_capacity(whole.width);
    if size == whole {
        for y in 0..whole.height {
            fill(y, &mut row);
            for numbers in row.iter().map(|&pixel| of(pixel)) {
                planes.iter_mut().zip(numbers).for_each(|(plane, x)| plane.push(x));
            }
        }
        return planes;
    }
    let columns: Vec<Share> = (0..whole.width).map(|x| share(x, whole.width, size.width)).collect();
    let area = (whole.width * whole.height) as f64;
    // Sums of the current row of the result, and of the next.
    let empty = vec![[0.0; N]; size.width];
    let [mut sums, mut next] = [empty.clone(), empty.clone()];
    let mut line = empty.clone();
    for y in 0..whole.height {
        fill(y, &mut row);
        line.copy_from_slice(&empty);
        for (&pixel, &Share { cell, parts: [here, beyond] }) in row.iter().zip(&columns) {
            let numbers = of(pixel).map(f64::from);
            add(&mut line[cell], numbers, here);
            if beyond > 0.0 {
                add(&mut line[cell + 1], numbers, beyond);
            }
        }
        let Share { cell, parts } = share(y, whole.height, size.height);
        for (to, part) in [(&mut sums, parts[0]), (&mut next, parts[1])] {
            to.iter_mut().zip(&line).for_each(|(sum, &numbers)| add(sum, numbers, part));
        }
        // The last row of a cell.
        if share(y + 1, whole.height, size.height).cell > cell {
            for sum in &sums {
                planes.iter_mut().zip(sum).for_each(|(plane, x)| plane.push((x / area) as f32));
            }
            std::mem::swap(&mut sums, &mut next);
            next.copy_from_slice(&empty);
        }
    }
    planes
}

/// The first cell of a pixel, and the parts of the pixel in that cell and in the next.
#[derive(Clone, Copy)]
struct Share {
    cell: usize,
    parts: [f64; 2],
}

/// The share of pixel number `k` of `count` in a row of fewer `cells` of the same length. A whole pixel counts `cells`, a whole cell
/// `count`: integers, so that parts of a cell add up exactly.
fn share(k: usize, count: usize, cells: usize) -> Share {
    let (from, to) = (k * cells, (k + 1) * cells);
    let cell = from / count;
    let end = (cell + 1) * count;
    Share { cell, parts: [to.min(end) - from, to.saturating_sub(end)].map(|part| part as f64) }
}

fn add<const N: usize>(sums: &mut [f64; N], numbers: [f64; N], part: f64) {
    sums.iter_mut().zip(numbers).for_each(|(sum, x)| *sum += part * x);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The means of a single-channel picture.
    fn means_of(picture: &[f32], width: usize, size: [usize; 2]) -> Vec<f32> {
        let fill = |y: usize, row: &mut Vec<f32>| {
            row.clear();
            row.extend(&picture[y * width..(y + 1) * width]);
        };
        let whole = [picture.len() / width, width].into();
        let [plane] = means(whole, size.into(), fill, |level| [level]);
        plane
    }

    #[test]
    fn fewer_pixels_are_means_over_equal_rectangles() {
        let picture = [0.0, 30.0, 60.0, 60.0, 90.0, 120.0];
        // Columns 0 and half of 1; half of 1 and 2; both rows of each.
        assert_eq!(means_of(&picture, 3, [1, 2]), [40.0, 80.0]);
        assert_eq!(means_of(&picture, 3, [1, 1]), [60.0]);
        assert_eq!(means_of(&picture, 3, [2, 3]), picture);
    }

    #[test]
    fn what_is_white_all_over_stays_exactly_so() {
        for size in [[7, 31], [1, 1], [60, 96], [61, 1]] {
            assert_eq!(means_of(&[1.0; 97 * 61], 97, size), vec![1.0; size[0] * size[1]]);
        }
    }

    #[test]
    fn a_reduced_size_keeps_the_shape_and_the_bound() {
        assert_eq!(within([90, 120].into(), 10_800), [90, 120].into());
        assert_eq!(within([20_000, 20_000].into(), 1 << 22), [2048, 2048].into());
        assert_eq!(within([2000, 8000].into(), 1_000_000), [500, 2000].into());
        assert_eq!(within([65_535, 1].into(), 1000), [1000, 1].into());
        assert_eq!(within([1, 65_535].into(), 1000), [1, 1000].into());
    }
}
