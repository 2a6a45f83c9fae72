use std::{cell::RefCell, collections::BTreeMap, sync::Arc};

use serde_json::json;
use softrast_cli::{
    Common, Description, Detail, EdgeChoice, Ended, Entry, Measures, MethodArgs, NoArgs, Paper,
    Scales, Schedule, Task, Variant,
};
use softrast_inverse::{InverseProblem, Iterate, SoftnessAt, SolveConfig};
use softrast_raster::{HostBackend, ImageSize, RasterBackend};
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers};

use crate::{Args, Instance, Scene, paper::PAPER, target::Target};

/// Upper limit of the final hard mean squared error of a successful run.
const SUCCESS: f64 = 0.02;

/// Largest move of a coordinate in a step, roughly, in NDC: about a pixel of the default size.
///
/// Hard mean squared errors on the letters end at 0.0026 with 0.005, 0.0024 with 0.01 and 0.0034 with 0.02.
const LEARNING_RATE: f64 = 0.01;

/// 2D SHAPE: loose triangles, and their target picture.
pub struct Shape2d {
    target: Target,
    /// The target at every size requested so far.
    sizes: RefCell<BTreeMap<usize, Arc<[f64]>>>,
    triangles: usize,
    /// The default number of triangles.
    usual_triangles: usize,
    faces: Arc<[[u32; 3]]>,
}

impl Shape2d {
    fn target(&self, size: usize) -> Arc<[f64]> {
        let mut sizes = self.sizes.borrow_mut();
        sizes.entry(size).or_insert_with(|| self.target.image(size).into()).clone()
    }
}

impl InverseProblem for Shape2d {
    type Instance = Instance;
    type Scene<B: RasterBackend> = Scene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<Instance> {
        Ok(Instance::seeded(seed, self.triangles, self.image_size(self.defaults().size)))
    }

    fn image_size(&self, size: usize) -> ImageSize {
        self.target.image_size(size)
    }

    /// The scene of the single instance.
    fn scene<B: RasterBackend>(&self, instances: &[Instance], size: usize) -> Scene<B> {
        assert_eq!(instances.len(), 1, "a scene has one instance");
        Scene::new(&self.target(size), &instances[0], self.image_size(size))
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        Some(self.faces.clone())
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

    fn loss_at<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 1> {
        softness.mse_loss(scene.vertices(theta), scene.targets())
    }

    fn regularizer<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Option<Tensor<B, 1>> {
        Some(scene.smoothness_loss(theta))
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: 256, steps: 200, learning_rate: LEARNING_RATE }
    }
}

impl Task for Shape2d {
    const NAME: &'static str = "shape2d";
    const TITLE: &'static str = "2D SHAPE";
    const PAPER: &'static Paper = &PAPER;
    const ABOUT: &'static str = "Moves loose triangles until they cover a picture";

    /// A quarter of a pixel of the default size: triangles lie so densely that few need a gradient from afar.
    ///
    /// Measured with a logistic, hard mean squared error at the last step, seed 0. Letters: fixed width 0.0028 at 0.0015, 0.0024 at 0.002,
    /// 0.0035 at 0.003 and 0.0078 at 0.005; with a decay to 0.002 0.0031 from 0.01 and 0.0029 from 0.02 or 0.04, to 0.001 from 0.02 0.0034.
    /// Skyline: 0.0108 at 0.002, and 0.0156 with a decay to it from 0.02, where the first soft image is uniformly white.
    const SCALES: Scales =
        Scales { schedule: Schedule::Static, decay: [0.02, 0.002], fixed: 0.002 };

    type Args = Args;
    type Pictures = NoArgs;

    fn new(args: &Args, variant: Variant, _edges: &EdgeChoice) -> anyhow::Result<Self> {
        let usual_triangles = Args::usual_triangles(variant);
        let target = match &args.target {
            None => Target::logo(variant),
            Some(path) => Target::load(path)?,
        };
        let triangles = args.triangles.unwrap_or(usual_triangles);
        let faces = (0..triangles as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        Ok(Self { target, sizes: RefCell::default(), triangles, usual_triangles, faces })
    }

    fn entry(args: &Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry> {
        Entry::new::<Self>(args, common, method)
    }

    fn measures() -> Measures {
        Measures {
            soft: "soft MSE",
            hard: "hard MSE",
            parameter: ["hard MSE (stands in)", ""],
            further: &[],
            gains: &[],
        }
    }

    fn description(&self) -> Description {
        let settings = json!({ "target": self.target.name() });
        Description {
            faces: self.triangles,
            runs: 20,
            success: format!("the hard MSE ends below {SUCCESS}"),
            settings: settings.as_object().cloned().unwrap_or_default(),
        }
    }

    fn errors(
        &self,
        _instances: &[Instance],
        _scene: &Scene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>> {
        vec![iterate.hard_loss.clone()]
    }

    fn is_success(&self, hard: f64, _errors: &[f64]) -> bool {
        hard < SUCCESS
    }

    fn targets(&self, scene: &Scene<HostBackend>) -> Vec<f64> {
        numbers(scene.target())
    }

    fn warnings(&self, run: &Ended<'_, Self>) -> Vec<String> {
        let Ended { seed, target, hard, .. } = *run;
        let white = target.iter().filter(|&&p| p > 0.5).count();
        let black_image = target.iter().map(|p| p * p).sum::<f64>() / target.len() as f64;
        let warning = if white == 0 {
            "the target has nothing white, so the triangles can only vanish: give another --target or raise --size".to_owned()
        } else if white == target.len() {
            "the target has nothing black, so it shows no shape: give another --target or raise --size".to_owned()
        } else if hard >= black_image {
            format!(
                "seed {seed}: the triangles end no nearer to the target than an empty image: try a larger --scale or more --triangles"
            )
        } else {
            return Vec::new();
        };
        vec![warning]
    }

    fn detail(&self, args: &Args) -> Option<Detail<Args>> {
        args.detail(self.usual_triangles)
    }
}
