use std::sync::Arc;

use image::RgbImage;
use serde_json::json;
use softrast_cli::{
    Answer, Common, Description, EdgeChoice, Ended, Entry, Given, Measures, MethodArgs, Paper,
    Scales, Schedule, Task, Variant, theta_of,
};
use softrast_inverse::{
    InverseProblem, Iterate, PoseProblem, SoftnessAt, SolveConfig,
    pose::{PoseInstance, PoseScene, nearest_distance},
};
use softrast_lab::{Error, program::say};
use softrast_raster::{HostBackend, ImageSize, RasterBackend};
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers};

use crate::{
    Args, Instances, Pictures, PoseError, Range,
    framing::{Viewed, viewed},
    paper::PAPER,
    picture::outlined,
    pictures::solve_pictures,
    released::released24,
};

/// Largest angle to the target at the end of a successful run.
const SUCCESS_DEG: f64 = 5.0;
/// Default number of starts of `solve`.
const STARTS: usize = 8;
/// Instances solved together in `evaluate`: all released pairs fit.
const BATCH: usize = 25;

/// POSE: a camera that orbits a mesh, and its target silhouette.
pub struct Pose {
    problem: PoseProblem,
    mesh_name: String,
    faces: Arc<[[u32; 3]]>,
    source: Source,
    variant: Variant,
}

/// Source of the instances.
enum Source {
    Seeded(Range),
    Released(Vec<PoseInstance>),
}

impl Pose {
    /// The problem, independent of the source of its instances.
    pub(crate) fn problem(&self) -> &PoseProblem {
        &self.problem
    }
}

impl InverseProblem for Pose {
    type Instance = PoseInstance;
    type Scene<B: RasterBackend> = PoseScene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<PoseInstance> {
        let Source::Released(pairs) = &self.source else { return self.problem.instance(seed) };
        let pair = usize::try_from(seed).ok().and_then(|k| pairs.get(k)).copied();
        pair.ok_or_else(|| {
            Error::usage(format!(
                "--instances released24 has {} pairs, counted from seed 0: --seed and --runs together may not go beyond",
                pairs.len()
            ))
        })
    }

    fn restart(&self, instance: &PoseInstance, k: usize, count: usize) -> Option<PoseInstance> {
        self.problem.restart(instance, k, count)
    }

    fn scene<B: RasterBackend>(&self, instances: &[PoseInstance], size: usize) -> PoseScene<B> {
        self.problem.scene(instances, size)
    }

    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        Some(self.faces.clone())
    }

    fn start<B: RasterBackend>(&self, scene: &PoseScene<B>) -> Tensor<B, 1> {
        self.problem.start(scene)
    }

    fn allowed<B: RasterBackend>(&self, scene: &PoseScene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        self.problem.allowed(scene, theta)
    }

    fn image<B: RasterBackend>(
        &self,
        scene: &PoseScene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        self.problem.image(scene, theta, softness)
    }

    fn hard_image<B: RasterBackend>(
        &self,
        scene: &PoseScene<B>,
        theta: Tensor<B, 1>,
    ) -> Tensor<B, 4> {
        self.problem.hard_image(scene, theta)
    }

    fn image_loss<B: RasterBackend>(
        &self,
        scene: &PoseScene<B>,
        image: Tensor<B, 4>,
    ) -> Tensor<B, 1> {
        self.problem.image_loss(scene, image)
    }

    fn loss_at<B: RasterBackend>(
        &self,
        scene: &PoseScene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 1> {
        self.problem.loss_at(scene, theta, softness)
    }

    fn defaults(&self) -> SolveConfig {
        match self.variant {
            Variant::Original => self.problem.defaults(),
            Variant::Transfer => SolveConfig { size: 64, steps: 150, learning_rate: 0.5 },
        }
    }
}

impl Task for Pose {
    const NAME: &'static str = "pose";
    const TITLE: &'static str = "POSE";
    const PAPER: &'static Paper = &PAPER;
    const ABOUT: &'static str = "Recovers the pose of a camera from a silhouette";

    /// Wide enough at first to have a gradient from afar, and at last as narrow as the best hard silhouettes allow.
    ///
    /// Measured with a logistic. The 24 released pairs on spot end at a hard `IoU` loss, summed, of 1.09 at 0.0015,
    /// 1.12 at 0.002, 1.26 at 0.003 and 3.2 at 0.01. On the fox, 41 of 50 seeds that start 35 to 55 degrees away
    /// succeed at 0.002, and 48 with a decay to it from 0.03 (from 0.01: 45, from 0.05: 47). The last scale is below a
    /// quarter of a pixel, because thousands of small faces add up to an edge wider than that of a single face.
    const SCALES: Scales = Scales { schedule: Schedule::Decay, decay: [0.03, 0.002], fixed: 0.002 };

    /// Poses within 5 degrees end below 0.08, others rarely below 0.2.
    const RESTART_ABOVE: f64 = 0.1;

    type Args = Args;
    type Pictures = Pictures;

    fn solve_given(given: &Given<'_, Args>, pictures: &Pictures) -> Option<anyhow::Result<Answer>> {
        pictures.is_given().then(|| solve_pictures(given, pictures))
    }

    fn new(args: &Args, variant: Variant, _edges: &EdgeChoice) -> anyhow::Result<Self> {
        let Viewed { mesh, name: mesh_name, notes, .. } = viewed(args)?;
        notes.iter().for_each(|note| say(&format!("warning: {note}")));
        let source = match (args.instances, args.range) {
            (Instances::Seeded, range) => Source::Seeded(range.unwrap_or_default()),
            (Instances::Released24, None) => Source::Released(released24()?),
            (Instances::Released24, Some(_)) => {
                return Err(Error::usage(
                    "--range does not go with --instances released24, whose angles are 15 to 35",
                ));
            }
        };
        let faces = mesh.faces().into();
        let range_deg = args.range.unwrap_or_default().degrees();
        let problem = PoseProblem { mesh, range_deg, optimise_fov: args.optimise_fov };
        Ok(Self { problem, mesh_name, faces, source, variant })
    }

    fn entry(args: &Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry> {
        Entry::new::<Self>(args, common, method)
    }

    fn measures() -> Measures {
        Measures {
            soft: "soft IoU loss",
            hard: "hard IoU loss",
            parameter: ["camera angle", "degrees"],
            further: &[
                ["parameter_error.distance", "camera distance", "world units"],
                ["parameter_error.released", "squared chord / 3", ""],
            ],
            gains: &[],
        }
    }

    fn description(&self) -> Description {
        let (instances, range, runs) = match &self.source {
            Source::Seeded(range) => ("seeded", range.name(), 50),
            Source::Released(pairs) => ("released24", Range::Near.name(), pairs.len()),
        };
        let settings = json!({
            "mesh": self.mesh_name,
            "instances": instances,
            "range": range,
            "optimise_fov": self.problem.optimise_fov,
        });
        Description {
            faces: self.faces.len(),
            runs,
            success: format!("the camera ends within {SUCCESS_DEG} degrees"),
            settings: settings.as_object().cloned().unwrap_or_default(),
        }
    }

    fn takes_learning_rate(&self) -> bool {
        self.variant == Variant::Original
    }

    fn batch_size(&self) -> usize {
        BATCH
    }

    fn starts(args: &Args, solves: bool) -> usize {
        let thorough = solves && args.instances == Instances::Seeded;
        args.starts.map_or(if thorough { STARTS } else { 1 }, |n| n as usize)
    }

    fn errors(
        &self,
        instances: &[PoseInstance],
        _scene: &PoseScene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>> {
        let poses = theta_of(&iterate.theta, instances.len());
        let error = |(pose, instance): (&Vec<f64>, &PoseInstance)| {
            let error = PoseError::new([pose[0], pose[1], pose[2]], instance.target.distance);
            vec![error.angle_deg, error.distance, error.released()]
        };
        poses.iter().zip(instances).map(error).collect()
    }

    fn is_success(&self, _hard: f64, errors: &[f64]) -> bool {
        errors[0] <= SUCCESS_DEG
    }

    fn targets(&self, scene: &PoseScene<HostBackend>) -> Vec<f64> {
        numbers(scene.target())
    }

    fn frame(&self, image: &[f64], target: &[f64], size: ImageSize) -> RgbImage {
        outlined(self.picture(image, size), target)
    }

    fn warnings(&self, run: &Ended<'_, Self>) -> Vec<String> {
        let Ended { seed, instance, target, hard, .. } = *run;
        let mut warnings = Vec::new();
        let covered = target.iter().filter(|&&p| p > 0.5).count();
        if covered == 0 {
            warnings.push(format!(
                "seed {seed}: the target image is empty, so there is nothing to match: check that the mesh is around the origin \
                 (without --raw it is moved there) and raise --size"
            ));
        } else if covered == target.len() {
            warnings.push(format!(
                "seed {seed}: the mesh fills the whole target image, so no edge shows its pose: leave out --raw or take a larger --size"
            ));
        }
        let (nearest, camera) = (nearest_distance(&self.problem.mesh), instance.target.distance);
        if camera < nearest {
            warnings.push(format!(
                "seed {seed}: the mesh reaches to the target camera: it would have to be {nearest:.3} from the origin but is at \
                 {camera:.3}; leave out --raw"
            ));
        }
        if covered > 0 && hard >= 1.0 {
            warnings.push(format!(
                "seed {seed}: the mesh ends outside the target's silhouette, where nothing pulls it back: try a larger --scale or a \
                 smaller --learning-rate"
            ));
        }
        warnings
    }
}
