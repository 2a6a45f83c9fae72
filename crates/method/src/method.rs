use serde_json::{Map, Value};
use softrast_raster::{BackendChoice, HostBackend};
use softrast_runner::{Error, Schedule, Settings, SoftnessChoice, Variant};
use softrast_softness::{EdgeSoftness, Family, ScalePath, Softness, SoftnessFile, Surrogate};

use crate::{Searched, backend::backend, numbers, shipped, tensor};

/// Scales of a task that the command line does not name, as widths in NDC. A family that
/// [`Searched`] knows has its own instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Defaults {
    /// Name of the task.
    pub task: &'static str,
    /// How the scale moves if neither a schedule nor a scale is given.
    pub schedule: Schedule,
    /// First and last scale of a decay.
    pub decay: [f64; 2],
    /// Scale of a static softness.
    pub fixed: f64,
    /// Width and height of the image where the command line does not say, in pixels.
    pub size: usize,
    /// What the task was compiled for: `softrast_raster::compiled_backends!()` there.
    pub backends: &'static [BackendChoice],
}

/// A softness and how its scale moves over the steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    softness: EdgeSoftness,
    name: String,
    path: Path,
    surrogate: Option<Surrogate>,
    learning_rate: Option<f64>,
    note: Option<String>,
    backend: BackendChoice,
}

#[derive(Clone, Debug, PartialEq)]
enum Path {
    /// Parameters of a file, and a scale that stands for them.
    Fixed { phi: Vec<f64>, scale: f64 },
    /// Parameters of a file at scale 1, and the scale over a run on images of this size.
    Learned { phi: Vec<f64>, path: ScalePath, size: usize },
    /// The default parameters of the family at a scale that goes geometrically from the first to
    /// the last.
    Scale { first: f64, last: f64 },
}

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
    /// other, or there is no such backend or no adapter for it.
    pub fn new(settings: &Settings, defaults: &Defaults) -> anyhow::Result<Self> {
        // Before the first tensor.
        let backend = backend(settings, defaults.backends)?;
        match &settings.softness {
            Some(SoftnessChoice::File(file)) => {
                check_alone(settings)?;
                let (name, file) = (file.display().to_string(), SoftnessFile::load(file)?);
                Ok(Self::of_file(name, file, settings, defaults, backend))
            }
            Some(SoftnessChoice::Named(name)) => {
                Self::of_family(name.parse()?, settings, defaults, backend)
            }
            None if !shipped::is_asked_for(settings, defaults.task) => {
                Self::of_family(Family::Logistic, settings, defaults, backend)
            }
            Some(SoftnessChoice::Learned) | None => {
                check_alone(settings)?;
                let file = shipped::softness(defaults.task)?.ok_or_else(|| {
                    usage(&format!(
                        "no softness learned on {} comes with the program: name a family or a file",
                        defaults.task
                    ))
                })?;
                Ok(Self::of_file("learned".to_owned(), file, settings, defaults, backend))
            }
        }
    }

    fn of_file(
        name: String,
        file: SoftnessFile,
        settings: &Settings,
        defaults: &Defaults,
        backend: BackendChoice,
    ) -> Self {
        let SoftnessFile { softness, phi, path, surrogate, learning_rate, note } = file;
        let path = match path {
            None => Path::Fixed { scale: nominal_scale(softness, &phi), phi },
            Some(path) => Path::Learned { phi, path, size: settings.size.unwrap_or(defaults.size) },
        };
        // Learned on the original.
        let learning_rate = learning_rate.filter(|_| settings.variant == Variant::Original);
        Self { softness, name, path, surrogate, learning_rate, note, backend }
    }

    fn of_family(
        family: Family,
        settings: &Settings,
        defaults: &Defaults,
        backend: BackendChoice,
    ) -> anyhow::Result<Self> {
        let softness = EdgeSoftness { family, squared: settings.squared };
        let schedule = asked_schedule(settings);
        // Found together, so taken whole or not at all.
        let known = Searched::of(defaults.task, family.name(), schedule, defaults.schedule);
        let searched = known.filter(|_| !is_scaled(settings));
        let path = scale_path(settings, &searched.map_or(*defaults, |s| defaults.with(s)));
        let learning_rate = searched.and_then(|found| found.learning_rate);
        let phi = |scale| softness.default_phi(scale);
        let surrogate = settings.surrogate_scale.map(|x| Surrogate { softness, phi: phi(x) });
        let name = match surrogate {
            None => family.name().to_owned(),
            Some(_) => format!("{family} with surrogate"),
        };
        Ok(Self { softness, name, path, surrogate, learning_rate, note: None, backend })
    }

    /// The learning rate that belongs to the softness: the one it was searched for with, or learned
    /// at in the original variant.
    pub fn learning_rate(&self) -> Option<f64> {
        self.learning_rate
    }

    /// What the gradient is taken of, where that is not the softness itself.
    pub fn surrogate(&self) -> Option<&Surrogate> {
        self.surrogate.as_ref()
    }

    /// How many parameters the softness and its surrogate have.
    pub fn parameters(&self) -> usize {
        let felt = self.surrogate.as_ref().map_or(0, |felt| felt.phi.len());
        self.softness.parameters() + felt
    }

    /// The settings of a task, and with them how the softness moves over `steps` steps and where it
    /// comes from, for [`Description::settings`](softrast_runner::Description::settings).
    pub fn settings(&self, steps: usize, of_task: Value) -> Map<String, Value> {
        let mut settings = of_task.as_object().cloned().unwrap_or_default();
        let schedule = if self.is_static() { "static" } else { "decay" };
        settings.insert("schedule".into(), schedule.into());
        settings.insert("scale".into(), self.scale(0, steps).into());
        settings.insert("scale_end".into(), self.scale(steps, steps).into());
        settings.insert("squared".into(), self.softness.squared.into());
        if let Some(Surrogate { softness, phi }) = &self.surrogate {
            settings.insert("surrogate".into(), softness.family.name().into());
            settings.insert("surrogate_scale".into(), nominal_scale(*softness, phi).into());
        }
        if let Some(note) = &self.note {
            settings.insert("softness_note".into(), note.as_str().into());
        }
        settings
    }

    /// Name of the family, or of the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The softness whose parameters [`Method::phi`] gives.
    pub fn softness(&self) -> EdgeSoftness {
        self.softness
    }

    /// What it is drawn on.
    pub fn backend(&self) -> BackendChoice {
        self.backend
    }

    /// Whether the scale moves.
    pub fn is_static(&self) -> bool {
        match &self.path {
            Path::Fixed { .. } => true,
            Path::Learned { path, .. } => path.knots.len() == 1,
            Path::Scale { first, last } => first == last,
        }
    }

    /// Scale after `step` of `steps` steps, in NDC (NDC² if squared).
    ///
    /// The last gradient is taken at the last scale, and so is the last image. Source: FACTS 4.3
    /// (a scale for every step, evenly spaced in its logarithm).
    pub fn scale(&self, step: usize, steps: usize) -> f64 {
        match self.path {
            Path::Fixed { scale, .. } => scale,
            Path::Learned { ref path, size, .. } => {
                let knots = tensor::<HostBackend, 1>(path.knots.clone(), [path.knots.len()]);
                let floor = path.floor(self.softness, size);
                numbers(ScalePath::scale(&knots, floor, part(step, steps)))[0]
            }
            Path::Scale { first, last } => first * (last / first).powf(part(step, steps)),
        }
    }

    /// Parameters of the softness at this scale; a file's are its own whatever the scale.
    pub fn phi(&self, scale: f64) -> Vec<f64> {
        match &self.path {
            Path::Fixed { phi, .. } => phi.clone(),
            Path::Learned { phi, .. } => {
                let phi = tensor::<HostBackend, 1>(phi.clone(), [phi.len()]);
                numbers(self.softness.widened(phi, tensor(vec![scale], [1])))
            }
            Path::Scale { .. } => self.softness.default_phi(scale),
        }
    }

    /// Parameters at scale 1, for a path of scales.
    pub(crate) fn unit_phi(&self) -> Vec<f64> {
        match &self.path {
            Path::Fixed { phi, .. } | Path::Learned { phi, .. } => phi.clone(),
            Path::Scale { .. } => self.softness.default_phi(1.0),
        }
    }
}

/// Which part of a run is over, 0 to 1: the last gradient is taken at the end.
fn part(step: usize, steps: usize) -> f64 {
    let last = steps.saturating_sub(1).max(1);
    step.min(last) as f64 / last as f64
}

impl Defaults {
    /// With the schedule and the scale that were searched for.
    fn with(self, found: &Searched) -> Self {
        match *found {
            Searched { scale, scale_end: None, .. } => {
                Self { schedule: Schedule::Static, fixed: scale, ..self }
            }
            Searched { scale, scale_end: Some(end), .. } => {
                Self { schedule: Schedule::Decay, decay: [scale, end], ..self }
            }
        }
    }
}

/// Whether the flags say what a file says itself.
pub(crate) fn is_scaled(settings: &Settings) -> bool {
    settings.scale.is_some() || settings.scale_end.is_some() || settings.squared
}

/// Refuses flags that contradict a softness file.
fn check_alone(settings: &Settings) -> anyhow::Result<()> {
    let moved = settings.schedule == Some(Schedule::Decay);
    if is_scaled(settings) || moved || settings.surrogate_scale.is_some() {
        return Err(usage(
            "a softness file holds its own parameters: leave out --scale, --scale-end, --squared, \
             --surrogate-scale and --schedule decay, or name a family",
        ));
    }
    Ok(())
}

/// The schedule that the flags ask for: a scale without one stays as it is.
fn asked_schedule(settings: &Settings) -> Option<Schedule> {
    settings.schedule.or(settings.scale.map(|_| Schedule::Static))
}

fn scale_path(settings: &Settings, defaults: &Defaults) -> Path {
    let unit = |scale: f64| if settings.squared { scale * scale } else { scale };
    let Settings { scale, scale_end, .. } = *settings;
    match asked_schedule(settings).unwrap_or(defaults.schedule) {
        Schedule::Static => {
            let scale = scale.unwrap_or(unit(defaults.fixed));
            Path::Scale { first: scale, last: scale }
        }
        Schedule::Decay => {
            let [first, last] = defaults.decay.map(unit);
            let first = scale.unwrap_or(first.max(scale_end.unwrap_or(0.0)));
            Path::Scale { first, last: scale_end.unwrap_or(last.min(first)) }
        }
    }
}

/// The scale of a logistic with the same slope at the edge, for families without a scale of their
/// own; else the family's.
fn nominal_scale(softness: EdgeSoftness, phi: &[f64]) -> f64 {
    if softness.family != Family::Mlp {
        return phi[0].exp();
    }
    let phi = tensor::<HostBackend, 1>(phi.to_vec(), [phi.len()]);
    let slope = numbers(softness.family.density(phi, tensor(vec![0.0], [1])));
    // A flat one has no scale; any finite number will do.
    0.25 / slope[0].abs().max(1e-12)
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
        ] {
            assert_eq!(shipped(command, line), learned, "{command:?} {line}");
        }
        assert_eq!(shipped(Command::Solve, "--variant transfer"), ("learned".into(), None));
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
        let Surrogate { softness, phi } = method.surrogate().unwrap();
        assert_eq!((softness.family, &phi[..]), (Family::Gauss, &[0.1f64.ln()][..]));
        assert_eq!((method.name(), method.parameters()), ("gauss with surrogate", 2));
        let settings = method.settings(10, serde_json::json!({ "mesh": "fox" }));
        assert!((settings["surrogate_scale"].as_f64().unwrap() - 0.1).abs() < 1e-12);
        assert_eq!((&settings["surrogate"], &settings["mesh"]), (&"gauss".into(), &"fox".into()));
    }

    #[test]
    fn a_learned_softness_that_is_not_there_or_not_alone_is_refused() {
        for (task, line, part) in [
            ("none", "--softness learned", "no softness learned on none comes with the program"),
            ("example", "--softness learned --scale 0.1", "holds its own parameters"),
        ] {
            let defaults = Defaults { task, ..DEFAULTS };
            let error = Method::new(&settings(line), &defaults).unwrap_err();
            assert!(matches!(error.downcast_ref(), Some(Error::Usage(_))));
            assert!(error.to_string().contains(part), "{error}");
        }
    }

    #[test]
    fn a_run_of_one_step_has_the_first_scale() {
        let path = Path::Scale { first: 0.1, last: 0.001 };
        let softness = EdgeSoftness { family: Family::Gauss, squared: false };
        let backend = BackendChoice::NdArray;
        let name = "gauss".to_owned();
        let (surrogate, learning_rate, note) = (None, None, None);
        let method = Method { softness, name, path, surrogate, learning_rate, note, backend };
        assert_eq!(method.scale(0, 1), 0.1);
    }
}
