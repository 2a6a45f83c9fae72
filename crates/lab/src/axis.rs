use std::ops::Range;

use plotters::coord::{
    ranged1d::{DefaultFormatting, KeyPointHint, Ranged},
    types::RangedCoordf64,
};

/// Larger values are not drawn on a linear axis: ranges around them would not be finite.
const LARGEST: f64 = 1e300;

/// Name with unit, and whether the axis is logarithmic.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Name with unit.
    pub name: String,
    /// Whether the axis is logarithmic; values must then be positive, others are omitted.
    pub logarithmic: bool,
}

impl Axis {
    /// A linear axis.
    pub fn linear(name: &str) -> Self {
        Self { name: name.to_owned(), logarithmic: false }
    }

    /// A logarithmic axis.
    pub fn logarithmic(name: &str) -> Self {
        Self { name: name.to_owned(), logarithmic: true }
    }

    /// Coordinate of a value on the axis; NaN if it cannot be drawn.
    pub(crate) fn place(&self, value: f64) -> f64 {
        match self.logarithmic {
            true => value.log10(),
            false if value.abs() > LARGEST => f64::NAN,
            false => value,
        }
    }

    pub(crate) fn label(&self, place: f64) -> String {
        let value = if self.logarithmic { 10f64.powf(place) } else { place };
        match value.abs() {
            0.0 => "0".into(),
            1e-3..1e5 => {
                let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 5) as usize;
                let text = format!("{value:.digits$}");
                match text.contains('.') {
                    true => text.trim_end_matches('0').trim_end_matches('.').into(),
                    false => text,
                }
            }
            _ => format!("{value:.0e}"),
        }
    }

    /// Smallest and largest coordinate with a margin.
    pub(crate) fn range(&self, values: impl Iterator<Item = f64>) -> Range<f64> {
        let places = values.map(|value| self.place(value)).filter(|place| place.is_finite());
        let [low, high] = places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
            [low.min(place), high.max(place)]
        });
        if low > high {
            return 0.0..1.0;
        }
        let room = (0.04 * (high - low)).max(1e-3 * high.abs()).max(1e-9);
        low - room..high + room
    }

    /// The axis over a range of coordinates, with about `most` numbers and light marks between them.
    ///
    /// A linear axis is marked at round numbers, a logarithmic one at decades; below two decades at 1, 2 and 5 times a
    /// power of ten, and below the range of these at round numbers again.
    pub(crate) fn over(&self, range: Range<f64>, most: usize) -> MarkedAxis {
        let round = |range: Range<f64>| {
            // The mark at 0 has a rounding error.
            let least = 1e-9 * (range.end - range.start);
            let marks = RangedCoordf64::from(range).key_points(most).into_iter();
            marks.map(|mark| if mark.abs() < least { 0.0 } else { mark }).collect::<Vec<_>>()
        };
        // For a logarithmic axis only: the number of marks grows with the range.
        let multiples = |of: &[u32]| -> Vec<f64> {
            let powers = range.start.floor() as i32..=range.end.floor() as i32;
            let places = powers
                .flat_map(|power| of.iter().map(move |k| f64::from(power) + f64::from(*k).log10()));
            places.filter(|place| range.contains(place)).collect()
        };
        if !self.logarithmic {
            return MarkedAxis {
                numbers: round(range.clone()),
                light: Vec::new(),
                range: range.into(),
            };
        }
        let decades = multiples(&[1]);
        let few = multiples(&[1, 2, 5]);
        let (numbers, light) = match decades.len() {
            0 | 1 if few.len() > 1 => (few, multiples(&[3, 4, 6, 7, 8, 9])),
            0 | 1 => {
                let values = round(10f64.powf(range.start)..10f64.powf(range.end));
                (values.into_iter().map(f64::log10).collect(), Vec::new())
            }
            count if count <= most => (decades, multiples(&[2, 3, 4, 5, 6, 7, 8, 9])),
            count => {
                let every = count.div_ceil(most) as i32;
                decades.into_iter().partition(|power| *power as i32 % every == 0)
            }
        };
        MarkedAxis { range: range.into(), numbers, light }
    }
}

/// A range with custom marks. The combinator of plotters for custom marks has no labels over floats.
pub(crate) struct MarkedAxis {
    range: RangedCoordf64,
    numbers: Vec<f64>,
    light: Vec<f64>,
}

impl Ranged for MarkedAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.range.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let light = hint.weight().allow_light_points();
        if light { self.light.clone() } else { self.numbers.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.range.range()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marks(range: Range<f64>) -> [Vec<f64>; 2] {
        let axis = Axis::logarithmic("x").over(range, 6);
        [axis.numbers, axis.light]
            .map(|places| places.iter().map(|p| (10f64.powf(*p) * 1e6).round() / 1e6).collect())
    }

    #[test]
    fn a_logarithmic_axis_is_marked_at_decades_or_at_what_divides_them() {
        let [numbers, light] = marks(-2.2..0.4);
        assert_eq!(numbers, [0.01, 0.1, 1.0]);
        assert_eq!((&light[..4], light.len()), (&[0.007, 0.008, 0.009, 0.02][..], 3 + 8 + 8 + 1));
        assert_eq!(marks(-0.5..6.5)[0], [1.0, 1e2, 1e4, 1e6]);
        assert_eq!(marks(-1.2..-0.2), [vec![0.1, 0.2, 0.5], vec![0.07, 0.08, 0.09, 0.3, 0.4, 0.6]]);
        assert_eq!(marks(1.21f64.log10()..1.29f64.log10())[0], [1.22, 1.24, 1.26, 1.28]);
    }

    #[test]
    fn marks_are_few_whatever_is_to_be_shown() {
        let mut random = 1u64;
        let mut number = || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let value = f64::from_bits(random ^ (random >> 31));
            if random.is_multiple_of(3) { (random >> 40) as f64 * 1e-7 } else { value }
        };
        for k in 0..300_000 {
            let axis = Axis { name: String::new(), logarithmic: k % 2 == 0 };
            let range = axis.range([number(), number()].into_iter());
            assert!(range.start < range.end && (range.end - range.start).is_finite(), "{range:?}");
            let marks = axis.over(range.clone(), 7);
            assert!(marks.numbers.len() <= 15 && marks.light.len() <= 700, "{range:?}");
        }
    }

    #[test]
    fn a_linear_axis_is_marked_at_round_numbers() {
        let axis = Axis::linear("x");
        let numbers = axis.over(-0.65..0.65, 7).numbers;
        let labels: Vec<String> = numbers.iter().map(|number| axis.label(*number)).collect();
        assert_eq!(labels, ["-0.6", "-0.4", "-0.2", "0", "0.2", "0.4", "0.6"]);
    }
}
