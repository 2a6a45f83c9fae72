use std::ops::Range;

use plotters::coord::{
    ranged1d::{DefaultFormatting, KeyPointHint, Ranged},
    types::RangedCoordf64,
};

/// Where an axis is marked, in the unit of its places: logarithms to base 10 if it is logarithmic.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Ticks {
    /// Marks with a number.
    pub(crate) labelled: Vec<f64>,
    /// Light marks between them.
    pub(crate) light: Vec<f64>,
}

/// Room for rounding, as a share of the range.
const ROUNDING: f64 = 1e-9;

impl Ticks {
    /// Of an axis over this range of places, with about `most` numbers.
    ///
    /// A logarithmic axis is marked at whole decades, with light marks at 2 to 9 times each if it has few
    /// of them; over less than two decades at 1, 2 and 5 times a power of ten. A linear one is marked
    /// at multiples of 1, 2 or 5 times a power of ten.
    pub(crate) fn new(range: Range<f64>, logarithmic: bool, most: usize) -> Self {
        if !logarithmic {
            return Self { labelled: linear(range, most), light: Vec::new() };
        }
        let decades = whole(&range);
        if decades.len() < 2 {
            return within_a_decade(range, most);
        }
        let every = decades.len().div_ceil(most.max(1));
        let (labelled, between): (Vec<_>, Vec<_>) =
            decades.into_iter().partition(|decade| (*decade as i64).rem_euclid(every as i64) == 0);
        let light = if every > 1 { between } else { multiples(&range, &[2, 3, 4, 5, 6, 7, 8, 9]) };
        Self { labelled, light }
    }

    /// The axis over `range` with these marks.
    pub(crate) fn on(self, range: Range<f64>) -> MarkedAxis {
        MarkedAxis { axis: range.into(), ticks: self }
    }
}

/// An axis of a chart with marks of one's own.
pub(crate) struct MarkedAxis {
    axis: RangedCoordf64,
    ticks: Ticks,
}

impl Ranged for MarkedAxis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.axis.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let Ticks { labelled, light } = &self.ticks;
        if hint.weight().allow_light_points() { light.clone() } else { labelled.clone() }
    }

    fn range(&self) -> Range<f64> {
        self.axis.range()
    }
}

fn within_a_decade(range: Range<f64>, most: usize) -> Ticks {
    let labelled = multiples(&range, &[1, 2, 5]);
    if labelled.len() < 2 {
        // So narrow that it is as good as linear.
        let values = 10f64.powf(range.start)..10f64.powf(range.end);
        let labelled = linear(values, most).into_iter().filter(|&value| value > 0.0);
        return Ticks { labelled: labelled.map(f64::log10).collect(), light: Vec::new() };
    }
    let light = multiples(&range, &[3, 4, 6, 7, 8, 9]);
    Ticks { labelled, light }
}

/// Whole numbers in the range.
fn whole(range: &Range<f64>) -> Vec<f64> {
    let room = ROUNDING * (range.end - range.start);
    let (first, last) = ((range.start - room).ceil() as i64, (range.end + room).floor() as i64);
    (first..=last).map(|decade| decade as f64).collect()
}

/// Logarithms of these multiples of powers of ten that lie in the range, ascending.
fn multiples(range: &Range<f64>, of: &[u32]) -> Vec<f64> {
    let decades = range.start.floor() as i64..=range.end.floor() as i64;
    let all =
        decades.flat_map(|decade| of.iter().map(move |&k| decade as f64 + f64::from(k).log10()));
    let room = ROUNDING * (range.end - range.start);
    all.filter(|place| (range.start - room..=range.end + room).contains(place)).collect()
}

/// About `most` multiples of a round number.
fn linear(range: Range<f64>, most: usize) -> Vec<f64> {
    let size = range.end - range.start;
    if size.is_nan() || size <= 0.0 {
        return vec![range.start];
    }
    // A little less, so that rounding does not ask for the next step.
    let least = size / most.max(1) as f64 * (1.0 - ROUNDING);
    let power = 10f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|k| k * power).into_iter().find(|&step| step >= least);
    let step = step.unwrap_or(10.0 * power);
    whole(&(range.start / step..range.end / step)).into_iter().map(|k| k * step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(places: &[f64]) -> Vec<f64> {
        places.iter().map(|place| (10f64.powf(*place) * 1e6).round() / 1e6).collect()
    }

    #[test]
    fn decades_are_whole_and_have_light_marks_between() {
        let ticks = Ticks::new(-2.2..0.4, true, 6);
        assert_eq!(values(&ticks.labelled), [0.01, 0.1, 1.0]);
        assert_eq!(values(&ticks.light)[..4], [0.007, 0.008, 0.009, 0.02]);
        assert_eq!(ticks.light.len(), 3 + 8 + 8 + 1);
    }

    #[test]
    fn of_many_decades_some_are_labelled() {
        let ticks = Ticks::new(-9.5..3.0, true, 6);
        assert_eq!(ticks.labelled, [-9.0, -6.0, -3.0, 0.0, 3.0]);
        assert_eq!(ticks.light[..2], [-8.0, -7.0]);
    }

    #[test]
    fn less_than_two_decades_are_marked_at_1_2_and_5() {
        let ticks = Ticks::new(-1.2..-0.2, true, 6);
        assert_eq!(values(&ticks.labelled), [0.1, 0.2, 0.5]);
        assert_eq!(values(&ticks.light), [0.07, 0.08, 0.09, 0.3, 0.4, 0.6]);
        let narrow = Ticks::new(1.21f64.log10()..1.29f64.log10(), true, 4);
        assert_eq!(values(&narrow.labelled), [1.22, 1.24, 1.26, 1.28]);
    }

    #[test]
    fn a_linear_axis_is_marked_at_round_numbers() {
        assert_eq!(
            Ticks::new(-0.1..1.05, false, 6).labelled,
            [0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0]
        );
        assert_eq!(Ticks::new(0.0..300.0, false, 7).labelled.len(), 7);
        assert_eq!(Ticks::new(2.0..2.0, false, 5).labelled, [2.0]);
    }
}
