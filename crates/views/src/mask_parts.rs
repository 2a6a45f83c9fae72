use softrast_raster::ImageSize;

use crate::Picture;

/// Components that are smaller than the largest by this factor are specks or details.
const SMALL: usize = 5;

/// Number of components of a mask (pixels that share sides) at least a fifth as large as the largest. 0 if no pixel is white.
///
/// ```
/// use softrast_views::{Picture, mask_parts};
///
/// let mask = Picture::new([[1.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]].concat(), 4);
/// assert_eq!(mask_parts(&mask), 2);
/// ```
pub fn mask_parts(mask: &Picture) -> usize {
    let ImageSize { width, height } = mask.size();
    let mut left: Vec<bool> = mask.pixels().iter().map(|&level| level >= 0.5).collect();
    let mut areas = Vec::new();
    let mut reached = Vec::new();
    for first in 0..left.len() {
        if !std::mem::take(&mut left[first]) {
            continue;
        }
        let mut area = 0;
        reached.push(first);
        while let Some(pixel) = reached.pop() {
            area += 1;
            let (x, y) = (pixel % width, pixel / width);
            let beside = [
                (x > 0).then(|| pixel - 1),
                (x + 1 < width).then_some(pixel + 1),
                (y > 0).then(|| pixel - width),
                (y + 1 < height).then_some(pixel + width),
            ];
            for next in beside.into_iter().flatten() {
                if std::mem::take(&mut left[next]) {
                    reached.push(next);
                }
            }
        }
        areas.push(area);
    }
    let largest = areas.iter().copied().max().unwrap_or(0);
    areas.iter().filter(|&&area| SMALL * area >= largest).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specks_are_no_parts_and_corners_do_not_join() {
        let mask = |white: &dyn Fn(usize, usize) -> bool| {
            let levels = (0..400).map(|k| f32::from(u8::from(white(k % 20, k / 20))));
            mask_parts(&Picture::new(levels.collect(), 20))
        };
        assert_eq!(mask(&|_, _| false), 0);
        assert_eq!(mask(&|_, _| true), 1);
        assert_eq!(mask(&|x, _| x != 10), 2);
        assert_eq!(mask(&|x, y| x < 10 || (x, y) == (15, 5)), 1, "a speck is none");
        assert_eq!(mask(&|x, y| (x < 10) == (y < 10)), 2, "two squares that share a corner");
        assert_eq!(mask(&|x, y| x % 2 == 0 || y == 19), 1, "a comb");
    }
}
