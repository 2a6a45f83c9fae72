use std::borrow::Borrow;

use anyhow::Context;
use softrast_raster::{HostBackend, ImageSize, RasterBackend, low_level::Rasterizer};
use softrast_softness::Softness;
use softrast_tensor::{Autodiff, Backend, Tensor, TensorData, Transaction, numbers};

use crate::{
    InverseProblem, Method, PhiLayout, ScheduledRenderer, SolveConfig, problem::total_loss,
};

/// State of all instances after some steps.
///
/// The [crate](crate) has an example.
#[derive(Clone, Debug)]
pub struct Iterate {
    /// Steps taken so far.
    pub step: usize,
    /// Restarts of the run so far; 0 without an adaptive schedule.
    pub restarts: usize,
    /// Progress along the schedule, 0 to 1.
    pub progress: f64,
    /// Scale of the softness, in NDC (NDC² if squared).
    pub scale: f64,
    /// The parameters of the scene, on the CPU, `[N]`.
    pub theta: Tensor<HostBackend, 1>,
    /// The total loss of each instance: image loss plus regularizer.
    pub loss: Vec<f64>,
    /// The loss of each instance's soft image.
    pub soft_loss: Vec<f64>,
    /// The loss of each instance's hard image at full size, which needs no knowledge of the true scene.
    pub hard_loss: Vec<f64>,
    /// The soft image of the first instance at full size, if pictures are enabled: row by row,
    /// views or channels one after the other.
    pub image: Option<Vec<f64>>,
    /// Time of the step that ended here, in seconds; `None` before the first.
    pub seconds: Option<f64>,
}

/// Instances that are solved together, and their renderer.
pub(crate) struct Run<P: InverseProblem, B: RasterBackend, R, S> {
    pub(crate) problem: R,
    instances: usize,
    size: ImageSize,
    renderer: ScheduledRenderer<S>,
    pub(crate) scene: P::Scene<Autodiff<B>>,
    /// The scene on the CPU.
    pub(crate) host: P::Scene<HostBackend>,
}

/// Results of drawing at a step, on the device.
pub(crate) struct Seen<B: RasterBackend> {
    pub(crate) theta: Tensor<B, 1>,
    image: Option<Tensor<B, 4>>,
    soft_loss: Tensor<B, 1>,
    /// The total loss of each instance, with a tape.
    pub(crate) loss: Tensor<Autodiff<B>, 1>,
}

impl<P: InverseProblem, B: RasterBackend, R: Borrow<P>, S: Softness> Run<P, B, R, S> {
    pub(crate) fn new(
        of: R,
        instances: &[P::Instance],
        method: &Method<S>,
        SolveConfig { size, steps, .. }: &SolveConfig,
    ) -> Self {
        let (problem, size) = (of.borrow(), *size);
        let layout = PhiLayout::new(method.softness.clone(), problem.own_phi(), *steps, size);
        let full = problem.image_size(size);
        let rasterizer = Rasterizer { tolerance: method.tolerance(), ..Rasterizer::new(full) };
        let (phi, faces) = (layout.start(), problem.faces());
        let renderer = ScheduledRenderer::new(layout, &phi, rasterizer, method.resolution, faces);
        let (scene, host) = (problem.scene(instances, size), problem.scene(instances, size));
        Self { problem: of, instances: instances.len(), size: full, renderer, scene, host }
    }

    /// Losses at `theta` `[N]`, under the softness at this progress of a run; with the image if `pictures`.
    pub(crate) fn seen(
        &self,
        progress: f64,
        theta: Tensor<Autodiff<B>, 1>,
        pictures: bool,
    ) -> Seen<B> {
        let (problem, Self { scene, renderer, .. }) = (self.problem.borrow(), self);
        let softness = renderer.at_progress(progress);
        // Separate from the loss, which is the same to the last bit with pictures and without.
        let image = pictures.then(|| problem.image(scene, theta.clone().detach(), &softness));
        let soft = problem.loss_at(scene, theta.clone(), &softness);
        let loss = total_loss(problem, scene, theta.clone(), soft.clone());
        let image = image.map(Tensor::inner);
        Seen { theta: theta.inner(), image, soft_loss: soft.inner(), loss }
    }

    /// Reads the results of drawing from the device, and adds the hard error.
    pub(crate) async fn read(
        &self,
        step: usize,
        progress: f64,
        seen: Seen<B>,
    ) -> anyhow::Result<Iterate> {
        let image = seen.image.map(|image| of_first(image, self.instances));
        let drawn = image.as_ref().map(|image| [image.dims()[2], image.dims()[3]]);
        // One round trip to the device for all tensors.
        let read = Transaction::default().register(seen.theta).register(seen.loss.inner());
        let read = read.register(seen.soft_loss);
        let read = image.into_iter().fold(read, |read, image| read.register(image));
        let mut read = read.execute_async().await?.into_iter();
        let mut next = || read.next().context("fewer tensors were read than were asked for");
        let (theta, loss, soft_loss) = (on_host(next()?), next()?, next()?);
        let image = drawn.map(|drawn| {
            let pixels: Vec<f64> = next()?.iter().collect();
            anyhow::Ok(enlarged(&pixels, drawn.into(), self.size))
        });
        let problem = self.problem.borrow();
        let hard = problem.hard_image(&self.host, theta.clone());
        Ok(Iterate {
            step,
            restarts: 0,
            progress,
            scale: self.renderer.scale(progress),
            theta,
            loss: loss.iter().collect(),
            soft_loss: soft_loss.iter().collect(),
            hard_loss: numbers(problem.image_loss(&self.host, hard)),
            image: image.transpose()?,
            seconds: None,
        })
    }
}

/// The views of the first of `instances`.
fn of_first<B: Backend>(image: Tensor<B, 4>, instances: usize) -> Tensor<B, 4> {
    let [views, ..] = image.dims();
    image.narrow(0, 0, views / instances)
}

/// Data read from a device as a tensor on the CPU, in the same float type.
fn on_host(data: TensorData) -> Tensor<HostBackend, 1> {
    let dtype = data.dtype;
    Tensor::from_data(data, (&Default::default(), dtype))
}

/// Views of one size at a multiple of it: each pixel is repeated.
fn enlarged(image: &[f64], drawn: ImageSize, size: ImageSize) -> Vec<f64> {
    let times = size.height / drawn.height;
    if times <= 1 {
        return image.to_vec();
    }
    let pixel = |k: usize| k / size.width / times * drawn.width + k % size.width / times;
    let views = image.chunks(drawn.pixels());
    views.flat_map(|view| (0..size.pixels()).map(move |k| view[pixel(k)])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coarse_image_is_enlarged_by_repeating_its_pixels() {
        let (few, many) = ([1.0, 2.0, 3.0, 4.0], [1.0, 1.0, 2.0, 2.0]);
        assert_eq!(enlarged(&few, 2.into(), 4.into())[..8], [many, many].concat());
        assert_eq!(enlarged(&few, 2.into(), 2.into()), few);
        assert_eq!(enlarged(&[few, few].concat(), 2.into(), 4.into()).len(), 32);
        let wide = enlarged(&few[..2], [1, 2].into(), [2, 4].into());
        assert_eq!(wide, [many, many].concat()[..8]);
        let tall = enlarged(&few[..2], [2, 1].into(), [4, 2].into());
        assert_eq!(tall, [1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0]);
    }
}
