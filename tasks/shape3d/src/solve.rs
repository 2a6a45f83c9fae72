use std::cell::RefCell;

use burn::{
    backend::Autodiff,
    tensor::{TensorData, Transaction},
};
use softrast_meta::Adam;
use softrast_method::{Descent, Method, MovingSilhouette, on_host};
use softrast_raster::{RasterBackend, hard_silhouette, iou_loss};

use crate::Scene;

/// Decays of the means of Adam. Source: FACTS 3.2 (inner loop of the released script).
const BETAS: [f64; 2] = [0.5, 0.95];

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
    /// Vertices in world units.
    pub(crate) vertices: Vec<[f64; 3]>,
    /// What the optimiser lowers.
    pub(crate) loss: f64,
    /// Soft `IoU` loss at full size, mean over the views.
    pub(crate) soft: f64,
    /// `IoU` loss of the hard silhouettes, mean over the views.
    pub(crate) hard: f64,
    /// Soft silhouettes, `[views, size, size]`, where pictures are wanted.
    pub(crate) image: Option<TensorData>,
    /// Time of the step that ended here, in seconds; none before the first.
    pub(crate) seconds: Option<f64>,
}

impl Solver {
    /// What steps the scene.
    pub(crate) fn adam(&self) -> Adam {
        let [beta1, beta2] = BETAS;
        Adam { beta1, beta2, ..Adam::new(self.learning_rate) }
    }

    /// Solves `scene`, and shows each state from the start to the end to `visit`, with
    /// images if `pictures`.
    pub(crate) fn run<B: RasterBackend>(
        &self,
        scene: &Scene<Autodiff<B>>,
        pictures: bool,
        mut visit: impl FnMut(State) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let descent = Descent { optimizer: self.adam(), steps: self.steps };
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
                let vertices = scene.vertices(theta);
                let projected = scene.project(vertices.clone());
                let image = silhouette.borrow().image(projected.clone());
                let soft = scene.image_loss(image.clone());
                let loss = soft.clone() + scene.smoothness_loss(vertices.clone());
                (loss, (scale, vertices, projected, image, soft))
            },
            |theta| theta,
            |now| {
                let (scale, vertices, projected, image, soft) = now.seen;
                let read = Transaction::default().register(vertices.inner()).register(now.loss);
                let read = read.register(soft.inner()).register(projected.inner());
                let picture = pictures.then(|| silhouette.borrow().picture(image));
                let read =
                    picture.into_iter().fold(read, |read, image| read.register(image.inner()));
                let ([vertices, loss, soft, projected], image) = softrast_method::read(read);
                let vertices: Vec<f64> = vertices.iter().collect();
                let hard = hard_silhouette(on_host(projected), scene.faces(), self.size);
                visit(State {
                    step: now.step,
                    scale,
                    vertices: vertices.chunks(3).map(|p| [p[0], p[1], p[2]]).collect(),
                    loss: number(&loss),
                    soft: number(&soft),
                    hard: number(&iou_loss(hard, target.clone()).mean().into_data()),
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
