use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

/// Resolution of the image that is optimised. Errors and pictures always use the full resolution.
///
/// ```
/// use softrast_inverse::Resolution;
///
/// let auto: Resolution = "auto".parse()?;
/// assert_eq!([0.1, 0.03].map(|width| auto.side(64, width)), [16, 64]);
/// assert_eq!(Resolution::sides(24).collect::<Vec<_>>(), [24, 12, 6, 3]);
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
    /// This many pixels a side.
    Side(usize),
}

/// Fewest pixels a side of [`Resolution::Auto`]: below that, a step is not faster, because its time
/// is spent on the vertices.
const FEWEST: usize = 8;

impl Resolution {
    /// Pixels a side for a full image of `size`, under a softness of this `width` in NDC.
    ///
    /// The automatic resolution is `size` halved while a pixel is at most two widths wide; the image is 2 wide. The
    /// error of the gradient from the grid is then below 0.2 % for a logistic, and 1.4 % for a Gauss curve.
    pub fn side(self, size: usize, width: f64) -> usize {
        let enough = |side: &usize| *side >= FEWEST.min(size) && *side as f64 * width >= 1.0;
        match self {
            Resolution::Full => size,
            Resolution::Side(side) => side,
            Resolution::Auto => Self::sides(size).take_while(enough).last().unwrap_or(size),
        }
    }

    /// The sizes that a target of `size` can be averaged down to: `size`, halved repeatedly while
    /// it is even.
    pub fn sides(size: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(size), |side| side.is_multiple_of(2).then_some(side / 2))
    }

    /// Refuses a size that is not one of [`Resolution::sides`].
    ///
    /// # Errors
    ///
    /// A message that lists them.
    pub fn check(self, size: usize) -> Result<(), String> {
        match self {
            Resolution::Side(side) if !Self::sides(size).any(|known| known == side) => {
                let known: Vec<_> = Self::sides(size).map(|side| side.to_string()).collect();
                Err(format!(
                    "--resolution {side} is not what is left of --size {size} by halving: expected full, auto or one of {}",
                    known.join(", ")
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

    #[test]
    fn pixels_are_at_most_two_widths_wide_and_no_fewer_than_needed() {
        let expected = [(1.0, 8), (0.1, 16), (1.0 / 16.0, 16), (0.06, 32), (0.03, 64), (0.002, 64)];
        for (width, side) in expected {
            assert_eq!(Resolution::Auto.side(64, width), side, "{width}");
        }
        assert_eq!(Resolution::Auto.side(4, 1.0), 4);
        // 50 is halved once.
        assert_eq!(Resolution::Auto.side(50, 0.5), 25);
    }

    #[test]
    fn an_image_never_shrinks_while_the_softness_narrows() {
        for size in [1, 7, 24, 64, 100, 256] {
            let widths = (0..200).map(|k| 2.0 * 0.95f64.powi(k));
            let sides: Vec<_> = widths.map(|width| Resolution::Auto.side(size, width)).collect();
            assert!(sides.is_sorted() && sides.last() == Some(&size), "{size}: {sides:?}");
        }
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
