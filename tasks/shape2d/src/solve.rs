use std::cell::RefCell;

use burn::{
    backend::Autodiff,
    tensor::{TensorData, Transaction},
};
use softrast_meta::Adam;
use softrast_method::{Descent, Method, MovingSilhouette, on_host};
use softrast_raster::{RasterBackend, hard_silhouette, mse_loss};

use crate::Scene;

/// How to solve a scene.
#[derive(Clone, Debug)]
pub(crate) struct Solver {
    pub(crate) method: Method,
    pub(crate) size: usize,
    pub(crate) steps: usize,
    pub(crate) learning_rate: f64,
}

/// The scene after some steps.
pub(crate) struct State {
    pub(crate) step: usize,
    pub(crate) scale: f64,
    /// What the optimiser lowers.
    pub(crate) loss: f64,
    /// Mean squared error of the soft silhouette at full size.
    pub(crate) soft: f64,
    /// Mean squared error of the hard silhouette.
    pub(crate) hard: f64,
    /// Soft silhouette, `[1, size, size]`, where pictures are wanted.
    pub(crate) image: Option<TensorData>,
    /// Time of the step that ended here, in seconds; none before the first.
    pub(crate) seconds: Option<f64>,
}

impl Solver {
    /// Solves `scene`, and shows each state from the start to the end to `visit`, with
    /// images if `pictures`.
    pub(crate) fn run<B: RasterBackend>(
        &self,
        scene: &Scene<Autodiff<B>>,
        pictures: bool,
        mut visit: impl FnMut(State) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let descent = Descent { optimizer: Adam::new(self.learning_rate), steps: self.steps };
        let first = self.method.scale(0, self.steps);
        let target = on_host(scene.target().inner().into_data());
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
                let vertices = scene.vertices(theta.clone());
                let image = silhouette.borrow().image(vertices.clone());
                let soft = scene.image_loss(image.clone());
                (soft.clone() + scene.smoothness_loss(theta), (scale, vertices, image, soft))
            },
            |theta| theta,
            |now| {
                let (scale, vertices, image, soft) = now.seen;
                let read = Transaction::default().register(now.loss).register(soft.inner());
                let read = read.register(vertices.inner());
                let picture = pictures.then(|| silhouette.borrow().picture(image));
                let read =
                    picture.into_iter().fold(read, |read, image| read.register(image.inner()));
                let ([loss, soft, vertices], image) = softrast_method::read(read);
                let hard = hard_silhouette(on_host(vertices), scene.faces(), self.size);
                visit(State {
                    step: now.step,
                    scale,
                    loss: number(&loss),
                    soft: number(&soft),
                    hard: number(&mse_loss(hard, target.clone()).into_data()),
                    image,
                    seconds: now.seconds,
                })
            },
        )
    }
}

/// The only number of a tensor.
fn number(data: &TensorData) -> f64 {
    data.iter().next().unwrap_or(f64::NAN)
}
