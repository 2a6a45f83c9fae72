use std::sync::Arc;

use softrast_inverse::{
    InverseProblem, Minimization, SoftnessAt, SolveConfig,
    triangles::{Instance, Scene},
};
use softrast_raster::RasterBackend;
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers};
use softrast_views::Picture;

use crate::{Coming, Frame, Run, Settings};

/// Loose triangles that should cover a picture.
struct Covering {
    picture: Picture,
    triangles: usize,
}

impl InverseProblem for Covering {
    type Instance = Instance;
    type Scene<B: RasterBackend> = Scene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<Instance> {
        Ok(Instance::seeded(seed, self.triangles, 1))
    }

    fn scene<B: RasterBackend>(&self, instances: &[Instance], size: usize) -> Scene<B> {
        Scene::new(&self.picture.levels(size), &instances[0], size)
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        Some((0..self.triangles as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect())
    }

    fn start<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        scene.start()
    }

    fn image<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        softness.silhouette(scene.vertices(theta)).unsqueeze_dim(1)
    }

    fn hard_image<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 4> {
        scene.hard(scene.vertices(theta)).unsqueeze_dim(1)
    }

    fn image_loss<B: RasterBackend>(&self, scene: &Scene<B>, image: Tensor<B, 4>) -> Tensor<B, 1> {
        scene.image_loss(image.squeeze_dim(1))
    }

    fn regularizer<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Option<Tensor<B, 1>> {
        Some(scene.smoothness_loss(theta))
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: 128, steps: 200, learning_rate: 0.01 }
    }
}

/// 2D SHAPE: moves loose triangles until they cover the white pixels of a picture.
pub struct ShapeRun<B: RasterBackend> {
    run: Minimization<Covering, B>,
    config: SolveConfig,
}

impl<B: RasterBackend> ShapeRun<B> {
    /// The run of a seed, which places the triangles, before its first step.
    ///
    /// # Errors
    ///
    /// If the softness is invalid.
    pub fn new(picture: Picture, settings: &Settings) -> anyhow::Result<Self> {
        let problem = Covering { picture, triangles: settings.triangles };
        let (method, config) = settings.method("shape2d", problem.defaults().learning_rate)?;
        let instance = problem.instance(settings.seed.into())?;
        let run = Minimization::new(problem, vec![instance], &method, &config)?.with_pictures();
        Ok(Self { run, config })
    }
}

impl<B: RasterBackend> Run for ShapeRun<B> {
    fn size(&self) -> usize {
        self.config.size
    }

    fn steps(&self) -> usize {
        self.config.steps
    }

    fn target(&self) -> Vec<f64> {
        numbers(self.run.scene().target())
    }

    fn next_async(&mut self) -> Coming<'_> {
        Box::pin(async move {
            let Some(iterate) = self.run.next_async().await.transpose()? else { return Ok(None) };
            let hard = self.run.problem().hard_image(self.run.scene(), iterate.theta.clone());
            Ok(Some(Frame::new(&iterate, &numbers(hard), numbers(iterate.theta.clone()))))
        })
    }
}
