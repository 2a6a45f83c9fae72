use std::sync::Arc;

use image::RgbImage;
use softrast_cli::{
    Answer, Common, Description, EdgeChoice, Ended, Entry, Given, Measures, MethodArgs, Scales,
    Task, Variant,
};
use softrast_inverse::{InverseProblem, Iterate, SoftnessAt, SolveConfig, pose::PoseInstance};
use softrast_lab::rgb_from_planes;
use softrast_raster::{HostBackend, ImageSize, RasterBackend};
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers};

use super::{Scene, coloured};
use crate::{Args, Pictures, Pose, picture::outlined};

/// Larger than that of silhouettes (docs/notes.md, Pose by colour).
const LEARNING_RATE: f64 = 1.0;

/// POSE by colour: a camera that orbits a mesh with colours, and its target picture.
pub struct Coloured {
    pose: Pose,
    colours: Vec<[f64; 3]>,
}

impl InverseProblem for Coloured {
    type Instance = PoseInstance;
    type Scene<B: RasterBackend> = Scene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<PoseInstance> {
        self.pose.instance(seed)
    }

    fn restart(&self, instance: &PoseInstance, k: usize, count: usize) -> Option<PoseInstance> {
        self.pose.restart(instance, k, count)
    }

    fn scene<B: RasterBackend>(&self, instances: &[PoseInstance], size: usize) -> Scene<B> {
        let problem = self.pose.problem();
        Scene::new(problem, &self.colours, instances, size)
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        self.pose.faces()
    }

    fn start<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        self.pose.start(scene.silhouettes())
    }

    fn allowed<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        self.pose.allowed(scene.silhouettes(), theta)
    }

    fn image<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        scene.image(theta, softness)
    }

    fn hard_image<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 4> {
        scene.hard(theta)
    }

    fn image_loss<B: RasterBackend>(&self, scene: &Scene<B>, image: Tensor<B, 4>) -> Tensor<B, 1> {
        scene.image_loss(image)
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { learning_rate: LEARNING_RATE, ..self.pose.defaults() }
    }
}

impl Task for Coloured {
    const NAME: &'static str = "pose-colour";
    const PROGRAM: &'static str = Pose::NAME;
    const PRESET: Option<&'static str> = Some(Pose::NAME);
    const TITLE: &'static str = "POSE by colour";
    const ABOUT: &'static str = "Recovers the pose of a camera from a picture in colours";
    const SCALES: Scales = Pose::SCALES;

    /// Poses within 5 degrees end below 0.1, others rarely below 0.4.
    const RESTART_ABOVE: f64 = 0.2;

    type Args = Args;
    type Pictures = Pictures;

    fn solve_given(given: &Given<'_, Args>, pictures: &Pictures) -> Option<anyhow::Result<Answer>> {
        Pose::solve_given(given, pictures)
    }

    fn new(args: &Args, variant: Variant, edges: &EdgeChoice) -> anyhow::Result<Self> {
        let pose = Pose::new(args, variant, edges)?;
        let colours = coloured(args, &pose.problem().mesh)?.to_vec();
        Ok(Self { pose, colours })
    }

    fn entry(args: &Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry> {
        Entry::new::<Self>(args, common, method)
    }

    fn measures() -> Measures {
        Measures { soft: "soft loss by colour", hard: "hard loss by colour", ..Pose::measures() }
    }

    fn description(&self) -> Description {
        let mut description = self.pose.description();
        description.settings.insert("colour".to_owned(), true.into());
        description
    }

    fn batch_size(&self) -> usize {
        self.pose.batch_size()
    }

    fn starts(args: &Args, solves: bool) -> usize {
        Pose::starts(args, solves)
    }

    fn errors(
        &self,
        instances: &[PoseInstance],
        scene: &Scene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>> {
        self.pose.errors(instances, scene.silhouettes(), iterate)
    }

    fn is_success(&self, hard: f64, errors: &[f64]) -> bool {
        self.pose.is_success(hard, errors)
    }

    fn targets(&self, scene: &Scene<HostBackend>) -> Vec<f64> {
        numbers(scene.target())
    }

    fn picture(&self, image: &[f64], size: ImageSize) -> RgbImage {
        let (colours, _) = split(image);
        rgb_from_planes(colours, size.width, size.height)
    }

    fn frame(&self, image: &[f64], target: &[f64], size: ImageSize) -> RgbImage {
        let (_, silhouette) = split(target);
        outlined(self.picture(image, size), silhouette)
    }

    fn warnings(&self, run: &Ended<'_, Self>) -> Vec<String> {
        let Ended { seed, instance, target, size, theta, .. } = *run;
        // The loss includes colours, so it cannot show that the mesh is outside the target; 0 disables that warning.
        let (_, target) = split(target);
        self.pose.warnings(&Ended { seed, instance, target, size, hard: 0.0, theta })
    }
}

/// Red, green and blue of an image of one instance, and its coverage.
fn split(image: &[f64]) -> (&[f64], &[f64]) {
    image.split_at(image.len() / 4 * 3)
}
