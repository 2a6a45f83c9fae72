use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use burn::{
    backend::Autodiff,
    tensor::{Tensor, TensorData, Transaction, backend::Backend},
};
use softrast_meta::{Adam, Optimizer};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer};
use softrast_softness::{Place, ScaleSchedule, numbers};

use crate::{InverseProblem, Method, PhiLayout, ScheduledRenderer, SolveConfig, problem::lowered};

/// Starts of a problem that a run with feedback goes through at most; then it begins again where it is.
const STARTS: usize = 8;

/// All instances after some steps.
#[derive(Clone, Debug)]
pub struct Iterate {
    /// Steps taken so far.
    pub step: usize,
    /// Scale of the softness, in NDC (NDC² if squared).
    pub scale: f64,
    /// The parameters of the scene, on the CPU, `[N]`.
    pub theta: Tensor<HostBackend, 1>,
    /// What is lowered, of each instance.
    pub loss: Vec<f64>,
    /// What is wrong with its soft image.
    pub soft_loss: Vec<f64>,
    /// What is wrong with its hard image at full size: what can be told without knowing the answer.
    pub hard_loss: Vec<f64>,
    /// The soft image of the first instance, at full size, where pictures are wanted: row by row, the views or channels one after the
    /// other.
    pub image: Option<Vec<f64>>,
    /// Time of the step that ended here, in seconds; none before the first.
    pub seconds: Option<f64>,
}

/// Goes down the gradient of a problem's loss from its start, all `instances` side by side: what it ends with.
///
/// It shows every iterate from the start to the end to `visit`, along with the scene on the CPU. `visit` does not count as time of a
/// step. Parameters without a gradient, as where nothing was drawn, stay as they are. Where the softness has feedback and a run is stuck, it
/// begins again from the next start of the problem, as the softness says.
///
/// # Errors
///
/// Those of `visit` and of the device, which end the descent; if there is no instance, or more than one where the softness has feedback:
/// each run goes its own way then.
pub fn minimize<P: InverseProblem, B: RasterBackend>(
    problem: &P,
    instances: &[P::Instance],
    method: &Method,
    config: &SolveConfig,
    pictures: bool,
    mut visit: impl FnMut(&Iterate, &P::Scene<HostBackend>) -> anyhow::Result<()>,
) -> anyhow::Result<Iterate> {
    ensure!(!instances.is_empty(), "there is no instance to solve");
    let SolveConfig { steps, learning_rate, .. } = *config;
    let feedback = method.softness.feedback;
    ensure!(
        instances.len() == 1 || feedback.is_none(),
        "a softness with feedback solves one instance at a time, found {} side by side: name another softness",
        instances.len()
    );
    let run = Run::<P, B>::new(problem, instances, method, config);
    // Time of drawing, and since when the step has gone on.
    let mut spent: Option<(Duration, Instant)> = None;
    let mut look = |step: usize, part: f64, leaf: Tensor<Autodiff<B>, 1>| {
        let seconds = spent.map(|(drawing, since)| (drawing + since.elapsed()).as_secs_f64());
        let clock = Instant::now();
        let seen = run.seen(part, leaf);
        // A GPU has only been asked so far, also for the end of the step before.
        B::sync(&seen.theta.device())?;
        let drawing = clock.elapsed();
        let loss = seen.loss.clone();
        let iterate = Iterate { seconds, ..run.read(step, part, seen, pictures)? };
        visit(&iterate, &run.host)?;
        spent = Some((drawing, Instant::now()));
        anyhow::Ok((loss, iterate))
    };
    let mut follower = feedback.map(|feedback| feedback.follow(steps));
    let by_time = |step| Place { part: ScaleSchedule::part(step, steps), rate: 1.0, again: false };
    let optimizer = problem.optimizer(learning_rate);
    let mut theta = problem.start(&run.scene).inner();
    let mut state = optimizer.init(&theta);
    let (mut place, mut error, mut starts) = (by_time(0), None, 1);
    for step in 0..steps {
        place = follower.as_mut().map_or_else(|| by_time(step), |run| run.next(error));
        if place.again {
            if let Some(other) = problem.restart(&instances[0], starts, STARTS) {
                theta = problem.start(&problem.scene::<B>(&[other], config.size));
            }
            (state, starts) = (optimizer.init(&theta), starts + 1);
        }
        let leaf = Tensor::from_inner(theta.clone()).require_grad();
        let (loss, iterate) = look(step, place.part, Tensor::clone(&leaf))?;
        error = Some(iterate.hard_loss[0]);
        let gradient = leaf.grad(&loss.sum().backward()).unwrap_or_else(|| theta.zeros_like());
        let optimizer = Adam { learning_rate: place.rate * learning_rate, ..optimizer };
        (theta, state) = optimizer.step(theta, gradient, state);
        theta = problem.allowed(&run.scene, Tensor::from_inner(theta)).inner();
    }
    Ok(look(steps, place.part, Tensor::from_inner(theta))?.1)
}

/// Instances that are solved side by side, and what draws them.
struct Run<'a, P: InverseProblem, B: RasterBackend> {
    problem: &'a P,
    instances: usize,
    size: usize,
    renderer: ScheduledRenderer,
    scene: P::Scene<Autodiff<B>>,
    /// The scene on the CPU.
    host: P::Scene<HostBackend>,
}

/// What is seen at a step, on the device.
struct Seen<B: RasterBackend> {
    theta: Tensor<B, 1>,
    image: Tensor<B, 3>,
    soft_loss: Tensor<B, 1>,
    /// What is lowered, of each instance, with a tape.
    loss: Tensor<Autodiff<B>, 1>,
}

impl<'a, P: InverseProblem, B: RasterBackend> Run<'a, P, B> {
    fn new(
        problem: &'a P,
        instances: &[P::Instance],
        method: &Method,
        SolveConfig { size, steps, .. }: &SolveConfig,
    ) -> Self {
        let size = *size;
        let layout = PhiLayout::new(method.softness.clone(), problem.own_phi(), *steps, size);
        let rasterizer = Rasterizer { tolerance: method.tolerance(), ..Rasterizer::new(size) };
        let (phi, faces) = (layout.start(), problem.faces());
        let renderer = ScheduledRenderer::new(layout, &phi, rasterizer, method.resolution, faces);
        let (scene, host) = (problem.scene(instances, size), problem.scene(instances, size));
        Self { problem, instances: instances.len(), size, renderer, scene, host }
    }

    fn seen(&self, part: f64, theta: Tensor<Autodiff<B>, 1>) -> Seen<B> {
        let Self { problem, scene, renderer, .. } = self;
        let image = problem.image(scene, theta.clone(), &renderer.at_part(part));
        let soft = problem.image_loss(scene, image.clone());
        let loss = lowered(*problem, scene, theta.clone(), soft.clone());
        Seen { theta: theta.inner(), image: image.inner(), soft_loss: soft.inner(), loss }
    }

    /// The numbers of what is seen, with its hard error.
    fn read(
        &self,
        step: usize,
        part: f64,
        seen: Seen<B>,
        picture: bool,
    ) -> anyhow::Result<Iterate> {
        let image = picture.then(|| of_first(seen.image, self.instances));
        let rows = image.as_ref().map(|image| image.dims()[2]);
        // One round trip to the device for all of it.
        let read = Transaction::default().register(seen.theta).register(seen.loss.inner());
        let read = read.register(seen.soft_loss);
        let read = image.into_iter().fold(read, |read, image| read.register(image));
        let mut read = read.execute().into_iter();
        let mut next = || read.next().context("fewer tensors were read than were asked for");
        let (theta, loss, soft_loss) = (on_host(next()?), next()?, next()?);
        let image = rows.map(|side| {
            let pixels: Vec<f64> = next()?.iter().collect();
            anyhow::Ok(enlarged(&pixels, side, self.size))
        });
        let hard = self.problem.hard_image(&self.host, theta.clone());
        Ok(Iterate {
            step,
            scale: self.renderer.scale(part),
            theta,
            loss: loss.iter().collect(),
            soft_loss: soft_loss.iter().collect(),
            hard_loss: numbers(self.problem.image_loss(&self.host, hard)),
            image: image.transpose()?,
            seconds: None,
        })
    }
}

/// The views of the first of so many instances.
fn of_first<B: Backend>(image: Tensor<B, 3>, instances: usize) -> Tensor<B, 3> {
    let [views, _, _] = image.dims();
    image.narrow(0, 0, views / instances)
}

/// What was read of a device as a tensor on the CPU, in the same float type.
fn on_host(data: TensorData) -> Tensor<HostBackend, 1> {
    let dtype = data.dtype;
    Tensor::from_data(data, (&Default::default(), dtype))
}

/// Views of `side` × `side` pixels on `size` × `size` ones: each pixel is repeated. Images of another shape stay as they are.
fn enlarged(image: &[f64], side: usize, size: usize) -> Vec<f64> {
    if side >= size {
        return image.to_vec();
    }
    // Resolutions divide the size.
    let times = size / side;
    let view = |view: &[f64]| -> Vec<f64> {
        (0..size * size).map(|k| view[k / size / times * side + k % size / times]).collect()
    };
    image.chunks(side * side).flat_map(view).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coarse_image_is_enlarged_by_repeating_its_pixels() {
        let (few, many) = ([1.0, 2.0, 3.0, 4.0], [1.0, 1.0, 2.0, 2.0]);
        assert_eq!(enlarged(&few, 2, 4)[..8], [many, many].concat());
        assert_eq!(enlarged(&few, 2, 2), few);
        assert_eq!(enlarged(&[few, few].concat(), 2, 4).len(), 32);
    }
}
