use std::time::Instant;

use anyhow::ensure;
use burn::{
    backend::Autodiff,
    tensor::{Tensor, TensorData, Transaction, backend::Backend},
};
use softrast_meta::{Optimizer, numbers};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer};

use crate::{InverseProblem, Method, PhiLayout, ScheduledRenderer, SolveConfig};

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

/// Goes down the gradient of a problem's loss from its start, all `instances` side by side, and shows every iterate from the start to
/// the end to `visit`, along with the scene on the CPU. `visit` does not count as time of a step.
///
/// Parameters without a gradient, as where nothing was drawn, stay as they are.
///
/// # Errors
///
/// Those of `visit` and of the device, which end the descent; if there is no instance.
pub fn minimize<P: InverseProblem, B: RasterBackend>(
    problem: &P,
    instances: &[P::Instance],
    method: &Method,
    config: &SolveConfig,
    pictures: bool,
    mut visit: impl FnMut(Iterate, &P::Scene<HostBackend>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    ensure!(!instances.is_empty(), "there is no instance to solve");
    let SolveConfig { size, steps, learning_rate } = *config;
    let layout = PhiLayout::new(method.softness.clone(), problem.own_phi(), steps, size);
    let rasterizer = Rasterizer { tolerance: method.tolerance(), ..Rasterizer::new(size) };
    let phi = layout.start();
    let renderer =
        ScheduledRenderer::new(layout, &phi, rasterizer, method.resolution, problem.faces());
    let scene = problem.scene::<Autodiff<B>>(instances, size);
    let host = problem.scene::<HostBackend>(instances, size);
    descend(
        &problem.optimizer(learning_rate),
        steps,
        problem.start(&scene).inner(),
        |step, theta| {
            let image = problem.image(&scene, theta.clone(), &renderer.at(step));
            let soft = problem.image_loss(&scene, image.clone());
            let loss = match problem.regularizer(&scene, theta) {
                Some(regularizer) => soft.clone() + regularizer,
                None => soft.clone(),
            };
            (loss, (soft, image))
        },
        |theta| problem.allowed(&scene, Tensor::from_inner(theta)).inner(),
        |now| {
            let (soft, image) = now.seen;
            // One round trip to the device for all of it.
            let read = Transaction::default().register(now.theta).register(now.loss);
            let read = read.register(soft.inner());
            let image = pictures.then(|| of_first(image.inner(), instances.len()));
            let rows = image.as_ref().map(|image| image.dims()[2]);
            let read = image.into_iter().fold(read, |read, image| read.register(image));
            let read: [Option<TensorData>; 4] = {
                let mut read = read.execute().into_iter();
                std::array::from_fn(|_| read.next())
            };
            let [Some(theta), Some(loss), Some(soft), image] = read else {
                unreachable!("as many tensors are read as were registered")
            };
            let theta = on_host(theta);
            let hard = problem.image_loss(&host, problem.hard_image(&host, theta.clone()));
            let image = image
                .zip(rows)
                .map(|(image, side)| enlarged(&image.iter().collect::<Vec<f64>>(), side, size));
            let iterate = Iterate {
                step: now.step,
                scale: renderer.scale(now.step),
                theta,
                loss: loss.iter().collect(),
                soft_loss: soft.iter().collect(),
                hard_loss: numbers(hard),
                image,
                seconds: now.seconds,
            };
            visit(iterate, &host)
        },
    )
}

/// A place on the way down.
struct Place<B: Backend, S> {
    step: usize,
    theta: Tensor<B, 1>,
    loss: Tensor<B, 1>,
    /// What the objective saw on the way to the loss.
    seen: S,
    seconds: Option<f64>,
}

/// Goes down the gradient of the sum of the losses that `objective` gives at a step, from `theta` on; `allowed` says where a step may
/// end.
fn descend<B: Backend, S>(
    optimizer: &impl Optimizer,
    steps: usize,
    mut theta: Tensor<B, 1>,
    mut objective: impl FnMut(usize, Tensor<Autodiff<B>, 1>) -> (Tensor<Autodiff<B>, 1>, S),
    allowed: impl Fn(Tensor<B, 1>) -> Tensor<B, 1>,
    mut visit: impl FnMut(Place<B, S>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let (mut state, mut seconds) = (optimizer.init(&theta), None);
    for step in 0..=steps {
        let clock = Instant::now();
        let leaf = Tensor::from_inner(theta.clone()).require_grad();
        let (loss, seen) = objective(step, leaf.clone());
        // A GPU has only been asked so far, also for the end of the step before.
        B::sync(&theta.device())?;
        let mut time = clock.elapsed();
        let inner = loss.clone().inner();
        visit(Place { step, theta: theta.clone(), loss: inner, seen, seconds })?;
        if step == steps {
            break;
        }
        let clock = Instant::now();
        let grads = loss.sum().backward();
        let grad = leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like());
        let (moved, next) = optimizer.step(theta, grad, state);
        (theta, state) = (allowed(moved), next);
        time += clock.elapsed();
        seconds = Some(time.as_secs_f64());
    }
    Ok(())
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
