use std::sync::Arc;

use burn::tensor::Tensor;
use softrast_raster::{RasterBackend, Rasterizer};
use softrast_runner::{Input, Order, Plan, Referee, Variant};
use softrast_softness::{
    EdgeSoftness, Family, ScaleSchedule, ScheduledSoftness, Softness, Surrogate,
};

use crate::{
    Method, PreparedRun, method_of_flags::usage, numbers, prepared_run::DrawnAndFelt, tensor,
};

/// A scale may fall by this factor before support and knots are chosen anew, which costs as much here
/// as drawing several images.
const STALE: f64 = 0.85;
/// Least share of a scale that stands above the floor where a path starts.
const ABOVE_FLOOR: f64 = 0.05;

/// The softness of edges as something to learn.
///
/// What is learned is one vector: the parameters of a softness that stays as it is; or, where its
/// scale moves or is learned apart ([`Input::Relative`]), first the knots of a [`ScaleSchedule`], then the
/// parameters at scale 1 without the logarithm of the scale, which the path replaces. Those of a
/// [`Surrogate`] come last, whole, as it keeps a ratio to the path that is its own.
#[derive(Clone, Debug)]
pub struct LearnedEdge {
    pub(crate) softness: EdgeSoftness,
    /// Parameters to start from; at scale 1 where there is a path.
    phi: Vec<f64>,
    pub(crate) path: Option<ScaleSchedule>,
    /// At scale 1 where there is a path.
    pub(crate) surrogate: Option<Surrogate>,
    pub(crate) steps: usize,
    pub(crate) size: usize,
    pub(crate) tolerance: f64,
    variant: Variant,
    task: &'static str,
}

impl LearnedEdge {
    /// Begins with what `method` does on runs of `steps` steps and images of `size` × `size` pixels.
    pub fn new(method: &Method, plan: &Plan, steps: usize, size: usize) -> Self {
        let softness = method.softness();
        let (tolerance, variant, task) =
            (method.learning_tolerance(plan.order), plan.variant, method.task);
        if method.is_static() && plan.input == Input::Ndc {
            let scale = method.scale(0, steps);
            let (phi, surrogate, path) = (method.phi(scale), method.surrogate(scale), None);
            return Self { softness, phi, path, surrogate, steps, size, tolerance, variant, task };
        }
        let mut path = ScaleSchedule { knots: Vec::new(), floor_px: plan.floor_px };
        let floor = path.floor(softness, size);
        let knots = if method.is_static() { 1 } else { plan.knots };
        let last = knots.max(2) - 1;
        path.knots = (0..knots)
            .map(|k| {
                let step = (steps.saturating_sub(1) * k).div_ceil(last);
                let scale = method.scale(step, steps);
                (scale - floor).max(ABOVE_FLOOR * scale).ln()
            })
            .collect();
        let (phi, surrogate, path) = (method.unit_phi(), method.unit_surrogate(), Some(path));
        Self { softness, phi, path, surrogate, steps, size, tolerance, variant, task }
    }

    /// Refuses a plan that this softness cannot be learned by.
    ///
    /// A surrogate replaces the derivative of the image, so what needs that derivative itself is at odds
    /// with it.
    ///
    /// # Errors
    ///
    /// A usage error.
    pub fn suits(&self, plan: &Plan) -> anyhow::Result<()> {
        let differentiates = plan.order == Order::Joint || plan.referee == Referee::Own;
        if self.surrogate.is_some() && differentiates {
            return Err(usage(
                "a surrogate is learned with --order unrolled, truncated:K or es and --referee fixed: \
                 all else follows the image's own derivative, which it replaces",
            ));
        }
        Ok(())
    }

    /// The vector that learning starts from.
    pub fn start(&self) -> Vec<f64> {
        let knots = self.path.iter().flat_map(|path| &path.knots);
        let felt = self.surrogate.iter().flat_map(|felt| &felt.phi);
        knots.chain(&self.phi[self.fixed()..]).chain(felt).copied().collect()
    }

    /// Length of the learned vector.
    pub fn parameters(&self) -> usize {
        self.shown() + self.surrogate.as_ref().map_or(0, |felt| felt.phi.len())
    }

    /// How many of the leading entries of the learned vector the image depends on.
    fn shown(&self) -> usize {
        self.knots() + self.phi.len() - self.fixed()
    }

    /// Softness and parameters `[P]` at an inner step, from the learned vector.
    pub fn phi<B: RasterBackend>(&self, learned: &Tensor<B, 1>, step: usize) -> Tensor<B, 1> {
        let Some(scale) = self.scale_tensor(learned, step) else {
            return learned.clone().narrow(0, 0, self.shown());
        };
        let (knots, fixed) = (self.knots(), self.fixed());
        let mut parts = vec![tensor(self.phi[..fixed].to_vec(), [fixed])];
        if self.phi.len() > fixed {
            parts.push(learned.clone().narrow(0, knots, self.phi.len() - fixed));
        }
        parts.retain(|part| part.dims() != [0]);
        self.softness.with_scale(Tensor::cat(parts, 0), scale)
    }

    /// The surrogate and its parameters `[P]` at an inner step, from the learned vector.
    pub(crate) fn felt<B: RasterBackend>(
        &self,
        learned: &Tensor<B, 1>,
        step: usize,
    ) -> Option<(EdgeSoftness, Tensor<B, 1>)> {
        let Surrogate { softness, phi } = self.surrogate.as_ref()?;
        let own = learned.clone().narrow(0, self.shown(), phi.len());
        let phi = match self.scale_tensor(learned, step) {
            None => own,
            Some(scale) => softness.with_scale(own, scale),
        };
        Some((*softness, phi))
    }

    /// Which softness the parameters belong to.
    pub fn softness(&self) -> EdgeSoftness {
        self.softness
    }

    /// Prepares silhouettes of meshes with these faces for all steps of a run near `learned`.
    pub fn prepare<B: RasterBackend>(
        &self,
        rasterizer: Rasterizer,
        faces: &Arc<[[u32; 3]]>,
        learned: &[f64],
    ) -> PreparedRun {
        let learned = tensor::<B, 1>(learned.to_vec(), [learned.len()]);
        let mut silhouettes: Vec<DrawnAndFelt> = Vec::new();
        let (mut of_step, mut prepared) = (Vec::new(), f64::NAN);
        for step in 0..=self.steps {
            let scale = self.scale(&learned, step);
            // Not a number at first, which is in no range.
            if !(STALE..=1.0).contains(&(scale / prepared)) {
                let phi = self.phi(&learned, step);
                let drawn = rasterizer.prepare(faces, self.softness, &phi);
                let felt = self.felt(&learned, step);
                let felt = felt.map(|(softness, phi)| rasterizer.prepare(faces, softness, &phi));
                silhouettes.push(DrawnAndFelt { drawn, felt });
                prepared = scale;
            }
            of_step.push(silhouettes.len() - 1);
        }
        PreparedRun::new(silhouettes, of_step)
    }

    /// The file `softness.json` of a vector that was learned at a learning rate of the inner loops:
    /// name and text. It has the rate if that is one for the original variant.
    ///
    /// # Errors
    ///
    /// If the vector is not what a file may hold.
    pub fn files(
        &self,
        learned: &[f64],
        learning_rate: f64,
        note: &str,
    ) -> anyhow::Result<Vec<(&'static str, String)>> {
        let (shown, felt) = learned.split_at(self.shown());
        let (knots, own) = shown.split_at(self.knots());
        let phi = self.phi[..self.fixed()].iter().chain(own).copied().collect();
        let path = self.path.as_ref().map(|path| ScaleSchedule { knots: knots.to_vec(), ..*path });
        let (softness, note) = (self.softness, Some(note.to_owned()));
        let learning_rate = Some(learning_rate).filter(|_| self.variant == Variant::Original);
        let surrogate = self.surrogate.as_ref();
        let surrogate = surrogate.map(|s| Surrogate { softness: s.softness, phi: felt.to_vec() });
        let task = Some(self.task.to_owned());
        let file = ScheduledSoftness {
            softness,
            phi,
            schedule: path,
            surrogate,
            learning_rate,
            task,
            note,
        };
        let name = "softness.json";
        Ok(vec![(name, file.text(name.as_ref())?)])
    }

    pub(crate) fn scale<B: RasterBackend>(&self, learned: &Tensor<B, 1>, step: usize) -> f64 {
        self.scale_tensor(learned, step).map_or(1.0, |scale| numbers(scale)[0])
    }

    /// The scale `[1]` at an inner step, if there is a path.
    fn scale_tensor<B: RasterBackend>(
        &self,
        learned: &Tensor<B, 1>,
        step: usize,
    ) -> Option<Tensor<B, 1>> {
        let path = self.path.as_ref()?;
        let floor = path.floor(self.softness, self.size);
        let knots = learned.clone().narrow(0, 0, self.knots());
        Some(ScaleSchedule::scale(&knots, floor, ScaleSchedule::part(step, self.steps)))
    }

    /// Steps with the same number have the same softness.
    pub fn stage(&self, step: usize) -> usize {
        if self.knots() > 1 { step } else { 0 }
    }

    fn knots(&self) -> usize {
        self.path.as_ref().map_or(0, |path| path.knots.len())
    }

    /// Leading parameters that a path replaces.
    fn fixed(&self) -> usize {
        usize::from(self.path.is_some() && self.softness.family != Family::Mlp)
    }
}
