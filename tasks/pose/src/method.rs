use softrast_raster::DefaultBackend;
use softrast_runner::{Error, Schedule, Settings, SoftnessChoice};
use softrast_softness::{EdgeSoftness, Family, Softness, SoftnessFile};

use crate::scene::{numbers, tensor};

/// Scale of a static softness, in NDC.
const SCALE: f64 = 1e-2;
/// First and last scale of a decay, in NDC: it ends at a quarter of a pixel at size 64.
///
/// Source: META 6.6: with less, gradients depend on where the pixel centres happen to lie.
const DECAY: [f64; 2] = [0.1, 0.25 * 2.0 / 64.0];

/// A softness and how its scale moves over the steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    softness: EdgeSoftness,
    name: String,
    path: Path,
}

#[derive(Clone, Debug, PartialEq)]
enum Path {
    /// Parameters of a file, and a scale that stands for them.
    Fixed { phi: Vec<f64>, scale: f64 },
    /// The default parameters of the family at a scale that goes geometrically from the first to
    /// the last.
    Scale { first: f64, last: f64 },
}

impl Method {
    /// The method that the command line asks for; by default a logistic that stays as it is.
    ///
    /// Scales not given are in NDC; with `--squared` the same widths are squared.
    ///
    /// # Errors
    ///
    /// If a softness file cannot be used, or flags contradict each other.
    pub fn new(settings: &Settings) -> anyhow::Result<Self> {
        match &settings.softness {
            Some(SoftnessChoice::File(file)) => {
                let scaled = settings.scale.is_some() || settings.scale_end.is_some();
                if scaled || settings.squared || settings.schedule == Some(Schedule::Decay) {
                    return Err(usage(
                        "a softness file holds its own parameters: leave out --scale, --scale-end, \
                         --squared and --schedule decay, or name a family",
                    ));
                }
                let SoftnessFile { softness, phi, .. } = SoftnessFile::load(file)?;
                let scale = nominal_scale(softness, &phi);
                let name = file.display().to_string();
                Ok(Self { softness, name, path: Path::Fixed { phi, scale } })
            }
            named => {
                let name = match named {
                    Some(SoftnessChoice::Named(name)) => name,
                    _ => "logistic",
                };
                let family: Family = name.parse()?;
                let softness = EdgeSoftness { family, squared: settings.squared };
                let path = scale_path(settings);
                Ok(Self { softness, name: family.name().to_owned(), path })
            }
        }
    }

    /// Name of the family, or of the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The softness whose parameters [`Method::phi`] gives.
    pub fn softness(&self) -> EdgeSoftness {
        self.softness
    }

    /// Whether the scale moves.
    pub fn is_static(&self) -> bool {
        match self.path {
            Path::Fixed { .. } => true,
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
            Path::Scale { first, last } => {
                let last_step = steps.saturating_sub(1).max(1);
                let part = step.min(last_step) as f64 / last_step as f64;
                first * (last / first).powf(part)
            }
        }
    }

    /// Parameters of the softness at this scale; a file's are its own whatever the scale.
    pub fn phi(&self, scale: f64) -> Vec<f64> {
        match &self.path {
            Path::Fixed { phi, .. } => phi.clone(),
            Path::Scale { .. } => self.softness.default_phi(scale),
        }
    }
}

fn scale_path(settings: &Settings) -> Path {
    let unit = |scale: f64| if settings.squared { scale * scale } else { scale };
    let [first, last] = match settings.schedule {
        Some(Schedule::Decay) => DECAY.map(unit),
        _ => [unit(SCALE); 2],
    };
    let first = settings.scale.unwrap_or(first);
    let last = match settings.schedule {
        Some(Schedule::Decay) => settings.scale_end.unwrap_or(last.min(first)),
        _ => first,
    };
    Path::Scale { first, last }
}

/// The scale of a logistic with the same slope at the edge, for families without a scale of their
/// own; else the family's.
fn nominal_scale(softness: EdgeSoftness, phi: &[f64]) -> f64 {
    if softness.family != Family::Mlp {
        return phi[0].exp();
    }
    let phi = tensor::<DefaultBackend, 1>(phi.to_vec(), [phi.len()]);
    let slope = numbers(softness.family.density(phi, tensor(vec![0.0], [1])));
    // A flat one has no scale; any finite number will do.
    0.25 / slope[0].abs().max(1e-12)
}

fn usage(message: &str) -> anyhow::Error {
    Error::Usage(message.to_owned()).into()
}
