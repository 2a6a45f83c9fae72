use std::sync::Arc;

use serde::{Deserialize, Serialize};
use softrast_raster::{SoftRenderer, low_level::Rasterizer};
use softrast_softness::{EdgeSoftness, Softness, ln_scale};

use super::{adaptive::AdaptiveSchedule, scale_schedule::ScaleSchedule};

/// A second softness whose slope replaces that of the first in the backward pass: a surrogate gradient.
///
/// The image is that of the first softness: a sharp image with a surrogate gradient, which is not the derivative of the
/// image. If the scale of the first follows a [`ScaleSchedule`], this one is evaluated at `d / scale(t)` too: it keeps
/// its ratio to the first.
///
/// ```
/// use softrast_inverse::{ScheduledSoftness, Surrogate};
/// use softrast_softness::{EdgeSoftness, Family, Softness};
///
/// let edge = EdgeSoftness::new(Family::Logistic);
/// let softness = ScheduledSoftness::decay(edge, 0.5, 0.125).with_surrogate_scale(1.0);
/// let Surrogate { softness: wide, phi } = softness.surrogate_at(1.0, 64).unwrap();
/// assert!((softness.width_at(1.0, 64) - 0.125).abs() < 1e-12 && (wide.scale(&phi) - 0.25).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Surrogate<S = EdgeSoftness> {
    /// The softness.
    pub softness: S,
    /// Its parameters φ; their number is [`Softness::parameters`].
    pub phi: Vec<f64>,
}

/// A softness with its parameters and the schedule of its scale.
///
/// In a JSON file its fields have these names; `path` and `feedback` are
/// older names of `schedule` and `adaptive`. A file of a
/// custom softness has its [`NAME`](crate::NamedSoftness::NAME) in the field `softness`.
///
/// ```
/// use softrast_inverse::ScheduledSoftness;
///
/// let learned = ScheduledSoftness::learned("pose")?;
/// assert!(learned.scale_at(1.0, 64) < learned.scale_at(0.0, 64));
/// assert!(ScheduledSoftness::learned_names().any(|name| name == "pose"));
/// # Ok::<(), softrast_inverse::SoftnessFileError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound(deserialize = "S: Deserialize<'de>"))]
pub struct ScheduledSoftness<S = EdgeSoftness> {
    /// The softness.
    pub softness: S,
    /// Its parameters φ; their number is [`Softness::parameters`].
    pub phi: Vec<f64>,
    /// Schedule of its width; without one the width is fixed.
    #[serde(alias = "path", default, skip_serializing_if = "Option::is_none")]
    pub schedule: Option<ScaleSchedule>,
    /// Adaptive schedule; without it, progress follows time.
    #[serde(alias = "feedback", default, skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<AdaptiveSchedule>,
    /// Surrogate of the gradient, if that is not the softness's own; it follows the same schedule.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surrogate: Option<Surrogate<S>>,
    /// Learning rate of the optimisations that it was learned on, which suits it best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub learning_rate: Option<f64>,
    /// Factor of the learning rate at the end of a run, in (0, 1], reached geometrically. An adaptive schedule has its own factor instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_end: Option<f64>,
    /// The task that it was learned on; without one, the learning rate applies to any task.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// Origin of the parameters, in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

impl<S: Softness> ScheduledSoftness<S> {
    /// A softness with a fixed `scale`, in NDC (NDC² if squared).
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    pub fn constant(softness: S, scale: f64) -> Self {
        Self::new(softness, scale, None)
    }

    /// A softness whose scale goes geometrically from `first` to `last`, in NDC (NDC² if squared);
    /// fixed if both are equal.
    ///
    /// # Panics
    ///
    /// If one of the scales is not positive.
    pub fn decay(softness: S, first: f64, last: f64) -> Self {
        let mut knots = vec![ln_scale(first), ln_scale(last)];
        knots.dedup();
        Self::new(softness, 1.0, Some(ScaleSchedule { knots, floor_px: 0.0 }))
    }

    fn new(softness: S, scale: f64, schedule: Option<ScaleSchedule>) -> Self {
        let phi = softness.default_phi(scale);
        let (adaptive, surrogate, task, note) = (None, None, None, None);
        let (learning_rate, rate_end) = (None, None);
        Self { softness, phi, schedule, adaptive, surrogate, learning_rate, rate_end, task, note }
    }

    /// Adds the same softness at `scale`, in NDC (NDC² if squared), as surrogate.
    ///
    /// With a moving scale, this is the surrogate's first scale; the floor of the schedule is
    /// excluded from the ratio of both, as it depends on the size of the image.
    ///
    /// # Panics
    ///
    /// If `scale` is not positive.
    #[must_use]
    pub fn with_surrogate_scale(self, scale: f64) -> Self {
        let first = self.schedule.as_ref().map_or(1.0, |schedule| schedule.at(0.0, 0.0));
        let phi = self.softness.default_phi(scale / first);
        let softness = self.softness.clone();
        Self { surrogate: Some(Surrogate { softness, phi }), ..self }
    }

    /// Whether the width is fixed.
    pub fn is_constant(&self) -> bool {
        self.schedule.as_ref().is_none_or(|schedule| schedule.knots.len() == 1)
    }

    /// Number of free parameters: φ, that of the surrogate, the knots of the schedule, which
    /// replace a family's own scale, and those of the adaptive schedule.
    pub fn parameters(&self) -> usize {
        let replaced = self.softness.logarithms().min(1);
        let knots = self.schedule.as_ref().map_or(0, |schedule| schedule.knots.len() - replaced);
        let adaptive = self.adaptive.map_or(0, |_| AdaptiveSchedule::PARAMETERS);
        self.phi.len() + knots + adaptive + self.surrogate.as_ref().map_or(0, |of| of.phi.len())
    }

    /// The scale of the schedule at `progress` of a run, 0 to 1, on images of `size` × `size` pixels;
    /// without a schedule that of the softness. In NDC (NDC² if squared).
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1].
    pub fn scale_at(&self, progress: f64, size: usize) -> f64 {
        self.factor_at(progress, size).unwrap_or_else(|| self.softness.scale(&self.phi))
    }

    /// The width of the soft edge at `progress` of a run, 0 to 1, in NDC, on images of `size` × `size`
    /// pixels.
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1].
    pub fn width_at(&self, progress: f64, size: usize) -> f64 {
        self.softness.width(&self.phi_at(progress, size))
    }

    /// Parameters of the softness at `progress` of a run, 0 to 1, on images of `size` × `size` pixels.
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1].
    pub fn phi_at(&self, progress: f64, size: usize) -> Vec<f64> {
        scaled(&self.softness, &self.phi, self.factor_at(progress, size))
    }

    /// The surrogate at `progress` of a run, 0 to 1, on images of `size` × `size` pixels.
    ///
    /// # Panics
    ///
    /// If `progress` is not in [0, 1].
    pub fn surrogate_at(&self, progress: f64, size: usize) -> Option<Surrogate<S>> {
        let Surrogate { softness, phi } = self.surrogate.as_ref()?;
        let phi = scaled(softness, phi, self.factor_at(progress, size));
        Some(Surrogate { softness: softness.clone(), phi })
    }

    /// A renderer with this softness at `progress` of a run, 0 to 1, and its surrogate, if it has one.
    ///
    /// # Panics
    ///
    /// If `faces` or the image is empty, or `progress` is not in [0, 1].
    pub fn renderer_at(
        &self,
        progress: f64,
        rasterizer: Rasterizer,
        faces: Arc<[[u32; 3]]>,
    ) -> SoftRenderer<S> {
        let size = rasterizer.size.shorter();
        let phi = self.phi_at(progress, size);
        let renderer = SoftRenderer::with_rasterizer(rasterizer, faces, self.softness.clone(), phi);
        match self.surrogate_at(progress, size) {
            Some(Surrogate { softness, phi }) => renderer.with_surrogate_phi(softness, phi),
            None => renderer,
        }
    }

    /// The schedule's factor of the scale of the parameters.
    fn factor_at(&self, progress: f64, size: usize) -> Option<f64> {
        let schedule = self.schedule.as_ref()?;
        Some(schedule.at(schedule.floor(&self.softness, size), progress))
    }
}

impl<S> ScheduledSoftness<S> {
    /// This value with each softness replaced by `softness` of it.
    pub(super) fn map<T>(self, softness: impl Fn(S) -> T) -> ScheduledSoftness<T> {
        let of =
            |found: Surrogate<S>| Surrogate { softness: softness(found.softness), phi: found.phi };
        ScheduledSoftness {
            surrogate: self.surrogate.map(of),
            softness: softness(self.softness),
            phi: self.phi,
            schedule: self.schedule,
            adaptive: self.adaptive,
            learning_rate: self.learning_rate,
            rate_end: self.rate_end,
            task: self.task,
            note: self.note,
        }
    }
}

fn scaled(softness: &impl Softness, phi: &[f64], factor: Option<f64>) -> Vec<f64> {
    factor.map_or_else(|| phi.to_vec(), |factor| softness.with_scale_values(phi, factor))
}
