use std::rc::Rc;

use softrast_meta::Objective;
use softrast_raster::RasterBackend;
use softrast_softness::{EdgeSoftness, Softness};
use softrast_tensor::{Autodiff, Tensor, tensor};

use crate::{InverseProblem, ScheduledRenderer, SoftnessAt, problem::total_loss};

type Twice<B> = Autodiff<Autodiff<B>>;

/// The loss of the inner loop.
pub struct Inner<P: InverseProblem, B: RasterBackend, S = EdgeSoftness> {
    pub(crate) problem: Rc<P>,
    pub(crate) scene: P::Scene<Twice<B>>,
    pub(crate) renderer: Rc<ScheduledRenderer<S>>,
}

impl<P: InverseProblem, B: RasterBackend, S: Softness> Objective<Twice<B>> for Inner<P, B, S> {
    fn loss(
        &self,
        theta: Tensor<Twice<B>, 1>,
        prepared: Tensor<Twice<B>, 1>,
        step: usize,
    ) -> Tensor<Twice<B>, 1> {
        let softness = match prepared.dims() {
            [0] => self.renderer.at(step),
            _ => self.renderer.of_prepared(step, prepared),
        };
        inner_loss(&*self.problem, &self.scene, theta, &softness)
    }

    /// Empty if the renderer draws from its cached tables: without a tape, under the φ that it was made for.
    fn prepared(&self, phi: Tensor<Twice<B>, 1>, step: usize) -> Tensor<Twice<B>, 1> {
        let tracked = phi.is_require_grad() || phi.clone().inner().is_require_grad();
        match !tracked && self.renderer.is_of(&phi) {
            true => tensor(Vec::new(), [0]),
            false => self.renderer.prepared(&phi, step),
        }
    }

    fn stage(&self, step: usize) -> usize {
        self.renderer.layout().stage(step)
    }

    fn allowed(&self, theta: Tensor<Twice<B>, 1>) -> Tensor<Twice<B>, 1> {
        self.problem.allowed(&self.scene, theta)
    }
}

/// The outer loss: the error of the result of an inner loop.
pub struct Outer<P: InverseProblem, B: RasterBackend, S = EdgeSoftness> {
    pub(crate) problem: Rc<P>,
    pub(crate) scene: P::Scene<Autodiff<B>>,
    pub(crate) image: OuterImage<S>,
}

#[derive(Clone)]
pub(crate) enum OuterImage<S> {
    /// A soft image under a narrow softness.
    Sharp(Rc<ScheduledRenderer>),
    /// The hard image.
    Hard,
    /// The inner loss under the learned softness at the last step.
    Inner(Rc<ScheduledRenderer<S>>),
}

impl<P: InverseProblem, B: RasterBackend, S: Softness> Objective<Autodiff<B>> for Outer<P, B, S> {
    fn loss(
        &self,
        theta: Tensor<Autodiff<B>, 1>,
        phi: Tensor<Autodiff<B>, 1>,
        _step: usize,
    ) -> Tensor<Autodiff<B>, 1> {
        let Self { problem, scene, image } = self;
        let image = match image {
            OuterImage::Sharp(sharp) => problem.sharp_image(scene, theta, &sharp.at(0)),
            OuterImage::Hard => problem.hard_image(scene, theta),
            OuterImage::Inner(renderer) => {
                let last = renderer.layout().steps();
                let softness = renderer.of_prepared(last, renderer.prepared(&phi, last));
                return inner_loss(&**problem, scene, theta, &softness);
            }
        };
        problem.image_loss(scene, image).sum()
    }
}

/// The loss of an inner loop, `[1]`.
fn inner_loss<P: InverseProblem, B: RasterBackend>(
    problem: &P,
    scene: &P::Scene<B>,
    theta: Tensor<B, 1>,
    softness: &SoftnessAt<'_, B, impl Softness>,
) -> Tensor<B, 1> {
    let image = problem.image(scene, theta.clone(), softness);
    total_loss(problem, scene, theta, problem.image_loss(scene, image)).sum()
}
