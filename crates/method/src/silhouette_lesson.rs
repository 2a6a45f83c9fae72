use std::sync::Arc;

use burn::tensor::Tensor;
use softrast_meta::{Adam, InnerLoop};
use softrast_raster::{HostBackend, RasterBackend, Rasterizer};
use softrast_runner::{Figure, Plan};

use crate::{Judge, LearnedEdge, Lesson, Method, PreparedRun, Step};

/// A [`Lesson`] about scenes that are seen as silhouettes.
pub trait SilhouetteLesson: 'static {
    /// One instance.
    type Scene<B: RasterBackend>;

    /// How silhouettes are drawn and judged.
    fn drawn(&self) -> &LearnedSilhouette;

    /// How an instance is solved.
    fn inner(&self) -> InnerLoop<Adam>;

    /// See [`Lesson::scene`].
    ///
    /// # Errors
    ///
    /// If there is no such instance.
    fn scene<B: RasterBackend>(&self, seed: u64, finer: usize) -> anyhow::Result<Self::Scene<B>>;

    /// See [`Lesson::theta`].
    fn theta<B: RasterBackend>(&self, scene: &Self::Scene<B>) -> Tensor<B, 1>;

    /// See [`Lesson::allowed`].
    fn allowed<B: RasterBackend>(
        &self,
        _scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 1> {
        theta
    }

    /// Vertices `[views, vertices, 3]` at θ: x and y in NDC, and depth.
    fn vertices<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 3>;

    /// What is wrong with a silhouette, `[1]`.
    fn image_loss<B: RasterBackend>(
        &self,
        scene: &Self::Scene<B>,
        image: Tensor<B, 3>,
    ) -> Tensor<B, 1>;

    /// What the inner loop lowers beside it to keep the scene smooth, `[1]`.
    fn smoothness_loss<B: RasterBackend>(
        &self,
        _scene: &Self::Scene<B>,
        _theta: Tensor<B, 1>,
    ) -> Option<Tensor<B, 1>> {
        None
    }
}

/// Silhouettes of one mesh topology under a softness that is learned, and under the one that judges.
#[derive(Clone, Debug)]
pub struct LearnedSilhouette {
    edge: LearnedEdge,
    judge: Judge,
    faces: Arc<[[u32; 3]]>,
    size: usize,
}

impl LearnedSilhouette {
    /// Begins with what `method` does on runs of `steps` steps and images of `size` × `size` pixels.
    ///
    /// # Panics
    ///
    /// If there are no faces.
    pub fn new(
        method: &Method,
        plan: &Plan,
        steps: usize,
        size: usize,
        faces: Arc<[[u32; 3]]>,
    ) -> Self {
        let edge = LearnedEdge::new(method, plan, steps, size);
        let judge = Judge::new(plan, &faces, size);
        Self { edge, judge, faces, size }
    }
}

impl<L: SilhouetteLesson> Lesson for L {
    type Scene<B: RasterBackend> = L::Scene<B>;
    type Drawing = PreparedRun;

    fn start(&self) -> Vec<f64> {
        self.drawn().edge.start()
    }

    fn suits(&self, plan: &Plan) -> anyhow::Result<()> {
        self.drawn().edge.suits(plan)
    }

    fn inner(&self) -> InnerLoop<Adam> {
        SilhouetteLesson::inner(self)
    }

    fn scene<B: RasterBackend>(&self, seed: u64, finer: usize) -> anyhow::Result<L::Scene<B>> {
        SilhouetteLesson::scene(self, seed, finer)
    }

    fn theta<B: RasterBackend>(&self, scene: &L::Scene<B>) -> Tensor<B, 1> {
        SilhouetteLesson::theta(self, scene)
    }

    fn allowed<B: RasterBackend>(&self, scene: &L::Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        SilhouetteLesson::allowed(self, scene, theta)
    }

    fn prepare(&self, phi: &[f64]) -> PreparedRun {
        let LearnedSilhouette { edge, faces, size, .. } = self.drawn();
        let rasterizer = Rasterizer { tolerance: edge.tolerance, ..Rasterizer::new(*size) };
        edge.prepare::<HostBackend>(rasterizer, faces, phi)
    }

    fn prepared<B: RasterBackend>(
        &self,
        drawing: &PreparedRun,
        phi: Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 1> {
        drawing.prepared(&self.drawn().edge, &phi, step)
    }

    fn stage(&self, step: usize) -> usize {
        self.drawn().edge.stage(step)
    }

    fn loss<B: RasterBackend>(
        &self,
        scene: &L::Scene<B>,
        drawing: &PreparedRun,
        theta: Tensor<B, 1>,
        phi: Tensor<B, 1>,
        step: Step,
    ) -> Tensor<B, 1> {
        let vertices = self.vertices(scene, theta.clone());
        let image = drawing.image(&self.drawn().edge, vertices, &phi, step);
        let loss = self.image_loss(scene, image);
        match self.smoothness_loss(scene, theta) {
            Some(smoothness) => loss + smoothness,
            None => loss,
        }
    }

    /// How well the image fits, without what keeps the scene smooth.
    fn judge<B: RasterBackend>(&self, scene: &L::Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        self.image_loss(scene, self.drawn().judge.image(self.vertices(scene, theta)))
    }

    fn files(
        &self,
        phi: &[f64],
        learning_rate: f64,
        note: &str,
    ) -> anyhow::Result<Vec<(&'static str, String)>> {
        self.drawn().edge.files(phi, learning_rate, note)
    }

    fn figures(&self, phi: &[f64]) -> Vec<Figure> {
        self.drawn().edge.figures::<HostBackend>(phi)
    }
}
