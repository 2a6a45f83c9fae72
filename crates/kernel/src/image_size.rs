use std::fmt::{self, Display, Formatter};

/// Height and width of an image in pixels.
///
/// NDC have the same scale along both axes: the shorter side of the image is [-1, 1], the longer one extends farther, with its middle at 0.
/// One pixel is `2 / shorter` wide and high.
///
/// A number converts to a square image, `[height, width]` to any other; shown as "width x height".
///
/// ```
/// use softrast_kernel::ImageSize;
///
/// let size: ImageSize = [2, 4].into();
/// assert_eq!((size.shorter(), size.pixels(), size.to_string()), (2, 8, "4 x 2".to_owned()));
/// // A pixel is 1 NDC wide; the first row is at the top.
/// assert_eq!((size.column_centre(0), size.row_centre(0)), (-1.5, 0.5));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
}

impl ImageSize {
    /// The lesser of height and width.
    pub fn shorter(self) -> usize {
        self.height.min(self.width)
    }

    /// Number of pixels.
    pub fn pixels(self) -> usize {
        self.height * self.width
    }

    /// Centre of a column in NDC.
    #[inline]
    pub fn column_centre(self, column: usize) -> f64 {
        (2.0 * column as f64 + 1.0 - self.width as f64) / self.shorter() as f64
    }

    /// Centre of a row in NDC; the first is at the top.
    #[inline]
    pub fn row_centre(self, row: usize) -> f64 {
        (self.height as f64 - 1.0 - 2.0 * row as f64) / self.shorter() as f64
    }
}

impl Display for ImageSize {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {}", self.width, self.height)
    }
}

impl From<usize> for ImageSize {
    fn from(side: usize) -> Self {
        Self { height: side, width: side }
    }
}

impl From<[usize; 2]> for ImageSize {
    fn from([height, width]: [usize; 2]) -> Self {
        Self { height, width }
    }
}
