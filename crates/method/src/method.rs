use softrast_raster::{BackendChoice, HostBackend, Rasterizer};
use softrast_runner::{Error, Resolution, Schedule, Settings, SoftnessChoice};
use softrast_softness::{EdgeSoftness, Family, ScalePath, Softness, SoftnessFile};

use crate::{Defaults, Searched, backend::backend, numbers, tensor};

/// A softness and how its scale moves over the steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    softness: EdgeSoftness,
    name: String,
    path: Path,
    searched: Option<&'static Searched>,
    drawn: Drawn,
}

/// What it is drawn on, and how finely.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Drawn {
    backend: BackendChoice,
    resolution: Resolution,
    tolerance: f64,
}

#[derive(Clone, Debug, PartialEq)]
enum Path {
    /// Parameters of a file, and a scale that stands for them.
    Fixed { phi: Vec<f64>, scale: f64 },
    /// Parameters of a file at scale 1, the scale that stands for them alone, and the scale over a
    /// run on images of this size.
    Learned { phi: Vec<f64>, unit: f64, path: ScalePath, size: usize },
    /// The default parameters of the family at a scale that goes geometrically from the first to
    /// the last.
    Scale { first: f64, last: f64 },
}

impl Method {
    /// The method that the command line asks for; by default a logistic.
    ///
    /// A scale without an end or a schedule stays as it is. With `--squared` the default scales are
    /// squared, so that they mean the same widths.
    ///
    /// # Errors
    ///
    /// If a softness file cannot be used, flags contradict each other, the image cannot have that
    /// resolution, or there is no such backend or no adapter for it.
    pub fn new(settings: &Settings, defaults: &Defaults) -> anyhow::Result<Self> {
        // Before the first tensor.
        let backend = backend(settings, defaults.backends)?;
        let size = settings.size.unwrap_or(defaults.size);
        let resolution = settings.resolution.unwrap_or_default();
        resolution.check(size)?;
        let tolerance = settings.tolerance.unwrap_or(Rasterizer::TOLERANCE);
        let drawn = Drawn { backend, resolution, tolerance };
        let scaled = settings.scale.is_some() || settings.scale_end.is_some() || settings.squared;
        match &settings.softness {
            Some(SoftnessChoice::File(file)) => {
                if scaled || settings.schedule == Some(Schedule::Decay) {
                    let message = "a softness file holds its own parameters: leave out --scale, \
                                   --scale-end, --squared and --schedule decay, or name a family";
                    return Err(Error::Usage(message.into()).into());
                }
                let SoftnessFile { softness, phi, path, .. } = SoftnessFile::load(file)?;
                let unit = nominal_scale(softness, &phi);
                let path = match path {
                    None => Path::Fixed { scale: unit, phi },
                    Some(path) => Path::Learned { phi, unit, path, size },
                };
                let name = file.display().to_string();
                Ok(Self { softness, name, path, searched: None, drawn })
            }
            named => {
                let name = match named {
                    Some(SoftnessChoice::Named(name)) => name,
                    _ => "logistic",
                };
                let family: Family = name.parse()?;
                let softness = EdgeSoftness { family, squared: settings.squared };
                let schedule = asked_schedule(settings);
                // Found together, so taken whole or not at all.
                let usual = defaults.schedule;
                let known = Searched::of(defaults.task, family.name(), schedule, usual);
                let searched = known.filter(|_| !scaled);
                let path = scale_path(settings, &searched.map_or(*defaults, |s| defaults.with(s)));
                Ok(Self { softness, name: family.name().to_owned(), path, searched, drawn })
            }
        }
    }

    /// What was searched for this family on the task, under the same schedule.
    pub fn searched(&self) -> Option<&'static Searched> {
        self.searched
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
        self.drawn.backend
    }

    /// How many pixels a side the image has that is optimised on.
    pub fn resolution(&self) -> Resolution {
        self.drawn.resolution
    }

    /// What draws images of `size` × `size` pixels.
    pub fn rasterizer(&self, size: usize) -> Rasterizer {
        Rasterizer { tolerance: self.drawn.tolerance, ..Rasterizer::new(size) }
    }

    /// Pixels a side of the image that is optimised on at this scale, where that which judges has
    /// `size`.
    pub fn side(&self, size: usize, scale: f64) -> usize {
        let scale = match self.path {
            Path::Learned { unit, .. } => unit * scale,
            Path::Fixed { .. } | Path::Scale { .. } => scale,
        };
        let width = if self.softness.squared { scale.sqrt() } else { scale };
        self.drawn.resolution.side(size, width)
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

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    const DEFAULTS: Defaults = Defaults {
        task: "none",
        schedule: Schedule::Decay,
        decay: [0.03, 0.002],
        fixed: 0.002,
        size: 64,
        backends: softrast_raster::compiled_backends!(),
    };

    /// First, middle and last scale of the method that a command line gives.
    fn scales(line: &str) -> [f64; 3] {
        #[derive(Parser)]
        struct Line {
            #[command(flatten)]
            settings: Settings,
        }
        let words = ["task"].into_iter().chain(line.split_whitespace());
        let method = Method::new(&Line::parse_from(words).settings, &DEFAULTS).unwrap();
        [0, 50, 101].map(|step| method.scale(step, 101))
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
    fn a_run_of_one_step_has_the_first_scale() {
        let path = Path::Scale { first: 0.1, last: 0.001 };
        let softness = EdgeSoftness { family: Family::Gauss, squared: false };
        let drawn = Drawn {
            backend: BackendChoice::NdArray,
            resolution: Resolution::Full,
            tolerance: Rasterizer::TOLERANCE,
        };
        let method = Method { softness, name: "gauss".into(), path, searched: None, drawn };
        assert_eq!(method.scale(0, 1), 0.1);
    }
}
