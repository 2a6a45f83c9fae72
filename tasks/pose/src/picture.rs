//! What a run looks like.

use image::{Rgb, RgbImage};
use softrast_runner::{Pictures, difference, rgb_from_gray};

/// Colour of the target's outline in frames, and how much of the frame shows through.
const OUTLINE: [f64; 3] = [255.0, 120.0, 0.0];
const SHINE: f64 = 0.35;

/// Collects the pictures of one view while it is solved.
#[derive(Clone)]
pub(crate) struct Album {
    target: Vec<f64>,
    start: Vec<f64>,
    result: Vec<f64>,
    frames: Vec<RgbImage>,
    size: usize,
    /// Least hard loss so far.
    least: f64,
}

impl Album {
    /// An empty album of an instance whose hard target is `target` `[size * size]`.
    pub(crate) fn new(target: Vec<f64>, size: usize) -> Self {
        let (start, result) = (Vec::new(), Vec::new());
        Self { target, start, result, frames: Vec::new(), size, least: f64::INFINITY }
    }

    /// Takes the soft silhouette `image` `[size * size]` after a step, as the result if no step before
    /// had a lower loss `hard` of the hard one, and as a frame of the animation if so asked.
    pub(crate) fn take(&mut self, image: &[f64], hard: f64, frame: bool) {
        if self.start.is_empty() {
            self.start = image.to_vec();
        }
        if hard <= self.least || self.result.is_empty() {
            (self.result, self.least) = (image.to_vec(), hard);
        }
        if frame {
            self.frames.push(self.outlined(image));
        }
    }

    /// The pictures; each silhouette is white on black.
    pub(crate) fn pictures(self) -> Pictures {
        let gray = |values: &[f64]| rgb_from_gray(values, self.size, self.size);
        let [target, start, result] = [&self.target, &self.start, &self.result].map(|v| gray(v));
        let difference = difference(&target, &result);
        Pictures { target, start, result, difference, frames: self.frames }
    }

    /// A silhouette with the target's outline over it.
    fn outlined(&self, image: &[f64]) -> RgbImage {
        let mut picture = rgb_from_gray(image, self.size, self.size);
        for (x, y, pixel) in picture.enumerate_pixels_mut() {
            if self.is_outline(x as usize, y as usize) {
                let mixed = |k: usize| SHINE * f64::from(pixel.0[k]) + (1.0 - SHINE) * OUTLINE[k];
                *pixel = Rgb([0, 1, 2].map(|k| mixed(k).round() as u8));
            }
        }
        picture
    }

    /// Whether a pixel of the target has a neighbour that is none.
    fn is_outline(&self, x: usize, y: usize) -> bool {
        let size = self.size;
        let covered = |x: usize, y: usize| x < size && y < size && self.target[y * size + x] > 0.5;
        let around = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
        covered(x, y) && around.into_iter().any(|(x, y)| !covered(x, y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outline_of_a_square_is_its_rim() {
        let inside = |k: usize| (1..4).contains(&(k % 5)) && (1..4).contains(&(k / 5));
        let target: Vec<f64> = (0..25).map(|k| f64::from(u8::from(inside(k)))).collect();
        let album = Album::new(target, 5);
        let outline = (0..25).filter(|k| album.is_outline(k % 5, k / 5));
        assert_eq!(outline.collect::<Vec<_>>(), [6, 7, 8, 11, 13, 16, 17, 18]);
    }
}
