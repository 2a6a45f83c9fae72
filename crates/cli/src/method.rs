//! Conversion of flags to a [`Method`].

use softrast_inverse::{
    Method, ScheduledSoftness, SoftnessFileError, Surrogate, distilled_mlp, mlp_like,
};
use softrast_lab::Error;
use softrast_softness::{EdgeSoftness, Family, Softness};

use crate::{Init, MethodArgs, PRESET, Schedule, Searched, SoftnessChoice};

/// Default scales of a task, as widths in NDC, if neither the command line nor a [`Searched`] sets them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scales {
    /// Schedule of the scale if neither a schedule nor a scale is given.
    pub schedule: Schedule,
    /// First and last scale of a decay.
    pub decay: [f64; 2],
    /// Scale of a softness of fixed width.
    pub fixed: f64,
}

impl MethodArgs {
    /// The method of the flags on a task. Without flags of the softness, it is the preset of the
    /// task, if there is one and `preset_by_default`; else a logistic.
    ///
    /// A scale without an end or a schedule is fixed. With `--squared` the default scales are
    /// squared, so that they mean the same widths.
    ///
    /// # Errors
    ///
    /// If a softness file cannot be used, the requested softness is not bundled, or flags contradict each other.
    pub fn method(
        &self,
        task: &str,
        scales: &Scales,
        preset_by_default: bool,
    ) -> anyhow::Result<Method> {
        let (name, softness) = match &self.softness {
            Some(SoftnessChoice::Auto) => {
                return Err(Error::usage(
                    "--softness auto goes with solve and evaluate, and not behind --baseline: name a family or a file",
                ));
            }
            Some(SoftnessChoice::File(file)) => {
                self.check_goes_with_file()?;
                (
                    file.display().to_string(),
                    self.file_softness(ScheduledSoftness::load(file)?, task)?,
                )
            }
            _ => match self.bundled(task, preset_by_default) {
                Some(Bundled { flag, file, .. }) => {
                    self.check_goes_with_file()?;
                    let file = file.map_err(|_| {
                        Error::usage(format!(
                            "no softness {flag} is bundled for {task}: name a family or a file"
                        ))
                    })?;
                    (flag, self.file_softness(file, task)?)
                }
                None => self.family_softness(task, scales)?,
            },
        };
        let (resolution, tolerance) = (self.resolution.unwrap_or_default(), self.tolerance);
        Ok(Method { name, softness, resolution, tolerance })
    }

    /// Checks that no flag repeats a setting of a softness file.
    fn check_goes_with_file(&self) -> anyhow::Result<()> {
        let moved = self.schedule == Some(Schedule::Decay);
        let begun = self.init == Some(Init::Uniform);
        if self.is_scaled() || moved || self.surrogate_scale.is_some() || begun {
            return Err(Error::usage(
                "a softness file holds its own parameters: leave out --scale, --scale-end, --squared, --surrogate-scale, --init \
                 uniform and --schedule decay, or name a family",
            ));
        }
        Ok(())
    }

    /// The softness of a file, with its learning rate if that is for this task.
    fn file_softness(
        &self,
        file: ScheduledSoftness,
        task: &str,
    ) -> anyhow::Result<ScheduledSoftness> {
        let suits = file.task.as_ref().is_none_or(|learned_on| learned_on == task);
        if file.adaptive.is_some() && self.rate_end.is_some() {
            return Err(Error::usage(
                "a softness with an adaptive schedule moves its learning rate itself: leave out --rate-end, or name another softness",
            ));
        }
        let learning_rate = file.learning_rate.filter(|_| suits);
        let rate_end = self.rate_end.or(file.rate_end.filter(|_| suits));
        let mut softness = ScheduledSoftness { learning_rate, rate_end, ..file };
        if self.init == Some(Init::Fitted) {
            (softness.softness, softness.phi) = network_like(softness.softness, &softness.phi)?;
            if let Some(Surrogate { softness, phi }) = &mut softness.surrogate {
                (*softness, *phi) = network_like(*softness, phi)?;
            }
        }
        Ok(softness)
    }

    /// The softness of a family, and its name.
    fn family_softness(
        &self,
        task: &str,
        scales: &Scales,
    ) -> anyhow::Result<(String, ScheduledSoftness)> {
        let family = match self.softness {
            Some(SoftnessChoice::Family(family)) => family,
            _ => Family::Logistic,
        };
        if self.init.is_some() && family != Family::Mlp {
            return Err(Error::usage(
                "--init is about the weights of --softness mlp: leave it out",
            ));
        }
        let fitted = self.init == Some(Init::Fitted);
        let like = if fitted { Family::Logistic } else { family };
        // Found together, therefore used together or not at all.
        let searched = Searched::of(task, like.name(), self.given_schedule(), scales.schedule);
        let searched = searched.filter(|_| !self.is_scaled());
        let [first, last] =
            self.scales(&searched.map_or(*scales, |searched| scales.with(searched)));
        let edge = if self.squared { EdgeSoftness::squared } else { EdgeSoftness::new };
        let edge = edge(family);
        let mut softness = match first == last {
            true => ScheduledSoftness::constant(edge, first),
            false => ScheduledSoftness::decay(edge, first, last),
        };
        if fitted {
            let weights = distilled_mlp();
            let factor = if first == last { first } else { 1.0 };
            softness.phi = edge.with_scale_values(&weights, factor);
        }
        softness.learning_rate = searched.and_then(|searched| searched.learning_rate);
        softness.rate_end = self.rate_end;
        let surrogate = searched.and_then(|searched| searched.surrogate_scale);
        let Some(scale) = self.surrogate_scale.or(surrogate) else {
            return Ok((family.name().to_owned(), softness));
        };
        let mut softness = softness.with_surrogate_scale(scale);
        if let (true, Some(surrogate)) = (fitted, &mut softness.surrogate) {
            let factor = if first == last { scale } else { scale / first };
            surrogate.phi = edge.with_scale_values(&distilled_mlp(), factor);
        }
        Ok((format!("{family} with surrogate"), softness))
    }

    /// First and last scale.
    fn scales(&self, usual: &Scales) -> [f64; 2] {
        let unit = |scale: f64| if self.squared { scale * scale } else { scale };
        match self.given_schedule().unwrap_or(usual.schedule) {
            Schedule::Static => [self.scale.unwrap_or(unit(usual.fixed)); 2],
            Schedule::Decay => {
                let [first, last] = usual.decay.map(unit);
                let first = self.scale.unwrap_or(first.max(self.scale_end.unwrap_or(0.0)));
                [first, self.scale_end.unwrap_or(last.min(first))]
            }
        }
    }
}

/// Colour of a method in every chart, distinguishable also without seeing red. Methods without an entry share one dark colour.
pub fn method_colour(name: &str) -> [u8; 3] {
    match name.split([' ', '.']).next().unwrap_or_default() {
        "preset" => [20, 20, 20],
        "searched" => [150, 120, 40],
        "learned-mlp" => [170, 20, 60],
        "learned-surrogate" => [110, 80, 190],
        "logistic" => [31, 96, 168],
        "gauss" => [86, 180, 233],
        "exp" => [0, 140, 100],
        "gamma" => [204, 121, 167],
        "mlp" => [196, 84, 24],
        _ => [130, 130, 130],
    }
}

impl Scales {
    /// These flags with the schedule and the scale of a search result.
    fn with(self, searched: &Searched) -> Self {
        match searched.scale_end {
            None => Self { schedule: Schedule::Static, fixed: searched.scale, ..self },
            Some(end) => Self { schedule: Schedule::Decay, decay: [searched.scale, end], ..self },
        }
    }
}

/// A bundled softness, or the error that there is none.
pub(crate) struct Bundled {
    /// Its name in the flags.
    flag: String,
    /// The name of a task's own bundled softness that goes with it.
    pub(crate) name: String,
    file: Result<ScheduledSoftness, SoftnessFileError>,
}

impl MethodArgs {
    /// The bundled softness of these flags, whether it exists or not: the named one, or the preset
    /// if no flag of the softness is given, the task has a preset, and `preset_by_default`.
    pub(crate) fn bundled(&self, task: &str, preset_by_default: bool) -> Option<Bundled> {
        let preset = |choice: &SoftnessChoice| Bundled {
            flag: choice.to_string(),
            name: PRESET.to_owned(),
            file: ScheduledSoftness::preset(task),
        };
        match &self.softness {
            Some(choice @ SoftnessChoice::Preset) => Some(preset(choice)),
            Some(choice @ SoftnessChoice::Searched) => Some(Bundled {
                flag: choice.to_string(),
                name: PRESET.to_owned(),
                file: ScheduledSoftness::searched(task),
            }),
            Some(choice @ SoftnessChoice::Learned(kind)) => {
                let name = kind.as_ref().map_or(task.to_owned(), |kind| learned_kind(task, kind));
                let file = ScheduledSoftness::learned(&name);
                Some(Bundled { flag: choice.to_string(), name, file })
            }
            Some(_) => None,
            None => {
                let preset = preset(&SoftnessChoice::Preset);
                (preset_by_default && self.is_silent() && preset.file.is_ok()).then_some(preset)
            }
        }
    }
}

/// The name of `learned-KIND` on a task: that of this kind for the task, or else that learned on the task of this name.
pub fn learned_kind(task: &str, kind: &str) -> String {
    let (own, there) =
        (format!("{task}-{kind}"), |name: &str| ScheduledSoftness::learned(name).is_ok());
    if !there(&own) && there(kind) { kind.to_owned() } else { own }
}

/// Whether the preset of a task is its learned softness.
pub fn is_preset_learned(task: &str) -> bool {
    is_preset(task, ScheduledSoftness::learned(task))
}

/// Whether this is the preset of a task; false for an error.
pub fn is_preset(task: &str, softness: Result<ScheduledSoftness, SoftnessFileError>) -> bool {
    softness.is_ok_and(|softness| ScheduledSoftness::preset(task).ok() == Some(softness))
}

/// An MLP fitted to a softness, and its weights.
fn network_like(softness: EdgeSoftness, phi: &[f64]) -> anyhow::Result<(EdgeSoftness, Vec<f64>)> {
    let scale = softness.scale(phi);
    let squared = softness.scale_is_squared();
    let edge = if squared { EdgeSoftness::squared } else { EdgeSoftness::new };
    let network = edge(Family::Mlp);
    let plain = EdgeSoftness::new(softness.family);
    let weights = mlp_like(plain, &softness.with_scale_values(phi, scale.recip()));
    let weights = weights.ok_or_else(|| {
        Error::usage(
            "--init fitted: a network treats both sides of an edge alike and cannot be like this softness, which does not",
        )
    })?;
    Ok((network, network.with_scale_values(&weights, scale)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCALES: Scales = Scales { schedule: Schedule::Decay, decay: [0.03, 0.002], fixed: 0.002 };

    fn method(line: &str) -> anyhow::Result<Method> {
        let args = MethodArgs::parse(line).unwrap_or_else(|error| panic!("{line}: {error}"));
        args.method("none", &SCALES, true)
    }

    /// First, middle and last scale of the method of a line.
    fn assert_scales(line: &str, expected: [f64; 3]) {
        let softness = method(line).unwrap().softness;
        for (progress, expected) in [0.0, 0.5, 1.0].into_iter().zip(expected) {
            let found = softness.scale_at(progress, 64);
            assert!((found / expected - 1.0).abs() < 1e-6, "{line}: {found}, not {expected}");
        }
    }

    #[test]
    fn a_decay_is_a_straight_line_in_the_logarithm() {
        assert_scales("gauss --schedule decay --scale 0.1 --scale-end 0.001", [0.1, 0.01, 0.001]);
        let middle = (0.03f64 * 0.002).sqrt();
        assert_scales("exp", [0.03, middle, 0.002]);
        assert_scales("exp --squared", [0.03, middle, 0.002].map(|scale| scale * scale));
    }

    #[test]
    fn a_scale_alone_stays_as_it_is_and_a_decay_never_widens() {
        assert_scales("exp --scale 0.1", [0.1; 3]);
        assert_scales("exp --schedule static", [0.002; 3]);
        assert_scales("exp --schedule decay --scale 0.001", [0.001; 3]);
        assert_scales("exp --schedule decay --scale-end 0.1", [0.1; 3]);
    }

    #[test]
    fn the_preset_is_the_default_where_something_is_solved() {
        let silent = MethodArgs::default();
        let name =
            |args: &MethodArgs, task, default| args.method(task, &SCALES, default).unwrap().name;
        assert_eq!(name(&silent, "pose", true), "preset");
        assert_eq!(name(&silent, "pose", false), "logistic with surrogate");
        assert_eq!(name(&silent, "none", true), "logistic");
        let scaled = MethodArgs { scale: Some(0.1), ..silent };
        assert_eq!(name(&scaled, "pose", true), "logistic");
        let names = [("pose", "mlp"), ("pose", "shape3d"), ("pose", "shape3d-mlp"), ("pose", "x")];
        let names = names.map(|(task, kind)| learned_kind(task, kind));
        assert_eq!(names, ["pose-mlp", "shape3d", "shape3d-mlp", "pose-x"]);
    }

    #[test]
    fn a_learning_rate_goes_with_its_task() {
        let learned = MethodArgs::parse("learned-pose").unwrap();
        let rate = |task| learned.method(task, &SCALES, true).unwrap().softness.learning_rate;
        assert!(rate("pose").is_some() && rate("shape3d").is_none());
    }

    #[test]
    fn a_rate_falls_unless_an_adaptive_schedule_moves_it() {
        let end = |line: &str, task| {
            let softness = MethodArgs::parse(line).unwrap().method(task, &SCALES, true)?.softness;
            anyhow::Ok(softness.rate_end)
        };
        assert_eq!(end("gauss", "none").unwrap(), None);
        assert_eq!(end("gauss --rate-end 0.2", "none").unwrap(), Some(0.2));
        assert_eq!(end("learned --rate-end 0.2", "pose").unwrap(), Some(0.2));
        let adaptive = end("preset --rate-end 0.2", "pose").unwrap_err();
        assert!(adaptive.to_string().contains("leave out --rate-end"), "{adaptive}");
    }

    #[test]
    fn a_surrogate_is_the_same_family_and_keeps_its_ratio() {
        let method = method("exp --scale 0.1 --scale-end 0.001 --surrogate-scale 0.3").unwrap();
        assert_eq!(method.name, "exp with surrogate");
        for (progress, scale) in [(0.0, 0.3), (1.0, 0.003)] {
            let Surrogate { softness, phi } = method.softness.surrogate_at(progress, 64).unwrap();
            assert_eq!(softness.family, Family::Exp);
            assert!((softness.scale(&phi) / scale - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_fitted_mlp_has_the_scale_of_the_logistic_of_the_same_flags() {
        for line in ["--scale 0.05", "--schedule decay", "--schedule static"] {
            let width = |softness: &str| {
                let softness = method(&format!("{softness} {line}")).unwrap().softness;
                softness.width_at(0.3, 64)
            };
            let ratio = width("mlp --init fitted") / width("logistic");
            assert!((ratio - 1.0).abs() < 0.04, "{line}: {ratio}");
        }
        for line in ["--scale 0.05", "--scale 0.05 --scale-end 0.01"] {
            let width = |softness: &str| {
                let line = format!("{softness} {line} --surrogate-scale 0.1");
                let surrogate = method(&line).unwrap().softness.surrogate_at(0.3, 64).unwrap();
                surrogate.softness.width(&surrogate.phi)
            };
            let ratio = width("mlp --init fitted") / width("logistic");
            assert!((ratio - 1.0).abs() < 0.04, "{line}: {ratio}");
        }
        assert!(method("gauss --init fitted").is_err());
    }

    #[test]
    fn a_learned_softness_that_is_not_there_or_not_alone_is_refused() {
        for (line, part) in [
            ("learned", "no softness learned is bundled for"),
            ("learned-x", "no softness learned-x is bundled"),
            ("preset", "no softness preset is bundled"),
            ("learned-pose --scale 0.1", "holds its own parameters"),
            ("auto", "goes with solve and evaluate"),
        ] {
            let error = method(line).unwrap_err();
            assert!(matches!(error.downcast_ref(), Some(Error::Usage(_))));
            assert!(error.to_string().contains(part), "{error}");
        }
    }
}
