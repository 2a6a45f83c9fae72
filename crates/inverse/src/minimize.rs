use std::time::{Duration, Instant};

use anyhow::ensure;
use burn::{
    backend::Autodiff,
    tensor::{Tensor, TensorData, Transaction, backend::Backend},
};
use softrast_meta::{InnerLoop, descend};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer};
use softrast_softness::numbers;

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

/// Goes down the gradient of a problem's loss from its start, all `instances` side by side: what it ends with.
///
/// It shows every iterate from the start to the end to `visit`, along with the scene on the CPU. `visit` does not count as time of a
/// step. Parameters without a gradient, as where nothing was drawn, stay as they are.
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
    mut visit: impl FnMut(&Iterate, &P::Scene<HostBackend>) -> anyhow::Result<()>,
) -> anyhow::Result<Iterate> {
    ensure!(!instances.is_empty(), "there is no instance to solve");
    let SolveConfig { size, steps, learning_rate } = *config;
    let layout = PhiLayout::new(method.softness.clone(), problem.own_phi(), steps, size);
    let rasterizer = Rasterizer { tolerance: method.tolerance(), ..Rasterizer::new(size) };
    let phi = layout.start();
    let renderer =
        ScheduledRenderer::new(layout, &phi, rasterizer, method.resolution, problem.faces());
    let scene = problem.scene::<Autodiff<B>>(instances, size);
    let host = problem.scene::<HostBackend>(instances, size);
    // Time of drawing, and since when the step has gone on.
    let mut spent: Option<(Duration, Instant)> = None;
    let mut look = |step: usize, leaf: Tensor<Autodiff<B>, 1>| {
        let seconds = spent.map(|(drawing, since)| (drawing + since.elapsed()).as_secs_f64());
        let clock = Instant::now();
        let image = problem.image(&scene, leaf.clone(), &renderer.at(step));
        let soft = problem.image_loss(&scene, image.clone());
        let loss = match problem.regularizer(&scene, leaf.clone()) {
            Some(regularizer) => soft.clone() + regularizer,
            None => soft.clone(),
        };
        // A GPU has only been asked so far, also for the end of the step before.
        B::sync(&leaf.device())?;
        let drawing = clock.elapsed();
        let image = pictures.then(|| of_first(image.inner(), instances.len()));
        let rows = image.as_ref().map(|image| image.dims()[2]);
        // One round trip to the device for all of it.
        let read = Transaction::default().register(leaf.inner()).register(loss.clone().inner());
        let read = read.register(soft.inner());
        let read = image.into_iter().fold(read, |read, image| read.register(image));
        let read: [Option<TensorData>; 4] = {
            let mut read = read.execute().into_iter();
            std::array::from_fn(|_| read.next())
        };
        let [Some(theta), Some(losses), Some(soft), image] = read else {
            unreachable!("as many tensors are read as were registered")
        };
        let theta = on_host(theta);
        let hard = problem.image_loss(&host, problem.hard_image(&host, theta.clone()));
        let image = image
            .zip(rows)
            .map(|(image, side)| enlarged(&image.iter().collect::<Vec<f64>>(), side, size));
        let iterate = Iterate {
            step,
            scale: renderer.scale(step),
            theta,
            loss: losses.iter().collect(),
            soft_loss: soft.iter().collect(),
            hard_loss: numbers(hard),
            image,
            seconds,
        };
        visit(&iterate, &host)?;
        spent = Some((drawing, Instant::now()));
        anyhow::Ok((loss, iterate))
    };
    let inner = InnerLoop { optimizer: problem.optimizer(learning_rate), steps };
    let gradient = |step: usize, theta: &Tensor<B, 1>| {
        let leaf = Tensor::from_inner(theta.clone()).require_grad();
        let (loss, _) = look(step, Tensor::clone(&leaf))?;
        Ok(leaf.grad(&loss.sum().backward()).unwrap_or_else(|| theta.zeros_like()))
    };
    let allowed = |theta| problem.allowed(&scene, Tensor::from_inner(theta)).inner();
    let start = problem.start(&scene).inner();
    let theta = descend::<B, _, anyhow::Error>(&inner, start, gradient, allowed, |_, _, _| ())?;
    Ok(look(steps, Tensor::from_inner(theta))?.1)
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
