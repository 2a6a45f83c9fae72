use softrast_raster::ImageSize;

use crate::Picture;

/// The sides of a picture that its mask touches, of `left`, `top`, `right` and `bottom`: the object may extend beyond them. Specks are
/// ignored.
///
/// ```
/// use softrast_views::{Picture, cut_sides};
///
/// let mask = Picture::new([[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 1.0], [0.0; 4], [0.0; 4]].concat(), 4);
/// assert_eq!(cut_sides(&mask), ["top", "right"]);
/// ```
pub fn cut_sides(mask: &Picture) -> Vec<&'static str> {
    let ImageSize { width, height } = mask.size();
    let mask = mask.despeckled();
    let white = |x: usize, y: usize| mask.pixels()[y * width + x] >= 0.5;
    let column = |x: usize| (0..height).any(|y| white(x, y));
    let row = |y: usize| (0..width).any(|x| white(x, y));
    let reached = [column(0), row(0), column(width - 1), row(height - 1)];
    let sides = ["left", "top", "right", "bottom"].into_iter().zip(reached);
    sides.filter_map(|(side, reached)| reached.then_some(side)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specks_at_a_border_are_no_cut() {
        let disc = |x: usize, y: usize| x.abs_diff(10).pow(2) + y.abs_diff(10).pow(2) < 30;
        let with = |more: &dyn Fn(usize, usize) -> bool| {
            let level =
                |k: usize| f32::from(u8::from(disc(k % 20, k / 20) || more(k % 20, k / 20)));
            Picture::new((0..400).map(level).collect(), 20)
        };
        assert!(cut_sides(&with(&|_, _| false)).is_empty());
        assert!(cut_sides(&with(&|x, y| x == 0 && y == 5)).is_empty());
        assert_eq!(cut_sides(&with(&|x, y| y > 15 && x.abs_diff(10) < 4)), ["bottom"]);
    }
}
