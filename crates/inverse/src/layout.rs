use softrast_raster::RasterBackend;
use softrast_softness::{EdgeSoftness, Softness};
use softrast_tensor::{Tensor, tensor, vector};

use crate::{AdaptiveSchedule, Input, LearnConfig, ScaleSchedule, ScheduledSoftness, Surrogate};

/// Least share of a scale above the floor at the start of a learned schedule.
const ABOVE_FLOOR: f64 = 0.05;
/// Default floor of a learned scale, in pixels, and default number of knots of a learned schedule.
const FLOOR_PX: f64 = 0.03;
const KNOTS: usize = 3;

/// Layout of the vector φ that represents a softness, and so can be learned.
///
/// First come the knots of the schedule, if the scale moves or is learned separately. Then the parameters of the softness, at scale 1 and
/// without the logarithm of the scale if a schedule replaces it. Then all parameters of the surrogate, which keeps its own ratio to the
/// schedule. Then those of the adaptive schedule. Last come the problem's own parameters.
///
/// ```
/// use softrast_inverse::{PhiLayout, ScheduledSoftness};
/// use softrast_softness::{EdgeSoftness, Family};
///
/// // φ of an Exp is the logarithm of its scale and a shift.
/// let exp = EdgeSoftness::new(Family::Exp);
/// let softness = ScheduledSoftness::decay(exp, 0.5, 0.125).with_surrogate_scale(1.0);
/// let layout = PhiLayout::new(softness, vec![7.0], 300, 64);
/// let [first, last, ratio] = [0.5_f64, 0.125, 2.0].map(f64::ln);
/// //                           knots     shift, surrogate, own
/// assert_eq!(layout.start(), [first, last, 0.0, ratio, 0.0, 7.0]);
/// let (learned, own) = layout.softness(&[first, first, 0.3, ratio, 0.0, 8.0]);
/// assert!((learned.scale_at(1.0, 64) - 0.5).abs() < 1e-15 && own == [8.0]);
/// assert_eq!(learned.phi[1], 0.3);
/// ```
#[derive(Clone, Debug)]
pub struct PhiLayout<S = EdgeSoftness> {
    /// Parameters to start from, and the fields without parameters.
    start: ScheduledSoftness<S>,
    own: Vec<f64>,
    steps: usize,
    size: usize,
}

impl<S: Softness> PhiLayout<S> {
    /// The layout of a softness as it is, with the problem's `own` parameters, for runs of `steps`
    /// steps on images of `size` × `size` pixels.
    pub fn new(start: ScheduledSoftness<S>, own: Vec<f64>, steps: usize, size: usize) -> Self {
        Self { start, own, steps, size }
    }

    /// The layout of a softness to learn: a fixed scale is one of its parameters, or a schedule of
    /// one knot if `config` has [`Input::Relative`]; a moving scale is a schedule with a floor.
    pub fn learned(
        start: &ScheduledSoftness<S>,
        own: Vec<f64>,
        steps: usize,
        size: usize,
        config: &LearnConfig,
    ) -> Self {
        let (phi, surrogate) = (start.phi_at(0.0, size), start.surrogate_at(0.0, size));
        if start.is_constant() && config.input == Input::Ndc {
            let start = ScheduledSoftness { phi, surrogate, schedule: None, ..start.clone() };
            return Self::new(start, own, steps, size);
        }
        let begun = AdaptiveSchedule { steps, ..AdaptiveSchedule::START };
        let adaptive = start.adaptive.or(config.adaptive.then_some(begun));
        let kept = start.schedule.as_ref().filter(|kept| {
            kept.floor_px > 0.0
                && kept.knots.len() > 1
                && config.knots.is_none()
                && config.floor_px.is_none()
        });
        if kept.is_some() {
            return Self::new(ScheduledSoftness { adaptive, ..start.clone() }, own, steps, size);
        }
        let floor_px = config.floor_px.unwrap_or(FLOOR_PX);
        let mut schedule = ScaleSchedule { knots: Vec::new(), floor_px };
        let floor = schedule.floor(&start.softness, size);
        let knots = if start.is_constant() { 1 } else { config.knots.unwrap_or(KNOTS) };
        let last = knots.max(2) - 1;
        let knot = |k: usize| {
            let step = (steps.saturating_sub(1) * k).div_ceil(last);
            let scale = start.scale_at(ScaleSchedule::progress(step, steps), size);
            (scale - floor).max(ABOVE_FLOOR * scale).ln()
        };
        schedule.knots = (0..knots).map(knot).collect();
        let start =
            ScheduledSoftness { schedule: Some(schedule), adaptive, ..at_unit_scale(start) };
        Self::new(start, own, steps, size)
    }

    /// The vector at the start of learning.
    pub fn start(&self) -> Vec<f64> {
        let knots = self.start.schedule.iter().flat_map(|schedule| &schedule.knots);
        let surrogate = self.start.surrogate.iter().flat_map(|surrogate| &surrogate.phi);
        let phi = &self.start.phi[self.replaced()..];
        let adaptive = self.start.adaptive.iter().flat_map(AdaptiveSchedule::parameters);
        let edges = knots.chain(phi).chain(surrogate).copied();
        edges.chain(adaptive).chain(self.own.iter().copied()).collect()
    }

    /// The softness that a vector stands for, and the problem's own parameters.
    ///
    /// # Panics
    ///
    /// If the vector is shorter than [`start`](Self::start).
    pub fn softness(&self, learned: &[f64]) -> (ScheduledSoftness<S>, Vec<f64>) {
        let (knots, rest) = learned.split_at(self.knots());
        let (phi, rest) = rest.split_at(self.start.phi.len() - self.replaced());
        let (surrogate, rest) = rest.split_at(self.surrogate_len());
        let mut softness = self.start.clone();
        let mut own = rest;
        if let Some(adaptive) = &mut softness.adaptive {
            let (numbers, rest) =
                rest.split_first_chunk().expect("φ holds those of the adaptive schedule too");
            (*adaptive, own) = (adaptive.with(*numbers), rest);
        }
        softness.phi[self.replaced()..].copy_from_slice(phi);
        softness.schedule.iter_mut().for_each(|schedule| schedule.knots = knots.to_vec());
        softness.surrogate.iter_mut().for_each(|found| found.phi = surrogate.to_vec());
        (softness, own.to_vec())
    }

    /// The softness of edges.
    pub fn edge(&self) -> &S {
        &self.start.softness
    }

    /// Steps of a run.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Shorter side of the image, in pixels.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The progress of a run after `step` steps, 0 to 1.
    pub fn progress(&self, step: usize) -> f64 {
        ScaleSchedule::progress(step, self.steps)
    }

    /// Steps of one stage share a softness.
    pub fn stage(&self, step: usize) -> usize {
        if self.knots() > 1 { step.min(self.steps) } else { 0 }
    }

    /// Parameters of the softness of edges at a step, `[P]`.
    pub(crate) fn phi<B: RasterBackend>(
        &self,
        learned: &Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 1> {
        let (knots, replaced) = (self.knots(), self.replaced());
        let learned_phi = self.start.phi.len() - replaced;
        let Some(scale) = self.scale(learned, step) else {
            return learned.clone().narrow(0, 0, learned_phi);
        };
        let mut parts = Vec::new();
        if replaced > 0 {
            parts.push(vector(&self.start.phi[..replaced]));
        }
        if learned_phi > 0 {
            parts.push(learned.clone().narrow(0, knots, learned_phi));
        }
        self.edge().with_scale(Tensor::cat(parts, 0), scale)
    }

    /// Parameters of the surrogate at a step, `[P]`.
    pub(crate) fn surrogate<B: RasterBackend>(
        &self,
        learned: &Tensor<B, 1>,
        step: usize,
    ) -> Option<Tensor<B, 1>> {
        let Surrogate { softness, phi } = self.start.surrogate.as_ref()?;
        let before = self.knots() + self.start.phi.len() - self.replaced();
        let own = learned.clone().narrow(0, before, phi.len());
        Some(match self.scale(learned, step) {
            None => own,
            Some(scale) => softness.with_scale(own, scale),
        })
    }

    /// The problem's own parameters, `[P]`; possibly empty.
    pub(crate) fn own<B: RasterBackend>(&self, learned: &Tensor<B, 1>) -> Tensor<B, 1> {
        let [all] = learned.dims();
        match self.own.len() {
            0 => tensor(Vec::new(), [0]),
            own => learned.clone().narrow(0, all - own, own),
        }
    }

    /// The scale `[1]` at a step, if there is a schedule.
    fn scale<B: RasterBackend>(&self, learned: &Tensor<B, 1>, step: usize) -> Option<Tensor<B, 1>> {
        let schedule = self.start.schedule.as_ref()?;
        let floor = schedule.floor(self.edge(), self.size);
        let knots = learned.clone().narrow(0, 0, self.knots());
        Some(ScaleSchedule::scale(&knots, floor, self.progress(step)))
    }

    fn knots(&self) -> usize {
        self.start.schedule.as_ref().map_or(0, |schedule| schedule.knots.len())
    }

    fn surrogate_len(&self) -> usize {
        self.start.surrogate.as_ref().map_or(0, |surrogate| surrogate.phi.len())
    }

    /// Number of leading parameters that the schedule replaces.
    fn replaced(&self) -> usize {
        usize::from(self.start.schedule.is_some() && self.edge().logarithms() > 0)
    }
}

/// The softness with its parameters at scale 1, to combine with a schedule.
fn at_unit_scale<S: Softness>(softness: &ScheduledSoftness<S>) -> ScheduledSoftness<S> {
    let mut unit = softness.clone();
    if softness.schedule.is_none() {
        let factor = softness.softness.scale(&softness.phi).recip();
        unit.phi = softness.softness.with_scale_values(&softness.phi, factor);
        if let Some(Surrogate { softness, phi }) = &mut unit.surrogate {
            *phi = softness.with_scale_values(phi, factor);
        }
    }
    unit
}
