use serde::Serialize;

use crate::{
    Error, Grid, OwnAxis, Schedule, Settings, SoftnessChoice, control::Control, grid::fine,
};

/// One choice of what `search` looks for. What is `None` stays as the task has it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Setting {
    pub(crate) scale: Option<f64>,
    /// Of a decay; a static softness has none.
    pub(crate) scale_end: Option<f64>,
    pub(crate) learning_rate: Option<f64>,
    /// Flag and value of a number that only the task has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) own: Option<(&'static str, f64)>,
}

impl Setting {
    /// The settings of the command line with this choice.
    pub(crate) fn apply(self, settings: &Settings) -> Settings {
        let mut settings = settings.clone();
        if let Some(scale) = self.scale {
            let decays = self.scale_end.is_some();
            settings.schedule = Some(if decays { Schedule::Decay } else { Schedule::Static });
            (settings.scale, settings.scale_end) = (Some(scale), self.scale_end);
        }
        settings.learning_rate = self.learning_rate.or(settings.learning_rate);
        settings.own = self.own.map(|(_, value)| value);
        settings
    }

    /// The flags that ask for it.
    pub(crate) fn flags(self) -> String {
        let flag = |name, value: Option<f64>| value.map(|x| format!("--{name} {}", exact(x)));
        let flags = [
            flag("scale", self.scale),
            flag("scale-end", self.scale_end),
            flag("learning-rate", self.learning_rate),
            self.own.and_then(|(name, value)| flag(name, Some(value))),
        ];
        flags.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }
}

/// All settings that a search may try.
pub(crate) struct Space {
    /// First scales, last scales and learning rates; a list of one is not searched.
    scales: Vec<f64>,
    ends: Vec<f64>,
    learning_rates: Vec<f64>,
    own: Option<OwnAxis>,
    statics: bool,
    decays: bool,
    between: usize,
}

impl Space {
    /// What the command line fixes is fixed, what it lists is tried, the rest is the task's grid.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] if that leaves nothing to choose from, or scales for a softness file.
    pub(crate) fn new(settings: &Settings, control: &Control, grid: &Grid) -> Result<Self, Error> {
        let file = match settings.softness {
            Some(SoftnessChoice::File(_) | SoftnessChoice::Learned(_)) => true,
            Some(SoftnessChoice::Named(_)) | None => false,
        };
        if file && !control.scales.is_empty() {
            let message = "a softness file holds its own scale: leave out --scales";
            return Err(Error::Usage(message.into()));
        }
        let axis = |fixed: Option<f64>, listed: &[f64], own: &[f64]| {
            let values = if listed.is_empty() { own } else { listed };
            let mut values = fixed.map_or_else(|| values.to_vec(), |x| vec![x]);
            values.sort_by(f64::total_cmp);
            values.dedup();
            values
        };
        let own = if file { &[][..] } else { &grid.scales };
        let space = Self {
            scales: axis(settings.scale, &control.scales, own),
            ends: axis(settings.scale_end, &control.scales, own),
            learning_rates: axis(
                settings.learning_rate,
                &control.learning_rates,
                &grid.learning_rates,
            ),
            own: grid.own.clone(),
            statics: settings.schedule != Some(Schedule::Decay),
            decays: settings.schedule != Some(Schedule::Static),
            between: grid.fine,
        };
        match space.coarse().len() {
            0 | 1 => Err(Error::Usage(
                "there is nothing to choose from: fix less, or list more with --scales and \
                 --learning-rates"
                    .into(),
            )),
            _ => Ok(space),
        }
    }

    /// The coarse grid: every static scale, then every decay, at every learning rate and every value
    /// of the task's own number.
    pub(crate) fn coarse(&self) -> Vec<Setting> {
        let statics = self.scales.iter().filter(|_| self.statics).map(|&x| (Some(x), None));
        let pairs = self.scales.iter().flat_map(|&x| self.ends.iter().map(move |&end| (x, end)));
        let decays = pairs.filter(|(first, last)| self.decays && last < first);
        let mut paths: Vec<_> =
            statics.chain(decays.map(|(x, end)| (Some(x), Some(end)))).collect();
        if self.scales.is_empty() {
            paths.push((None, None));
        }
        self.combined(&paths, &some(&self.learning_rates), self.own_values())
    }

    fn own_values(&self) -> &[f64] {
        self.own.as_ref().map_or(&[], |own| &own.values)
    }

    /// Every path with every learning rate and every value of the task's own number; an empty list is a
    /// choice of none.
    fn combined(
        &self,
        paths: &[(Option<f64>, Option<f64>)],
        rates: &[Option<f64>],
        own: &[f64],
    ) -> Vec<Setting> {
        let flag = self.own.as_ref().map_or("", |own| own.flag);
        let own: Vec<_> = own.iter().map(|&value| Some((flag, value))).collect();
        let rates = if rates.is_empty() { &[None] } else { rates };
        let own = if own.is_empty() { &[None] } else { &own[..] };
        let mut all = Vec::with_capacity(paths.len() * rates.len() * own.len());
        for &(scale, scale_end) in paths {
            for &learning_rate in rates {
                let with = |&own| Setting { scale, scale_end, learning_rate, own };
                all.extend(own.iter().map(with));
            }
        }
        all
    }

    /// The fine grid around a setting of the coarse one, without what was tried before.
    pub(crate) fn fine(&self, best: Setting, tried: &[Setting]) -> Vec<Setting> {
        let around = |axis: &[f64], best: Option<f64>| match best {
            Some(best) => some(&fine(axis, best, self.between)),
            None => vec![None],
        };
        let ends = around(&self.ends, best.scale_end);
        let paths: Vec<_> = around(&self.scales, best.scale)
            .into_iter()
            .flat_map(|scale| ends.iter().map(move |&end| (scale, end)))
            .filter(|(scale, end)| end.is_none() || end < scale)
            .collect();
        let rates = around(&self.learning_rates, best.learning_rate);
        let own = best.own.map(|(_, value)| fine(self.own_values(), value, self.between));
        let all = self.combined(&paths, &rates, &own.unwrap_or_default());
        all.into_iter().filter(|setting| !tried.contains(setting)).collect()
    }

    /// Names, without dashes, of the flags whose best value is the smallest or largest that was tried of several.
    pub(crate) fn at_edge(&self, best: Setting, tried: &[Setting]) -> Vec<&'static str> {
        let edge = |axis: &[f64], of: fn(&Setting) -> Option<f64>| {
            let values = tried.iter().filter_map(of);
            let (low, high) =
                values.fold((f64::INFINITY, 0.0_f64), |(low, high), x| (low.min(x), high.max(x)));
            axis.len() > 1 && of(&best).is_some_and(|x| x == low || x == high)
        };
        let own = self.own.as_ref().map_or("", |own| own.flag);
        let edges = [
            ("scale", edge(&self.scales, |s| s.scale)),
            ("scale-end", edge(&self.ends, |s| s.scale_end)),
            ("learning-rate", edge(&self.learning_rates, |s| s.learning_rate)),
            (own, edge(self.own_values(), |s| s.own.map(|(_, value)| value))),
        ];
        edges.into_iter().filter(|(_, at)| *at).map(|(name, _)| name).collect()
    }
}

/// A number with all its digits and few zeros.
pub(crate) fn exact(x: f64) -> String {
    if (1e-3..1e6).contains(&x.abs()) { x.to_string() } else { format!("{x:e}") }
}

fn some(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().copied().map(Some).collect()
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    fn space(line: &str) -> Result<Space, Error> {
        space_with(line, None)
    }

    fn space_with(line: &str, own: Option<OwnAxis>) -> Result<Space, Error> {
        #[derive(Parser)]
        struct Line {
            #[command(flatten)]
            settings: Settings,
            #[command(flatten)]
            control: Control,
        }
        let (scales, learning_rates) = (vec![0.01, 0.1, 1.0], vec![0.1, 1.0]);
        let grid = Grid { scales, learning_rates, own, fine: 1, runs: 2 };
        let words = ["task"].into_iter().chain(line.split_whitespace());
        let Line { settings, control } = Line::parse_from(words);
        Space::new(&settings, &control, &grid)
    }

    #[test]
    fn the_coarse_grid_has_every_static_scale_and_every_decay() {
        let sizes = |line| space(line).unwrap().coarse().len();
        assert_eq!(sizes(""), (3 + 3) * 2);
        assert_eq!(sizes("--schedule static"), 3 * 2);
        assert_eq!(sizes("--schedule decay --learning-rate 0.3"), 3);
        assert_eq!(sizes("--scale 0.5"), (1 + 2) * 2);
        assert_eq!(sizes("--schedule decay --scale-end 0.05"), 2 * 2);
        assert_eq!(sizes("--scales 1e-3,1e-2,1e-1,1 --learning-rates 1"), 4 + 6);
        assert_eq!(sizes("--softness mlp.json"), 2);
        assert_eq!(sizes("--softness learned"), 2);
    }

    #[test]
    fn nothing_to_choose_from_is_refused() {
        for line in [
            "--scale 1 --learning-rate 1 --schedule static",
            "--softness mlp.json --learning-rate 1",
            "--softness mlp.json --scales 1,2",
            "--schedule decay --scale-end 2",
        ] {
            assert!(space(line).is_err(), "{line}");
        }
    }

    #[test]
    fn the_fine_grid_surrounds_the_best_and_repeats_nothing() {
        let space = space("").unwrap();
        let best =
            Setting { scale: Some(0.1), scale_end: None, learning_rate: Some(1.0), own: None };
        let fine = space.fine(best, &space.coarse());
        assert_eq!(fine.len(), 3 * 3 - 1);
        assert!(fine.iter().all(|setting| setting.scale_end.is_none()));
        let best = Setting { scale_end: Some(0.01), ..best };
        let fine = space.fine(best, &space.coarse());
        assert!(fine.iter().all(|s| s.scale_end < s.scale) && fine.len() == 3 * 8 - 1, "{fine:?}");
    }

    #[test]
    fn the_best_at_an_edge_is_told() {
        let space = space("--schedule static --learning-rate 1").unwrap();
        let at = |scale| Setting { scale: Some(scale), ..space.coarse()[0] };
        assert_eq!(space.at_edge(at(0.01), &space.coarse()), ["scale"]);
        assert!(space.at_edge(at(0.1), &space.coarse()).is_empty());
    }

    #[test]
    fn a_setting_is_the_flags_that_ask_for_it() {
        let scale_end = Some(1e-7);
        let setting = Setting { scale: Some(0.1), scale_end, learning_rate: Some(0.3), own: None };
        assert_eq!(setting.flags(), "--scale 0.1 --scale-end 1e-7 --learning-rate 0.3");
        let setting = Setting { own: Some(("depth", 2.0)), learning_rate: None, ..setting };
        assert_eq!(setting.flags(), "--scale 0.1 --scale-end 1e-7 --depth 2");
    }

    #[test]
    fn a_number_of_the_task_is_one_more_axis() {
        let own = OwnAxis { flag: "depth", values: vec![1.0, 10.0] };
        let line = "--schedule static --scale 0.1 --learning-rate 1";
        let space = space_with(line, Some(own)).unwrap();
        let coarse = space.coarse();
        let flags: Vec<String> = coarse.iter().map(|setting| setting.flags()).collect();
        let rest = "--scale 0.1 --learning-rate 1 --depth";
        assert_eq!(flags, [format!("{rest} 1"), format!("{rest} 10")]);
        let fine: Vec<_> = space.fine(coarse[1], &coarse).iter().map(|s| s.own).collect();
        assert_eq!(fine, [Some(("depth", 3.16)), Some(("depth", 31.6))]);
        assert_eq!(space.at_edge(coarse[1], &coarse), ["depth"]);
    }
}
