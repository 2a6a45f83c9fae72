mod part;
mod read;

use std::sync::Arc;

use softrast_raster::{ImageSize, Pinhole};

use crate::Distortion;

/// A gray picture of any size: a target for silhouettes. Copies share their pixels.
///
/// A picture file of more than 4,194,304 pixels, such as 2048 × 2048, is reduced to that many or slightly fewer when it is read.
/// [`Picture::size`] is then the reduced size, [`Picture::whole_size`] that of the file.
///
/// ```
/// use softrast_views::Picture;
///
/// let picture = Picture::new(vec![0.0, 0.25, 0.75, 1.0], 2);
/// assert_eq!(picture.size(), [2, 2].into());
/// assert_eq!(picture.clone().inverted().pixels(), [1.0, 0.75, 0.25, 0.0]);
/// assert_eq!(picture.thresholded(0.5).pixels(), [0.0, 0.0, 1.0, 1.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// From 0 to 1, row by row from the top.
    levels: Arc<[f32]>,
    width: usize,
    /// Size of the picture in the file, before it was reduced.
    whole: ImageSize,
    /// The level of the file that became white, if it was the only one above 0.
    only_level: Option<f32>,
}

impl Picture {
    /// A picture of these levels from 0 to 1, row by row from the top.
    ///
    /// # Panics
    ///
    /// If there are no levels, or their number is not a multiple of the width.
    pub fn new(levels: Vec<f32>, width: usize) -> Self {
        let count = levels.len();
        assert!(
            count > 0 && width > 0 && count.is_multiple_of(width),
            "{count} levels, {width} a row"
        );
        let whole = [count / width, width].into();
        Self { levels: levels.into(), width, whole, only_level: None }
    }

    /// Height and width in pixels.
    pub fn size(&self) -> ImageSize {
        [self.levels.len() / self.width, self.width].into()
    }

    /// Height and width of the picture in its file, after the rotation that the file declares: the size for a camera of the picture.
    pub fn whole_size(&self) -> ImageSize {
        self.whole
    }

    /// The level from 0 to 1 that stood for white in the file of a mask, if it was the only one above 0 and less than 1.
    pub fn only_level(&self) -> Option<f64> {
        self.only_level.map(f64::from)
    }

    /// Converts a camera of the picture in the file to one of these pixels.
    pub fn camera(&self, of_whole: &Pinhole) -> Pinhole {
        resized(of_whole, self.whole, self.size())
    }

    /// Converts a camera of these pixels to one of the picture in the file.
    pub fn whole_camera(&self, camera: &Pinhole) -> Pinhole {
        resized(camera, self.size(), self.whole)
    }

    /// All pixels, row by row from the top.
    pub fn pixels(&self) -> &[f32] {
        &self.levels
    }

    /// The picture without lens distortion: `camera` is that of these pixels, except its lens. Outside the border is repeated.
    ///
    /// # Panics
    ///
    /// If the camera is for pictures of another size.
    #[must_use]
    pub fn undistorted(&self, camera: &Pinhole, distortion: &Distortion) -> Self {
        assert_eq!(camera.size, self.size(), "the size of the camera's pictures");
        let levels = distortion.sources(camera).map(|place| self.between(place));
        Self { levels: levels.collect(), ..self.clone() }
    }

    /// The level at a position in pixels from the corner of the first: bilinear between pixel centres, constant beyond the outermost.
    fn between(&self, place: [f64; 2]) -> f32 {
        let (width, height) = (self.width, self.levels.len() / self.width);
        let along = |x: f64, count: usize| {
            let x = (x - 0.5).max(0.0).min((count - 1) as f64);
            let first = (x as usize).min(count - 1);
            (first, (first + 1).min(count - 1), (x - first as f64) as f32)
        };
        let ((left, right, across), (top, bottom, down)) =
            (along(place[0], width), along(place[1], height));
        let row = |y: usize| {
            let [a, b] = [left, right].map(|x| self.levels[y * width + x]);
            a + across * (b - a)
        };
        let (above, below) = (row(top), row(bottom));
        above + down * (below - above)
    }

    /// Exchanges black and white.
    #[must_use]
    pub fn inverted(self) -> Self {
        Self { levels: self.levels.iter().map(|level| 1.0 - level).collect(), ..self }
    }

    /// White from this level on, black below.
    #[must_use]
    pub fn thresholded(self, level: f64) -> Self {
        let levels =
            self.levels.iter().map(|&x| f32::from(u8::from(f64::from(x) >= level))).collect();
        Self { levels, ..self }
    }

    /// Removes specks: a pixel that is white or black among a majority of others becomes like them.
    #[must_use]
    pub fn despeckled(&self) -> Self {
        let (width, height) = (self.width, self.levels.len() / self.width);
        let mut levels = self.levels.to_vec();
        for (y, levels) in levels.chunks_exact_mut(width).enumerate() {
            let rows = &self.levels[y.saturating_sub(1) * width..(y + 2).min(height) * width];
            for (x, level) in levels.iter_mut().enumerate() {
                let around = x.saturating_sub(1)..(x + 2).min(width);
                let (mut sum, mut count) = (0.0, 0.0);
                for row in rows.chunks_exact(width) {
                    for &level in &row[around.clone()] {
                        sum += level;
                        count += 1.0;
                    }
                }
                let most = sum >= 0.5 * count;
                if (*level >= 0.5) != most {
                    *level = f32::from(u8::from(most));
                }
            }
        }
        Self { levels: levels.into(), ..self.clone() }
    }
}

/// The camera of a picture that is scaled.
fn resized(camera: &Pinhole, from: ImageSize, to: ImageSize) -> Pinhole {
    camera.cropped([0.0; 2], [from.width as f64, from.height as f64], to)
}
