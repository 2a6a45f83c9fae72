use burn::{
    backend::Autodiff,
    tensor::{Tensor, TensorData, Transaction, backend::Backend},
};
use softrast_meta::Adam;
use softrast_method::{Descent, Method, tensor};

use crate::{Scene, depth_method::DepthMethod};

/// How to solve the instances of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Solver {
    pub(crate) edge: Method,
    pub(crate) depth: DepthMethod,
    pub(crate) size: usize,
    pub(crate) steps: usize,
    pub(crate) learning_rate: f64,
}

/// All views after some steps.
pub(crate) struct State {
    pub(crate) step: usize,
    /// Scale of the edge softness.
    pub(crate) scale: f64,
    /// Depths of the quads of each view.
    pub(crate) depths: Vec<Vec<f64>>,
    /// Mean squared error of each soft image, what the optimiser lowers.
    pub(crate) soft: Vec<f64>,
    /// Mean squared error of each hard image.
    pub(crate) hard: Vec<f64>,
    /// Soft images, `[views, 3, pixels]`, where pictures are wanted.
    pub(crate) image: Option<TensorData>,
    /// Time of the step that ended here, in seconds; none before the first.
    pub(crate) seconds: Option<f64>,
}

impl Solver {
    /// Solves all views of `scene`, and shows each state from the start to the end to `visit`, with
    /// images if `pictures`.
    pub(crate) fn run<B: Backend>(
        &self,
        scene: &Scene<Autodiff<B>>,
        pictures: bool,
        mut visit: impl FnMut(State) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let descent = Descent { optimizer: Adam::new(self.learning_rate), steps: self.steps };
        let depth_phi = tensor::<Autodiff<B>, 1>(self.depth.phi.clone(), [self.depth.phi.len()]);
        let mut scale = self.edge.scale(0, self.steps);
        let mut edges = self.edges(scene, scale);
        descent.run(
            scene.start().inner(),
            |step, theta| {
                let now = self.edge.scale(step, self.steps);
                if now != scale {
                    (scale, edges) = (now, self.edges(scene, now));
                }
                let softness = self.depth.softness;
                let image = scene.image(theta, edges.clone(), softness, depth_phi.clone());
                (scene.loss(image.clone()), (scale, image))
            },
            |theta| scene.allowed(Tensor::from_inner(theta)).inner(),
            |now| {
                let (scale, image) = now.seen;
                let hard = scene.loss(scene.hard(Tensor::from_inner(now.theta.clone())));
                let width = now.theta.dims()[1];
                let read = Transaction::default().register(now.theta).register(now.loss);
                let read = read.register(hard.inner());
                let read = if pictures { read.register(image.inner()) } else { read };
                let ([depths, soft, hard], image) = softrast_method::read(read);
                let depths: Vec<f64> = depths.iter().collect();
                visit(State {
                    step: now.step,
                    scale,
                    depths: depths.chunks(width).map(<[_]>::to_vec).collect(),
                    soft: soft.iter().collect(),
                    hard: hard.iter().collect(),
                    image,
                    seconds: now.seconds,
                })
            },
        )
    }

    /// The edge part of all images, without a tape.
    fn edges<B: Backend>(&self, scene: &Scene<Autodiff<B>>, scale: f64) -> Tensor<Autodiff<B>, 3> {
        let phi = self.edge.phi(scale);
        let shape = [phi.len()];
        scene.edges(self.edge.softness(), tensor(phi, shape)).detach()
    }
}
