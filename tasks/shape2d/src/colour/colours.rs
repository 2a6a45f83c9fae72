use softrast_raster::ImageSize;

/// A colour picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Colours {
    /// Red, green and blue from 0 to 1, row by row from the top.
    pixels: Vec<[f64; 3]>,
    size: ImageSize,
}

impl Colours {
    /// A picture from its pixels, row by row from the top.
    ///
    /// # Panics
    ///
    /// If their number is not that of the size, or there are none.
    pub fn new(pixels: Vec<[f64; 3]>, size: impl Into<ImageSize>) -> Self {
        let size = size.into();
        let fits = !pixels.is_empty() && pixels.len() == size.pixels();
        assert!(fits, "{} pixels of {size:?}", pixels.len());
        Self { pixels, size }
    }

    /// Height and width in pixels.
    pub fn size(&self) -> ImageSize {
        self.size
    }

    /// All of red, then green, then blue: `[3 * height * width]`.
    pub fn planes(&self) -> Vec<f64> {
        (0..3).flat_map(|k| self.pixels.iter().map(move |pixel| pixel[k])).collect()
    }

    /// The mean of all pixels.
    pub fn mean(&self) -> [f64; 3] {
        let mean = |k: usize| self.pixels.iter().map(|pixel| pixel[k]).sum::<f64>();
        [0, 1, 2].map(|k| mean(k) / self.pixels.len() as f64)
    }

    /// The colour at a place in NDC; outside the picture, that of the nearest pixel.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 3] {
        let index = |place: f64, count: usize| {
            let pixel = 0.5 * (place * self.size.shorter() as f64 + count as f64);
            pixel.clamp(0.0, count as f64 - 0.5) as usize
        };
        let ImageSize { height, width } = self.size;
        self.pixels[index(-y, height) * width + index(x, width)]
    }

    /// Calls `visit` with the colour of each pixel whose centre is in a triangle in NDC.
    pub fn inside(&self, corners: &[[f64; 2]; 3], mut visit: impl FnMut([f64; 3])) {
        let size = self.size;
        let range = |axis: usize, sign: f64, count: usize| {
            let (shorter, count) = (size.shorter() as f64, count as f64);
            let places = corners.map(|corner| 0.5 * (sign * corner[axis] * shorter + count));
            let low = places.into_iter().fold(count, f64::min).max(0.0).floor();
            let high = places.into_iter().fold(0.0, f64::max).min(count).ceil();
            low as usize..high as usize
        };
        let edge = |k: usize, [x, y]: [f64; 2]| {
            let ([ax, ay], [bx, by]) = (corners[k], corners[(k + 1) % 3]);
            (bx - ax) * (y - ay) - (by - ay) * (x - ax)
        };
        let turn = edge(0, corners[2]).signum();
        for row in range(1, -1.0, size.height) {
            for column in range(0, 1.0, size.width) {
                let place = [size.column_centre(column), size.row_centre(row)];
                if (0..3).all(|k| turn * edge(k, place) >= 0.0) {
                    visit(self.pixels[row * size.width + column]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered() -> Colours {
        Colours::new((0..16).map(|k| [k as f64, 0.0, 1.0]).collect(), 4)
    }

    fn inside(corners: [[f64; 2]; 3]) -> Vec<f64> {
        let mut seen = Vec::new();
        numbered().inside(&corners, |colour| seen.push(colour[0]));
        seen
    }

    #[test]
    fn a_place_has_the_colour_of_its_pixel_and_the_nearest_one_outside() {
        let places = [[-0.9, 0.9], [0.9, 0.9], [0.1, -0.1], [-7.0, -7.0], [f64::MAX, 1.0]];
        assert_eq!(places.map(|place| numbered().at(place)[0]), [0.0, 3.0, 10.0, 12.0, 3.0]);
    }

    #[test]
    fn pixels_are_inside_by_their_centres_whichever_way_corners_turn() {
        let corners = [[-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0]];
        let all = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 9.0, 12.0];
        assert_eq!(inside(corners), all);
        let [a, b, c] = corners;
        assert_eq!(inside([c, b, a]), all);
        assert_eq!(inside([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]]), [0.0; 0]);
        assert_eq!(inside([[2.0, 2.0], [9.0, 2.0], [2.0, 9.0]]), [0.0; 0]);
        assert_eq!(inside([[-9.0, -9.0], [9.0, -9.0], [0.0, 99.0]]).len(), 16);
    }

    #[test]
    fn a_wide_picture_reaches_beyond_one() {
        let wide = Colours::new((0..8).map(|k| [k as f64, 0.0, 1.0]).collect(), [2, 4]);
        let places = [[-1.9, 0.5], [1.9, 0.5], [0.5, -0.5], [9.0, -9.0]];
        assert_eq!(places.map(|place| wide.at(place)[0]), [0.0, 3.0, 6.0, 7.0]);
        let mut seen = Vec::new();
        wide.inside(&[[1.0, 1.0], [3.0, 1.0], [1.0, -3.0]], |colour| seen.push(colour[0]));
        assert_eq!(seen, [3.0, 7.0]);
    }

    #[test]
    fn planes_and_mean_have_the_channels_apart() {
        let colours = Colours::new(vec![[0.0, 0.5, 1.0], [1.0, 0.5, 0.0], [0.0; 3], [1.0; 3]], 2);
        assert_eq!(colours.planes()[..5], [0.0, 1.0, 0.0, 1.0, 0.5]);
        assert_eq!(colours.mean(), [0.5; 3]);
    }
}
