use softrast_softness::Softness;

use crate::ImageSize;

/// Width of the soft edge of a face: by default the scale of the softness, in NDC (x right, y up; the shorter side of the image is 2), or
/// in NDC² for a squared distance.
///
/// ```
/// use softrast_raster::{SoftRenderer, Width};
/// use softrast_softness::Family;
///
/// let faces = [[0, 1, 2]];
/// let wide = SoftRenderer::new(&faces, 64, Family::Logistic, Width::pixels(3.0));
/// assert_eq!(wide.phi(), SoftRenderer::new(&faces, 64, Family::Logistic, 3.0 / 32.0).phi());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Width {
    /// The scale of the softness.
    Scale(f64),
    /// Pixels: the scale, or for a squared softness the square root of the scale.
    Pixels(f64),
}

impl Width {
    /// A width of this many pixels, whatever the size of the image.
    pub fn pixels(width: f64) -> Self {
        Self::Pixels(width)
    }

    /// A schedule from this width to `end`, in the same unit, geometric in the progress.
    ///
    /// ```
    /// use softrast_raster::{Width, WidthSchedule};
    ///
    /// let narrowing: WidthSchedule = Width::pixels(4.0).to(1.0);
    /// assert_eq!(narrowing.at(0.5), Width::pixels(2.0));
    /// ```
    #[must_use]
    pub fn to(self, end: f64) -> WidthSchedule {
        WidthSchedule { start: self, end }
    }

    /// Parameters of a softness with this width on images of `size`.
    pub(crate) fn phi(self, softness: &impl Softness, size: ImageSize) -> Vec<f64> {
        let scale = match self {
            Self::Scale(scale) => scale,
            Self::Pixels(pixels) => {
                assert!(pixels > 0.0 && pixels.is_finite(), "a width of {pixels} pixels");
                let width = pixels * 2.0 / size.shorter() as f64;
                if softness.scale_is_squared() { width * width } else { width }
            }
        };
        softness.default_phi(scale)
    }
}

/// The scale of a softness.
impl From<f64> for Width {
    fn from(scale: f64) -> Self {
        Self::Scale(scale)
    }
}

/// A schedule of the width over a run; see [`Width::to`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WidthSchedule {
    start: Width,
    end: f64,
}

impl WidthSchedule {
    /// The width at this progress of the run.
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1], or a width is not positive.
    pub fn at(self, progress: f64) -> Width {
        assert!((0.0..=1.0).contains(&progress), "a progress of {progress} is not in [0, 1]");
        let between = |start: f64| {
            assert!(
                start > 0.0 && self.end > 0.0,
                "widths from {start} to {} are not positive",
                self.end
            );
            start * (self.end / start).powf(progress)
        };
        match self.start {
            Width::Scale(start) => Width::Scale(between(start)),
            Width::Pixels(start) => Width::Pixels(between(start)),
        }
    }
}
