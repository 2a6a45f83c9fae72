use serde_json::{Map, Value};
use softrast_raster::{BackendChoice, HostBackend, Rasterizer};
use softrast_runner::{Order, Resolution, usual_tolerance};
use softrast_softness::{EdgeSoftness, Family, ScaleSchedule, Softness, Surrogate};

use crate::{LEARNING_TOLERANCE, numbers, tensor};

/// A softness and how its scale moves over the steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    pub(crate) softness: EdgeSoftness,
    pub(crate) name: String,
    pub(crate) path: Path,
    /// At scale 1, unless the parameters are fixed.
    pub(crate) surrogate: Option<Surrogate>,
    pub(crate) learning_rate: Option<f64>,
    /// The task that it was made for.
    pub(crate) task: &'static str,
    pub(crate) note: Option<String>,
    pub(crate) drawn: Drawn,
}

/// What it is drawn on, and how finely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Drawn {
    pub(crate) backend: BackendChoice,
    pub(crate) resolution: Resolution,
    /// If one was asked for.
    pub(crate) tolerance: Option<f64>,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Path {
    /// Parameters of a file, and a scale that stands for them.
    Fixed { phi: Vec<f64>, scale: f64 },
    /// Parameters of a file at scale 1, the scale that stands for them alone, and the scale over a
    /// run on images of this size.
    Learned { phi: Vec<f64>, unit: f64, path: ScaleSchedule, size: usize },
    /// A scale that goes geometrically from the first to the last, and parameters at scale 1 where they
    /// are not the family's default.
    Scale { first: f64, last: f64, unit: Option<Vec<f64>> },
}

impl Method {
    /// The learning rate that belongs to the softness: the one it was searched for with or learned at, on the
    /// original variant.
    pub fn learning_rate(&self) -> Option<f64> {
        self.learning_rate
    }

    /// What the gradient is taken of at `scale`, where that is not the softness itself: it keeps its
    /// ratio to it.
    pub fn surrogate(&self, scale: f64) -> Option<Surrogate> {
        let Surrogate { softness, phi } = self.surrogate.clone()?;
        let phi = match self.path {
            Path::Fixed { .. } => phi,
            Path::Learned { .. } | Path::Scale { .. } => widened(softness, &phi, scale),
        };
        Some(Surrogate { softness, phi })
    }

    /// The same without a surrogate, for scenes in which no edge moves, so that no gradient goes through one.
    pub fn without_surrogate(self) -> Self {
        Self { surrogate: None, ..self }
    }

    /// The surrogate at scale 1, for a path of scales.
    pub(crate) fn unit_surrogate(&self) -> Option<Surrogate> {
        let Surrogate { softness, phi } = self.surrogate.clone()?;
        let phi = match self.path {
            Path::Fixed { scale, .. } => widened(softness, &phi, scale.recip()),
            Path::Learned { .. } | Path::Scale { .. } => phi,
        };
        Some(Surrogate { softness, phi })
    }

    /// How many parameters the softness and its surrogate have, a learned path of its scale included.
    pub fn parameters(&self) -> usize {
        let felt = self.surrogate.as_ref().map_or(0, |felt| felt.phi.len());
        let path = match &self.path {
            // It replaces the scale of a family.
            Path::Learned { path, .. } => {
                path.knots.len() - usize::from(self.softness.family != Family::Mlp)
            }
            Path::Fixed { .. } | Path::Scale { .. } => 0,
        };
        self.softness.parameters() + path + felt
    }

    /// The settings of a task, and with them how the softness moves over `steps` steps and where it
    /// comes from, for [`Description::settings`](softrast_runner::Description::settings).
    pub fn settings(&self, steps: usize, of_task: Value) -> Map<String, Value> {
        let mut settings = of_task.as_object().cloned().unwrap_or_default();
        let schedule = if self.is_static() { "static" } else { "decay" };
        settings.insert("schedule".into(), schedule.into());
        let ends = [self.scale(0, steps), self.scale(steps, steps)];
        settings.insert("scale".into(), ends[0].into());
        settings.insert("scale_end".into(), ends[1].into());
        settings.insert("squared".into(), self.softness.squared.into());
        let names = ["surrogate_scale", "surrogate_scale_end"];
        for (name, felt) in names.into_iter().zip(ends.map(|scale| self.surrogate(scale))) {
            let Some(Surrogate { softness, phi }) = felt else { continue };
            settings.insert("surrogate".into(), softness.family.name().into());
            settings.insert(name.into(), softness.scale(&phi).into());
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
        self.drawn.backend
    }

    /// How many pixels a side the image has that is optimised on.
    pub fn resolution(&self) -> Resolution {
        self.drawn.resolution
    }

    /// What draws images of `size` × `size` pixels.
    pub fn rasterizer(&self, size: usize) -> Rasterizer {
        Rasterizer { tolerance: self.tolerance(), ..Rasterizer::new(size) }
    }

    /// The largest error of a pixel by leaving out faces that are far from it.
    pub fn tolerance(&self) -> f64 {
        self.drawn.tolerance.unwrap_or(usual_tolerance(!self.is_static()))
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
            Path::Scale { first, last, .. } => first == last,
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
                numbers(ScaleSchedule::scale(&knots, floor, ScaleSchedule::part(step, steps)))[0]
            }
            Path::Scale { first, last, .. } => {
                first * (last / first).powf(ScaleSchedule::part(step, steps))
            }
        }
    }

    /// [`Method::tolerance`] while the softness is learned: unless asked for, at most
    /// [`LEARNING_TOLERANCE`](crate::LEARNING_TOLERANCE) where the order takes derivatives.
    pub(crate) fn learning_tolerance(&self, order: Order) -> f64 {
        match order {
            Order::Es(_) => self.tolerance(),
            _ => self.drawn.tolerance.unwrap_or(self.tolerance().min(LEARNING_TOLERANCE)),
        }
    }

    /// Parameters of the softness at this scale; a file's without a path are its own whatever the scale.
    pub fn phi(&self, scale: f64) -> Vec<f64> {
        match &self.path {
            Path::Fixed { phi, .. } => phi.clone(),
            Path::Learned { phi, .. } | Path::Scale { unit: Some(phi), .. } => {
                self.widened(phi, scale)
            }
            Path::Scale { unit: None, .. } => self.softness.default_phi(scale),
        }
    }

    /// Parameters at scale 1, for a path of scales.
    pub(crate) fn unit_phi(&self) -> Vec<f64> {
        match &self.path {
            Path::Fixed { phi, scale } => self.widened(phi, scale.recip()),
            Path::Learned { phi, .. } | Path::Scale { unit: Some(phi), .. } => phi.clone(),
            Path::Scale { unit: None, .. } => self.softness.default_phi(1.0),
        }
    }

    fn widened(&self, phi: &[f64], scale: f64) -> Vec<f64> {
        widened(self.softness, phi, scale)
    }
}

fn widened(softness: EdgeSoftness, phi: &[f64], scale: f64) -> Vec<f64> {
    let phi = tensor::<HostBackend, 1>(phi.to_vec(), [phi.len()]);
    numbers(softness.with_scale(phi, tensor(vec![scale], [1])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_of_one_step_has_the_first_scale() {
        let path = Path::Scale { first: 0.1, last: 0.001, unit: None };
        let softness = EdgeSoftness { family: Family::Gauss, squared: false };
        let drawn = Drawn {
            backend: BackendChoice::NdArray,
            resolution: Resolution::Full,
            tolerance: None,
        };
        let name = "gauss".to_owned();
        let (surrogate, learning_rate, task, note) = (None, None, "none", None);
        let method = Method { softness, name, path, surrogate, learning_rate, task, note, drawn };
        assert_eq!(method.scale(0, 1), 0.1);
        assert_eq!(method.rasterizer(8).tolerance, 1e-2);
        assert_eq!(method.learning_tolerance(Order::Unrolled), LEARNING_TOLERANCE);
        assert_eq!(method.learning_tolerance(Order::Es(0.2)), 1e-2);
        let path = Path::Scale { first: 0.1, last: 0.1, unit: None };
        let method = Method { path, ..method };
        assert_eq!(method.rasterizer(8).tolerance, Rasterizer::TOLERANCE);
        assert_eq!(method.learning_tolerance(Order::Unrolled), Rasterizer::TOLERANCE);
    }
}
