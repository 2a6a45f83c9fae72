use softrast_raster::HostBackend;
use softrast_runner::{Error, Init, Schedule, Settings, SoftnessChoice};
use softrast_softness::{EdgeSoftness, Family, ScheduledSoftness, Softness, Surrogate};

use crate::{
    Defaults, Method, Searched,
    backend::backend,
    defaults::{asked_schedule, is_scaled, scales},
    fitted_mlp::{fitted_mlp, mlp_like},
    method::{Drawn, Path},
    numbers, shipped, tensor,
};

impl Method {
    /// The method that the command line asks for. Where it says nothing of the softness, `solve` and
    /// `evaluate` take the one that is shipped for the task; else it is a logistic.
    ///
    /// A scale without an end or a schedule stays as it is. With `--squared` the default scales are
    /// squared, so that they mean the same widths.
    ///
    /// # Errors
    ///
    /// If a softness file cannot be used or none is shipped that is asked for, flags contradict each
    /// other, the image cannot have that resolution, or there is no such backend or no adapter for it.
    pub fn new(settings: &Settings, defaults: &Defaults) -> anyhow::Result<Self> {
        // Before the first tensor.
        let backend = backend(settings, defaults.backends)?;
        let resolution = settings.resolution.unwrap_or_default();
        resolution.check(settings.size.unwrap_or(defaults.size))?;
        let drawn = Drawn { backend, resolution, tolerance: settings.tolerance };
        if let Some(name) = shipped::asked_for(settings, defaults.task) {
            check_alone(settings)?;
            let called = settings.softness.clone().unwrap_or(SoftnessChoice::Learned(None));
            let file = shipped::softness(&name)?.ok_or_else(|| {
                usage(&format!(
                    "no softness {called} comes with the program for {}: name a family or a file",
                    defaults.task
                ))
            })?;
            return Self::of_file(called.to_string(), file, settings, defaults, drawn);
        }
        let family = match &settings.softness {
            Some(SoftnessChoice::File(file)) => {
                check_alone(settings)?;
                let (name, file) = (file.display().to_string(), ScheduledSoftness::load(file)?);
                return Self::of_file(name, file, settings, defaults, drawn);
            }
            Some(SoftnessChoice::Named(name)) => name.parse()?,
            Some(SoftnessChoice::Learned(_)) | None => Family::Logistic,
        };
        Self::of_family(family, settings, defaults, drawn)
    }

    fn of_file(
        name: String,
        file: ScheduledSoftness,
        settings: &Settings,
        defaults: &Defaults,
        drawn: Drawn,
    ) -> anyhow::Result<Self> {
        let ScheduledSoftness { mut softness, mut phi, schedule, mut surrogate, .. } = file;
        if settings.init == Some(Init::Fitted) {
            (softness, phi) = network_like(softness, &phi)?;
            if let Some(felt) = &mut surrogate {
                (felt.softness, felt.phi) = network_like(felt.softness, &felt.phi)?;
            }
        }
        let unit = softness.scale(&phi);
        let size = settings.size.unwrap_or(defaults.size);
        let path = match schedule {
            None => Path::Fixed { scale: unit, phi },
            Some(path) => Path::Learned { phi, unit, path, size },
        };
        let task = defaults.task;
        let suits = file.task.is_none_or(|learned_on| learned_on == task);
        let (learning_rate, note) = (file.learning_rate.filter(|_| suits), file.note);
        Ok(Self { softness, name, path, surrogate, learning_rate, task, note, drawn })
    }

    fn of_family(
        family: Family,
        settings: &Settings,
        defaults: &Defaults,
        drawn: Drawn,
    ) -> anyhow::Result<Self> {
        let softness = EdgeSoftness { family, squared: settings.squared };
        if settings.init.is_some() && family != Family::Mlp {
            return Err(usage("--init is about the weights of --softness mlp: leave it out"));
        }
        let fitted = settings.init == Some(Init::Fitted);
        let like = if fitted { Family::Logistic } else { family };
        let schedule = asked_schedule(settings);
        // Found together, so taken whole or not at all.
        let known = Searched::of(defaults.task, like.name(), schedule, defaults.schedule);
        let searched = known.filter(|_| !is_scaled(settings));
        let [first, last] = scales(settings, &searched.map_or(*defaults, |s| defaults.with(s)));
        let path = Path::Scale { first, last, unit: fitted.then(fitted_mlp) };
        let learning_rate = searched.and_then(|found| found.learning_rate);
        let phi = |scale| softness.default_phi(scale);
        let surrogate =
            settings.surrogate_scale.map(|x| Surrogate { softness, phi: phi(x / first) });
        let name = match surrogate {
            None => family.name().to_owned(),
            Some(_) => format!("{family} with surrogate"),
        };
        let (task, note) = (defaults.task, None);
        Ok(Self { softness, name, path, surrogate, learning_rate, task, note, drawn })
    }
}

/// A network, and its weights, in the place of a softness.
fn network_like(softness: EdgeSoftness, phi: &[f64]) -> anyhow::Result<(EdgeSoftness, Vec<f64>)> {
    let scale = softness.scale(phi);
    let resized = |softness: EdgeSoftness, phi: &[f64], factor: f64| {
        let phi = tensor::<HostBackend, 1>(phi.to_vec(), [phi.len()]);
        numbers(softness.with_scale(phi, tensor(vec![factor], [1])))
    };
    let network = EdgeSoftness { family: Family::Mlp, ..softness };
    let seen = |softness: EdgeSoftness| EdgeSoftness { squared: false, ..softness };
    let weights = mlp_like(seen(softness), &resized(softness, phi, scale.recip()));
    let weights = weights.ok_or_else(|| {
        usage(
            "--init fitted: a network treats both sides of an edge alike and cannot be like this softness, \
             which does not",
        )
    })?;
    Ok((network, resized(network, &weights, scale)))
}

/// Refuses flags that contradict a softness file.
fn check_alone(settings: &Settings) -> anyhow::Result<()> {
    let moved = settings.schedule == Some(Schedule::Decay);
    let begun = settings.init == Some(Init::Uniform);
    if is_scaled(settings) || moved || settings.surrogate_scale.is_some() || begun {
        return Err(usage(
            "a softness file holds its own parameters: leave out --scale, --scale-end, --squared, \
             --surrogate-scale, --init uniform and --schedule decay, or name a family",
        ));
    }
    Ok(())
}

/// A mistake on the command line.
pub(crate) fn usage(message: &str) -> anyhow::Error {
    Error::Usage(message.to_owned()).into()
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use softrast_runner::Command;

    use super::*;

    const DEFAULTS: Defaults = Defaults {
        task: "none",
        schedule: Schedule::Decay,
        decay: [0.03, 0.002],
        fixed: 0.002,
        size: 64,
        backends: softrast_raster::compiled_backends!(),
    };

    fn settings(line: &str) -> Settings {
        #[derive(Parser)]
        struct Line {
            #[command(flatten)]
            settings: Settings,
        }
        Line::parse_from(["task"].into_iter().chain(line.split_whitespace())).settings
    }

    /// First, middle and last scale of the method that a command line gives.
    fn scales(line: &str) -> [f64; 3] {
        let method = Method::new(&settings(line), &DEFAULTS).unwrap();
        [0, 50, 101].map(|step| method.scale(step, 101))
    }

    /// Name and learning rate of the method of a command line, on a task with a shipped softness.
    fn shipped(command: Command, line: &str) -> (String, Option<f64>) {
        let defaults = Defaults { task: "example", ..DEFAULTS };
        let method = Method::new(&Settings { command, ..settings(line) }, &defaults).unwrap();
        (method.name().to_owned(), method.learning_rate())
    }

    fn assert_scales(line: &str, expected: [f64; 3]) {
        for (found, expected) in scales(line).into_iter().zip(expected) {
            assert!((found / expected - 1.0).abs() < 1e-12, "{line}: {found}, not {expected}");
        }
    }

    #[test]
    fn a_decay_is_a_straight_line_in_the_logarithm() {
        assert_scales("--schedule decay --scale 0.1 --scale-end 0.001", [0.1, 0.01, 0.001]);
        let middle = (0.03f64 * 0.002).sqrt();
        assert_scales("", [0.03, middle, 0.002]);
        assert_scales("--squared", [0.03, middle, 0.002].map(|scale| scale * scale));
    }

    #[test]
    fn a_scale_alone_stays_as_it_is() {
        assert_scales("--scale 0.1", [0.1; 3]);
        assert_scales("--schedule static", [0.002; 3]);
    }

    #[test]
    fn a_decay_never_widens_by_default() {
        assert_scales("--schedule decay --scale 0.001", [0.001; 3]);
        assert_scales("--schedule decay --scale-end 0.1", [0.1; 3]);
    }

    #[test]
    fn what_is_shipped_is_used_where_nothing_is_said_and_something_is_solved() {
        let learned = ("learned".to_owned(), Some(0.7));
        for (command, line) in [
            (Command::Solve, ""),
            (Command::Evaluate, "--steps 7 --size 32"),
            (Command::Search, "--softness learned"),
            (Command::Learn, "--softness learned --schedule static"),
            (Command::Solve, "--variant transfer"),
        ] {
            assert_eq!(shipped(command, line), learned, "{command:?} {line}");
        }
        for (command, line) in [
            (Command::Solve, "--scale 0.1"),
            (Command::Solve, "--softness logistic"),
            (Command::Evaluate, "--schedule static"),
            (Command::Evaluate, "--squared"),
            (Command::Search, ""),
            (Command::Choose, ""),
            (Command::Learn, ""),
        ] {
            assert_eq!(shipped(command, line), ("logistic".into(), None), "{command:?} {line}");
        }
    }

    #[test]
    fn a_surrogate_is_the_same_family_at_its_own_scale() {
        let settings = settings("--softness gauss --scale 0.01 --surrogate-scale 0.1");
        let method = Method::new(&settings, &DEFAULTS).unwrap();
        let Surrogate { softness, phi } = method.surrogate(0.01).unwrap();
        assert_eq!(softness.family, Family::Gauss);
        assert!((phi[0] - 0.1f64.ln()).abs() < 1e-6);
        assert_eq!((method.name(), method.parameters()), ("gauss with surrogate", 2));
        let settings = method.settings(10, serde_json::json!({ "mesh": "fox" }));
        assert_eq!((&settings["surrogate"], &settings["mesh"]), (&"gauss".into(), &"fox".into()));
        assert_near(&settings, 0.1, 0.1);
    }

    fn assert_near(settings: &serde_json::Map<String, serde_json::Value>, first: f64, last: f64) {
        for (name, expected) in [("surrogate_scale", first), ("surrogate_scale_end", last)] {
            let found = settings[name].as_f64().unwrap();
            assert!((found / expected - 1.0).abs() < 1e-6, "{name}: {found}, not {expected}");
        }
    }

    #[test]
    fn a_surrogate_keeps_its_ratio_to_a_scale_that_moves() {
        let settings = settings(
            "--softness exp --schedule decay --scale 0.1 --scale-end 0.001 --surrogate-scale 0.3",
        );
        let method = Method::new(&settings, &DEFAULTS).unwrap();
        assert_near(&method.settings(10, serde_json::json!({})), 0.3, 0.003);
    }

    #[test]
    fn a_fitted_mlp_is_the_logistic_of_the_same_flags() {
        for line in ["--scale 0.05", "--schedule decay", "--schedule static"] {
            let of = |softness: &str| {
                let line = format!("--softness {softness} {line}");
                Method::new(&settings(&line), &DEFAULTS).unwrap()
            };
            let [logistic, mlp] = ["logistic", "mlp --init fitted"].map(of);
            let scale = logistic.scale(3, 10);
            assert_eq!(mlp.scale(3, 10), scale);
            let places: Vec<f64> = (-40..=40).map(|k| 0.5 * f64::from(k) * scale).collect();
            let values = |method: &Method| {
                let phi = method.phi(scale);
                let phi = tensor::<HostBackend, 1>(phi.clone(), [phi.len()]);
                numbers(method.softness().value(phi, tensor(places.clone(), [81])))
            };
            let off = values(&logistic).into_iter().zip(values(&mlp)).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0, f64::max);
            assert!(off < 3e-3, "{line}: {off}");
        }
        assert!(Method::new(&settings("--softness gauss --init fitted"), &DEFAULTS).is_err());
    }

    #[test]
    fn a_learned_softness_that_is_not_there_or_not_alone_is_refused() {
        for (task, line, part) in [
            ("none", "--softness learned", "no softness learned comes with the program for none"),
            ("example", "--softness learned-mlp", "no softness learned-mlp comes"),
            ("example", "--softness learned --scale 0.1", "holds its own parameters"),
        ] {
            let defaults = Defaults { task, ..DEFAULTS };
            let error = Method::new(&settings(line), &defaults).unwrap_err();
            assert!(matches!(error.downcast_ref(), Some(Error::Usage(_))));
            assert!(error.to_string().contains(part), "{error}");
        }
    }
}
