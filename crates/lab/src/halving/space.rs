use rand::{Rng, rngs::StdRng};

use crate::format::exact;

/// Largest change of the logarithm of a value for a setting near another.
const NEAR: f64 = 0.5;
/// Probability that an optional flag is added or removed for a setting near another.
const OTHERWISE: f64 = 0.15;
/// Most draws for a valid setting.
const DRAWS: usize = 1000;

/// The settings of a search.
#[derive(Clone, Debug)]
pub struct SearchSpace {
    /// The axes.
    pub axes: Vec<SearchAxis>,
    /// Whether a setting is valid.
    pub valid: fn(&Setting) -> bool,
}

/// The values of a flag that are searched.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchAxis {
    /// The flag without dashes, such as `scale-end`.
    pub flag: &'static str,
    /// Smallest and largest value, positive; `None` if the flag is always omitted.
    pub range: Option<[f64; 2]>,
    /// Whether half of the settings omit it.
    pub optional: bool,
}

/// The value of every axis; `None` if its flag is omitted.
pub type Setting = Vec<Option<f64>>;

impl SearchSpace {
    pub(super) fn draw(&self, random: &mut StdRng) -> Option<Setting> {
        (0..DRAWS)
            .map(|_| self.axes.iter().map(|axis| axis.draw(random)).collect())
            .find(self.valid)
    }

    pub(super) fn near(&self, setting: &Setting, random: &mut StdRng) -> Option<Setting> {
        let near = |random: &mut StdRng| -> Setting {
            let axes = self.axes.iter().zip(setting);
            axes.map(|(axis, value)| axis.near(*value, random)).collect()
        };
        (0..DRAWS).map(|_| near(random)).find(self.valid)
    }

    /// Whether more than one setting can be drawn.
    pub fn is_free(&self) -> bool {
        let is_free =
            |axis: &SearchAxis| axis.range.is_some_and(|[low, high]| axis.optional || low < high);
        self.axes.iter().any(is_free)
    }

    /// The flags of a setting.
    pub fn flags(&self, setting: &Setting) -> String {
        let flag = |(axis, value): (&SearchAxis, &Option<f64>)| {
            value.map(|value| format!("--{} {}", axis.flag, exact(value)))
        };
        self.axes.iter().zip(setting).filter_map(flag).collect::<Vec<_>>().join(" ")
    }
}

impl SearchAxis {
    /// An axis between the smallest and the largest value of a list.
    pub fn spanning(flag: &'static str, values: &[f64]) -> Self {
        let [low, high] = values
            .iter()
            .fold([f64::INFINITY, 0.0], |[low, high], &x| [f64::min(low, x), f64::max(high, x)]);
        Self { flag, range: (low <= high).then_some([low, high]), optional: false }
    }

    fn draw(&self, random: &mut StdRng) -> Option<f64> {
        let [low, high] = self.range?;
        let (out, part) = (random.random::<bool>(), random.random::<f64>());
        (!(out && self.optional)).then(|| self.clamped(low * (high / low).powf(part)))
    }

    fn near(&self, value: Option<f64>, random: &mut StdRng) -> Option<f64> {
        let (otherwise, step) = (random.random::<f64>(), random.random::<f64>());
        match value {
            Some(value) if !(self.optional && otherwise < OTHERWISE) => {
                Some(self.clamped(value * (NEAR * (2.0 * step - 1.0)).exp()))
            }
            None if self.optional && otherwise < OTHERWISE => self.draw(random),
            _ => None,
        }
    }

    /// The nearest value in the range, to three digits unless it is an end.
    fn clamped(&self, value: f64) -> f64 {
        self.range.map_or(value, |[low, high]| rounded(value).clamp(low, high))
    }
}

/// Rounds to three digits, so that a result is easy to type.
pub fn rounded(x: f64) -> f64 {
    format!("{x:.2e}").parse().unwrap_or(x)
}

#[cfg(test)]
pub(super) mod tests {
    use rand::SeedableRng;

    use super::*;

    /// One free axis, one that half of the settings omit, one that is fixed and one without values.
    pub(in crate::halving) fn space() -> SearchSpace {
        let optional = |axis| SearchAxis { optional: true, ..axis };
        let axes = vec![
            SearchAxis::spanning("scale", &[1.0, 0.01]),
            optional(SearchAxis::spanning("scale-end", &[0.01, 1.0])),
            SearchAxis::spanning("rate", &[0.3]),
            SearchAxis::spanning("none", &[]),
        ];
        SearchSpace { axes, valid: |setting| setting[1].is_none() || setting[1] < setting[0] }
    }

    #[test]
    fn settings_are_valid_and_lie_in_their_ranges() {
        let (space, mut random) = (space(), StdRng::seed_from_u64(1));
        let mut now = space.draw(&mut random).unwrap();
        let (mut moving, mut wide) = (0, 0);
        for k in 0..400 {
            now = match k % 2 {
                0 => space.near(&now, &mut random).unwrap(),
                _ => space.draw(&mut random).unwrap(),
            };
            assert!((space.valid)(&now) && (now[2], now[3]) == (Some(0.3), None), "{now:?}");
            assert!((0.01..=1.0).contains(&now[0].unwrap()), "{now:?}");
            moving += usize::from(now[1].is_some());
            wide += usize::from(now[0] > Some(0.1));
        }
        assert!((80..320).contains(&moving) && (120..320).contains(&wide), "{moving} {wide}");
        assert!(space.is_free());
        let setting = vec![Some(1.0), Some(1e-7), None, None];
        assert_eq!(space.flags(&setting), "--scale 1 --scale-end 1e-7");
    }
}
