use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use softrast_raster::ImageSize;

/// Resolution of the image that is optimised. Errors and pictures always use the full resolution.
///
/// ```
/// use softrast_inverse::Resolution;
///
/// let auto: Resolution = "auto".parse()?;
/// assert_eq!([0.1, 0.03].map(|width| auto.size(64, width).shorter()), [16, 64]);
/// let sizes = Resolution::sizes([24, 36]).map(|size| [size.height, size.width]);
/// assert_eq!(sizes.collect::<Vec<_>>(), [[24, 36], [12, 18], [6, 9]]);
/// assert!(Resolution::Side(16).check(64).is_ok() && Resolution::Side(20).check(64).is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Resolution {
    /// The full resolution.
    #[default]
    Full,
    /// The smallest that the softness allows, chosen anew at every step.
    Auto,
    /// This many pixels along the shorter side.
    Side(usize),
}

/// Fewest pixels along the shorter side of [`Resolution::Auto`]: below that, a step is not faster, because its time
/// is spent on the vertices.
const FEWEST: usize = 8;

impl Resolution {
    /// Size of the image for a `full` one, under a softness of this `width` in NDC.
    ///
    /// The automatic resolution is the full one halved while a pixel is at most two widths wide; the shorter side is 2 long. The
    /// error of the gradient from the grid is then below 0.2 % for a logistic, and 1.4 % for a Gauss curve.
    ///
    /// # Panics
    ///
    /// If a side is requested that [`Resolution::check`] refuses.
    pub fn size(self, full: impl Into<ImageSize>, width: f64) -> ImageSize {
        let full = full.into();
        let fewest = FEWEST.min(full.shorter());
        let enough =
            |size: &ImageSize| size.shorter() >= fewest && size.shorter() as f64 * width >= 1.0;
        let found = match self {
            Resolution::Full => Some(full),
            Resolution::Side(side) => Self::sizes(full).find(|size| size.shorter() == side),
            Resolution::Auto => Some(Self::sizes(full).take_while(enough).last().unwrap_or(full)),
        };
        found.unwrap_or_else(|| panic!("{full:?} is not halved to {self} pixels"))
    }

    /// The sizes that a target of size `full` can be averaged down to: `full`, halved repeatedly while
    /// height and width are even.
    pub fn sizes(full: impl Into<ImageSize>) -> impl Iterator<Item = ImageSize> {
        std::iter::successors(Some(full.into()), |size| {
            let ImageSize { height, width } = *size;
            let halves = height.is_multiple_of(2) && width.is_multiple_of(2) && height * width > 0;
            halves.then(|| [height / 2, width / 2].into())
        })
    }

    /// Refuses a side that is not the shorter one of any of [`Resolution::sizes`].
    ///
    /// # Errors
    ///
    /// A message that lists them.
    pub fn check(self, full: impl Into<ImageSize>) -> Result<(), String> {
        let full = full.into();
        let mut sides = Self::sizes(full).map(ImageSize::shorter);
        match self {
            Resolution::Side(side) if !sides.any(|known| known == side) => {
                let sides = Self::sizes(full).map(|size| size.shorter().to_string());
                Err(format!(
                    "--resolution {side} is not what halving leaves of an image of {full} pixels, while both sides are even: expected full, \
                     auto or one of {}",
                    sides.collect::<Vec<_>>().join(", ")
                ))
            }
            _ => Ok(()),
        }
    }
}

impl fmt::Display for Resolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Resolution::Full => f.write_str("full"),
            Resolution::Auto => f.write_str("auto"),
            Resolution::Side(side) => side.fmt(f),
        }
    }
}

impl FromStr for Resolution {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |side: &usize| (1..=4096).contains(side);
        match text {
            "full" => Ok(Resolution::Full),
            "auto" => Ok(Resolution::Auto),
            number => match number.parse().ok().filter(side) {
                Some(side) => Ok(Resolution::Side(side)),
                None => Err("expected full, auto or a whole number of pixels".into()),
            },
        }
    }
}

impl From<Resolution> for String {
    fn from(resolution: Resolution) -> Self {
        resolution.to_string()
    }
}

impl TryFrom<String> for Resolution {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn side(size: usize, width: f64) -> usize {
        Resolution::Auto.size(size, width).shorter()
    }

    #[test]
    fn pixels_are_at_most_two_widths_wide_and_no_fewer_than_needed() {
        let expected = [(1.0, 8), (0.1, 16), (1.0 / 16.0, 16), (0.06, 32), (0.03, 64), (0.002, 64)];
        for (width, expected) in expected {
            assert_eq!(side(64, width), expected, "{width}");
        }
        assert_eq!(side(4, 1.0), 4);
        // 50 is halved once.
        assert_eq!(side(50, 0.5), 25);
    }

    #[test]
    fn an_image_never_shrinks_while_the_softness_narrows() {
        for size in [1, 7, 24, 64, 100, 256] {
            let widths = (0..200).map(|k| 2.0 * 0.95f64.powi(k));
            let sides: Vec<_> = widths.map(|width| side(size, width)).collect();
            assert!(sides.is_sorted() && sides.last() == Some(&size), "{size}: {sides:?}");
        }
    }

    #[test]
    fn both_sides_are_halved_or_neither_is() {
        assert_eq!(Resolution::Auto.size([48, 64], 0.1), [12, 16].into());
        assert_eq!(Resolution::Auto.size([48, 65], 0.1), [48, 65].into());
        assert_eq!(Resolution::Side(24).size([48, 64], 0.1), [24, 32].into());
        assert!(Resolution::Side(24).check([48, 65]).is_err());
    }

    #[test]
    fn only_what_halving_leaves_is_taken_and_read_as_it_is_written() {
        for good in [Resolution::Full, Resolution::Auto, Resolution::Side(16), Resolution::Side(1)]
        {
            assert!(good.check(64).is_ok(), "{good}");
            assert_eq!(good.to_string().parse(), Ok(good));
        }
        for wrong in [20, 65, 128] {
            let message = Resolution::Side(wrong).check(64).unwrap_err();
            assert!(message.contains("64, 32, 16, 8, 4, 2, 1"), "{message}");
        }
        assert!("0".parse::<Resolution>().is_err() && "half".parse::<Resolution>().is_err());
    }
}
