use std::cell::RefCell;

use burn::{
    backend::Autodiff,
    tensor::{Tensor, TensorData, Transaction},
};
use softrast_meta::Adam;
use softrast_method::{Descent, Method, MovingSilhouette, numbers, on_host};
use softrast_raster::{RasterBackend, hard_silhouette, iou_loss};

use crate::Scene;

/// How to solve the instances of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Solver {
    pub(crate) method: Method,
    pub(crate) size: usize,
    pub(crate) steps: usize,
    pub(crate) learning_rate: f64,
}

/// All views after some steps.
pub(crate) struct State {
    pub(crate) step: usize,
    pub(crate) scale: f64,
    /// θ of each view.
    pub(crate) theta: Vec<Vec<f64>>,
    /// What the optimiser lowers, of each view: the soft `IoU` loss of the image it sees.
    pub(crate) soft: Vec<f64>,
    /// `IoU` loss of the hard silhouette of each view.
    pub(crate) hard: Vec<f64>,
    /// Soft silhouettes, `[views, size, size]`, where pictures are wanted.
    pub(crate) image: Option<TensorData>,
    /// Time of the step that ended here, in seconds; none before the first.
    pub(crate) seconds: Option<f64>,
}

impl Solver {
    /// Solves all views of `scene`, and shows each state from the start to the end to `visit`, with
    /// images if `pictures`.
    pub(crate) fn run<B: RasterBackend>(
        &self,
        scene: &Scene<Autodiff<B>>,
        pictures: bool,
        mut visit: impl FnMut(State) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let descent = Descent { optimizer: Adam::new(self.learning_rate), steps: self.steps };
        let target = on_host(scene.target().inner().into_data());
        let first = self.method.scale(0, self.steps);
        let rasterizer = self.method.rasterizer(self.size);
        let silhouette =
            MovingSilhouette::<Autodiff<B>>::new(&self.method, rasterizer, scene.faces(), first);
        // It moves in every step, and judges what the step has led to.
        let silhouette = RefCell::new(silhouette);
        descent.run(
            scene.start().inner(),
            |step, theta| {
                let scale = self.method.scale(step, self.steps);
                silhouette.borrow_mut().turn_to(scale);
                let projected = scene.project(theta);
                let image = silhouette.borrow().image(projected.clone());
                (scene.image_loss(image.clone()), (scale, projected, image))
            },
            |theta| scene.allowed(Tensor::from_inner(theta)).inner(),
            |now| {
                let (scale, projected, image) = now.seen;
                let width = now.theta.dims()[1];
                let read = Transaction::default().register(now.theta).register(now.loss);
                let read = read.register(projected.inner());
                let picture = pictures.then(|| silhouette.borrow().picture(image));
                let read =
                    picture.into_iter().fold(read, |read, image| read.register(image.inner()));
                let ([poses, soft, projected], image) = softrast_method::read(read);
                let poses: Vec<f64> = poses.iter().collect();
                let hard = hard_silhouette(on_host(projected), scene.faces(), self.size);
                visit(State {
                    step: now.step,
                    scale,
                    theta: poses.chunks(width).map(<[_]>::to_vec).collect(),
                    soft: soft.iter().collect(),
                    hard: numbers(iou_loss(hard, target.clone())),
                    image,
                    seconds: now.seconds,
                })
            },
        )
    }
}
