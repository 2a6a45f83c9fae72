//! The smallest task: moves a ball until its silhouette matches the target.
//!
//! `cargo run --release -p softrast-cli --example disc -- evaluate --runs 20`

use std::{process::ExitCode, sync::Arc};

use rand::{Rng, SeedableRng, rngs::StdRng};
use serde_json::{Map, json};
use softrast_cli::{
    Common, Description, EdgeChoice, Entry, Measures, MethodArgs, NoArgs, Scales, Schedule, Task,
    Variant, theta_of,
};
use softrast_inverse::{InverseProblem, Iterate, SoftnessAt, SolveConfig, Targets};
use softrast_mesh::icosphere;
use softrast_raster::{HostBackend, Projected, RasterBackend, hard_silhouette};
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers, tensor};

#[allow(dead_code, reason = "the tests include this file as a module")]
fn main() -> ExitCode {
    softrast_cli::main::<Disc>()
}

/// Flags that only this task has.
#[derive(clap::Args, Clone)]
pub(crate) struct Args {
    /// Radius of the ball, in NDC
    #[arg(long, default_value_t = 0.4)]
    radius: f64,
}

/// A ball as a mesh.
pub(crate) struct Disc {
    radius: f64,
    vertices: Vec<f64>,
    faces: Arc<[[u32; 3]]>,
}

/// Start and target centre of the ball, in NDC.
#[derive(Clone, Copy)]
pub(crate) struct Places {
    start: [f64; 2],
    target: [f64; 2],
}

/// Instances that are solved together, one view each.
pub(crate) struct Scene<B: RasterBackend> {
    /// `[1, vertices, 3]`.
    ball: Tensor<B, 3>,
    faces: Arc<[[u32; 3]]>,
    /// `[views, 2]`.
    start: Tensor<B, 2>,
    targets: Targets<B>,
    size: usize,
}

impl<B: RasterBackend> Scene<B> {
    /// The ball at θ = x and y of each view: `[views, vertices, 3]`.
    fn vertices(&self, theta: Tensor<B, 1>) -> Projected<B> {
        let [_, count, _] = self.ball.dims();
        let views = self.start.dims()[0];
        let place = theta.reshape([views, 1, 2]);
        let place = Tensor::cat(vec![place, Tensor::zeros([views, 1, 1], &self.ball.device())], 2);
        Projected::new(
            self.ball.clone().expand([views, count, 3]) + place.expand([views, count, 3]),
        )
    }
}

impl InverseProblem for Disc {
    type Instance = Places;
    type Scene<B: RasterBackend> = Scene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<Places> {
        let mut random = StdRng::seed_from_u64(seed);
        let mut place = || [(); 2].map(|()| random.random_range(-0.3..0.3));
        Ok(Places { start: place(), target: place() })
    }

    fn scene<B: RasterBackend>(&self, instances: &[Places], size: usize) -> Scene<B> {
        let places = |of: fn(&Places) -> [f64; 2]| -> Tensor<B, 2> {
            tensor(instances.iter().flat_map(of).collect(), [instances.len(), 2])
        };
        let mut scene = Scene {
            ball: tensor(self.vertices.clone(), [1, self.vertices.len() / 3, 3]),
            faces: self.faces.clone(),
            start: places(|places| places.start),
            targets: Targets::new(Tensor::zeros([1, 1, 1], &Default::default())),
            size,
        };
        let target = scene.vertices(places(|places| places.target).flatten(0, 1));
        scene.targets = Targets::new(hard_silhouette(target, &self.faces, size));
        scene
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        Some(self.faces.clone())
    }

    fn start<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        scene.start.clone().flatten(0, 1)
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
        hard_silhouette(scene.vertices(theta), &scene.faces, scene.size).unsqueeze_dim(1)
    }

    fn image_loss<B: RasterBackend>(&self, scene: &Scene<B>, image: Tensor<B, 4>) -> Tensor<B, 1> {
        scene.targets.mse_loss(image.squeeze_dim(1))
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: 32, steps: 60, learning_rate: 0.02 }
    }
}

impl Task for Disc {
    const NAME: &'static str = "disc";
    const TITLE: &'static str = "DISC";
    const ABOUT: &'static str = "Moves a ball until its silhouette is where it should be";
    const SCALES: Scales = Scales { schedule: Schedule::Static, decay: [0.1, 0.02], fixed: 0.05 };
    type Args = Args;
    type Pictures = NoArgs;

    fn new(args: &Args, _variant: Variant, _edges: &EdgeChoice) -> anyhow::Result<Self> {
        let ball = icosphere(1);
        let vertices = ball.positions().iter().flatten().map(|x| args.radius * x).collect();
        Ok(Self { radius: args.radius, vertices, faces: ball.faces().into() })
    }

    fn entry(args: &Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry> {
        Entry::new::<Self>(args, common, method)
    }

    fn measures() -> Measures {
        Measures {
            soft: "soft MSE",
            hard: "hard MSE",
            parameter: ["distance", "radii"],
            further: &[],
            gains: &[],
        }
    }

    fn description(&self) -> Description {
        Description {
            faces: self.faces.len(),
            runs: 10,
            success: "the ball ends within a tenth of its radius of its place".into(),
            settings: Map::from_iter([("radius".into(), json!(self.radius))]),
        }
    }

    fn batch_size(&self) -> usize {
        4
    }

    fn errors(
        &self,
        instances: &[Places],
        _scene: &Scene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>> {
        let found = theta_of(&iterate.theta, instances.len());
        let errors = |(places, theta): (&Places, &Vec<f64>)| {
            let [x, y] = [0, 1].map(|k| (theta[k] - places.target[k]) / self.radius);
            vec![x.hypot(y)]
        };
        instances.iter().zip(&found).map(errors).collect()
    }

    fn is_success(&self, _hard: f64, errors: &[f64]) -> bool {
        errors[0] < 0.1
    }

    fn targets(&self, scene: &Scene<HostBackend>) -> Vec<f64> {
        numbers(scene.targets.full())
    }
}
