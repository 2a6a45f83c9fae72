//! Vertex colours in files: from 0 to 1, but often not.
//!
//! A mesh is useful without its colours, so nothing here is an error: colours are used, clamped, scaled or omitted, and one warning
//! describes the change.

use crate::{
    Fault,
    error::{Place, Trouble},
};

/// Channels this far beyond 0 and 1 count as rounding errors: less than one level of an 8-bit picture, with 1/255 included.
const ROUNDING: f64 = 0.004;
/// Value of 1 in files whose floats are levels of 8-bit pictures.
const LEVELS: f64 = 255.0;
/// A channel above this is a level, even if not all channels are integers.
const SURELY_A_LEVEL: f64 = 16.0;

/// Treatment of colours that are neither in [0, 1] nor rounding errors nor levels.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Beyond {
    LeftOut,
    /// As required by glTF.
    Clamped,
}

/// The colours read so far, relative to the value that stands for 1.
pub(crate) struct Colours {
    full: [f64; 3],
    beyond: Beyond,
    shares: Vec<[f64; 3]>,
    /// Place and value of the first channel out of range.
    first: Option<(Place, f64, f64)>,
    lowest: f64,
    highest: f64,
    are_whole: bool,
    are_finite: bool,
}

impl Colours {
    /// No colours yet; `full` stands for 1 in each channel.
    pub(crate) fn new(full: [f64; 3], beyond: Beyond) -> Self {
        Self {
            full,
            beyond,
            shares: Vec::new(),
            first: None,
            lowest: 0.0,
            highest: 0.0,
            are_whole: true,
            are_finite: true,
        }
    }

    /// Adds the colour of the next vertex, at `place` in the file; NaN stands for a word that is not a number.
    pub(crate) fn push(&mut self, channels: [f64; 3], place: impl FnOnce() -> Place) {
        let share = [0, 1, 2].map(|k| channels[k] / self.full[k]);
        if self.first.is_none()
            && let Some(k) = (0..3).find(|&k| !(0.0..=1.0).contains(&share[k]))
        {
            self.first = Some((place(), channels[k], self.full[k]));
        }
        for x in share {
            self.lowest = self.lowest.min(x);
            self.highest = self.highest.max(x);
            self.are_whole &= x.fract() == 0.0;
            self.are_finite &= x.is_finite();
        }
        self.shares.push(share);
    }

    pub(crate) fn len(&self) -> usize {
        self.shares.len()
    }

    /// The colours, all from 0 to 1, unless they are omitted; and a warning if they differ from those of the file.
    pub(crate) fn settled(mut self) -> (Option<Vec<[f64; 3]>>, Option<Trouble>) {
        let Some((place, value, full)) = self.first else { return (Some(self.shares), None) };
        let are_roundings = self.lowest >= -ROUNDING && self.highest <= 1.0 + ROUNDING;
        let are_levels = self.full == [1.0; 3]
            && self.lowest >= 0.0
            && self.highest <= LEVELS
            && (self.are_whole || self.highest > SURELY_A_LEVEL);
        let (scale, outcome) = if !self.are_finite {
            (None, "the colours are left out")
        } else if are_roundings {
            (Some(1.0), "it is clamped, and so are others")
        } else if are_levels {
            (Some(1.0 / LEVELS), "all colours are taken as levels from 0 to 255")
        } else if self.beyond == Beyond::Clamped {
            (Some(1.0), "it is clamped, and so are others")
        } else {
            (None, "the colours are left out")
        };
        let reason = format!("colour {value} is not from 0 to {full}: {outcome}");
        let warning = Some(place.trouble(Fault::format(reason)));
        let Some(scale) = scale else { return (None, warning) };
        for x in self.shares.as_flattened_mut() {
            *x = (*x * scale).clamp(0.0, 1.0);
        }
        (Some(self.shares), warning)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first channel of each vertex, and the warning; the other channels are 0.
    fn settled(reds: &[f64], full: f64, beyond: Beyond) -> (Option<Vec<f64>>, Option<String>) {
        let mut colours = Colours::new([full; 3], beyond);
        for (line, &red) in (1..).zip(reds) {
            colours.push([red, 0.0, 0.0], || Place::Line(line));
        }
        let (colours, warning) = colours.settled();
        let reds = colours.map(|colours| colours.iter().map(|colour| colour[0]).collect());
        (reds, warning.map(|trouble| trouble.of_file("a").to_string()))
    }

    #[test]
    fn shares_are_taken_as_they_are() {
        assert_eq!(
            settled(&[0.0, 0.5, 1.0], 1.0, Beyond::LeftOut),
            (Some(vec![0.0, 0.5, 1.0]), None)
        );
        assert_eq!(settled(&[0.0, 51.0], 255.0, Beyond::LeftOut), (Some(vec![0.0, 0.2]), None));
    }

    #[test]
    fn roundings_are_clamped() {
        let (reds, warning) = settled(&[0.5, 1.000_000_1, -1e-7], 1.0, Beyond::LeftOut);
        assert_eq!(reds, Some(vec![0.5, 1.0, 0.0]));
        let expected = "a:2: colour 1.0000001 is not from 0 to 1: it is clamped, and so are others";
        assert_eq!(warning.as_deref(), Some(expected));
        assert_eq!(settled(&[256.0], 255.0, Beyond::LeftOut).0, Some(vec![1.0]));
    }

    #[test]
    fn levels_are_scaled() {
        for levels in [[0.0, 255.0, 51.0], [0.0, 254.5, 51.0]] {
            let (reds, warning) = settled(&levels, 1.0, Beyond::LeftOut);
            assert_eq!(reds, Some(levels.map(|x| x * (1.0 / 255.0)).to_vec()));
            assert!(warning.unwrap().ends_with("all colours are taken as levels from 0 to 255"));
        }
        assert_eq!(settled(&[0.0, 2.0], 1.0, Beyond::Clamped).0, Some(vec![0.0, 2.0 / 255.0]));
    }

    #[test]
    fn others_are_left_out_or_clamped() {
        for wrong in [f64::NAN, f64::INFINITY, -1.0, 1.5, 256.0, 65535.0] {
            let (reds, warning) = settled(&[0.5, wrong], 1.0, Beyond::LeftOut);
            assert_eq!(reds, None);
            let expected =
                format!("a:2: colour {wrong} is not from 0 to 1: the colours are left out");
            assert_eq!(warning, Some(expected));
        }
        assert_eq!(settled(&[510.0], 255.0, Beyond::LeftOut).0, None, "not twice scaled");
        assert_eq!(settled(&[9.5, -1.0], 1.0, Beyond::Clamped).0, Some(vec![1.0, 0.0]));
        assert_eq!(settled(&[f64::NAN], 1.0, Beyond::Clamped).0, None);
    }
}
