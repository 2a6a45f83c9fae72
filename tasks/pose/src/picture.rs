use image::{Rgb, RgbImage};

/// Colour of the target's outline in frames, and its transparency.
const OUTLINE: [f64; 3] = [255.0, 120.0, 0.0];
const SHINE: f64 = 0.35;

/// A square picture with the outline of a target silhouette `[size * size]` over it.
pub(crate) fn outlined(mut picture: RgbImage, target: &[f64]) -> RgbImage {
    let size = picture.width() as usize;
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        if is_outline(target, size, x as usize, y as usize) {
            let mixed = |k: usize| SHINE * f64::from(pixel.0[k]) + (1.0 - SHINE) * OUTLINE[k];
            *pixel = Rgb([0, 1, 2].map(|k| mixed(k).round() as u8));
        }
    }
    picture
}

/// Whether a pixel of the target has a neighbour outside it.
fn is_outline(target: &[f64], size: usize, x: usize, y: usize) -> bool {
    let covered = |x: usize, y: usize| x < size && y < size && target[y * size + x] > 0.5;
    let around = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
    covered(x, y) && around.into_iter().any(|(x, y)| !covered(x, y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outline_of_a_square_is_its_rim() {
        let inside = |k: usize| (1..4).contains(&(k % 5)) && (1..4).contains(&(k / 5));
        let target: Vec<f64> = (0..25).map(|k| f64::from(u8::from(inside(k)))).collect();
        let outline = (0..25).filter(|k| is_outline(&target, 5, k % 5, k / 5));
        assert_eq!(outline.collect::<Vec<_>>(), [6, 7, 8, 11, 13, 16, 17, 18]);
    }
}
