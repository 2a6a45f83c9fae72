use std::{path::Path, sync::Arc};

use image::RgbImage;
use serde_json::json;
use softrast_cli::{
    Answer, Common, Description, Detail, EdgeChoice, Ended, Entry, Given, Measures, MethodArgs,
    Paper, Scales, Schedule, Task, Variant,
};
use softrast_inverse::{InverseProblem, Iterate, SoftnessAt, SolveConfig};
use softrast_lab::{contact_sheet, rgb_from_gray};
use softrast_mesh::{Mesh, airplane, chair, icosphere};
use softrast_meta::Adam;
use softrast_raster::{HostBackend, ImageSize, RasterBackend};
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers};

use crate::{
    Args, Chamfer, Instance, Scene, Views,
    args::{DETAIL, DETAILS},
    instance::ELEVATIONS_DEG,
    paper::PAPER,
    scene::{DISTANCE, VIEWS},
    views::solve_views,
};

/// Upper limit of the final hard `IoU` loss of a successful run.
const SUCCESS: f64 = 0.3;

/// Largest move of a parameter in a step, roughly.
///
/// The middle of the three in the released script, 10^-1.25, 10^-1.5 and 10^-1.75. At a scale of
/// 0.003, hard `IoU` losses at elevation 30 end at 0.266, 0.104 and 0.161.
const LEARNING_RATE: f64 = 0.0316;

/// Decay rates of the means of Adam, those of the inner loop of the released script.
const BETAS: [f64; 2] = [0.5, 0.95];

/// Views in pictures: from the front, from a corner, from the side and from behind; and their number per row.
const SHOWN: [usize; 4] = [0, VIEWS / 8, VIEWS / 4, VIEWS / 2];
const COLUMNS: usize = 2;

/// 3D SHAPE: a deformable template, and the mesh of its target silhouettes.
pub struct Shape3d {
    target: Mesh,
    target_name: String,
    template: Mesh,
    template_name: String,
    faces: Arc<[[u32; 3]]>,
    elevation_deg: Option<f64>,
    chamfer: Chamfer,
}

impl InverseProblem for Shape3d {
    type Instance = Instance;
    type Scene<B: RasterBackend> = Scene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<Instance> {
        Ok(Instance::seeded(seed, self.elevation_deg))
    }

    /// The scene of the single instance.
    fn scene<B: RasterBackend>(&self, instances: &[Instance], size: usize) -> Scene<B> {
        assert_eq!(instances.len(), 1, "a scene has one instance");
        Scene::new(&self.target, &self.template, &instances[0], size)
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
        softness.silhouette(scene.project(scene.vertices(theta))).unsqueeze_dim(1)
    }

    fn hard_image<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 4> {
        scene.hard(scene.project(scene.vertices(theta))).unsqueeze_dim(1)
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
        softness.iou_loss(scene.project(scene.vertices(theta)), scene.targets()).mean()
    }

    fn regularizer<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
    ) -> Option<Tensor<B, 1>> {
        Some(scene.smoothness_loss(scene.vertices(theta)))
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: 64, steps: 100, learning_rate: LEARNING_RATE }
    }

    fn optimizer(&self, learning_rate: f64) -> Adam {
        let [beta1, beta2] = BETAS;
        Adam { beta1, beta2, ..Adam::new(learning_rate) }
    }
}

impl Task for Shape3d {
    const NAME: &'static str = "shape3d";
    const TITLE: &'static str = "3D SHAPE";
    const PAPER: &'static Paper = &PAPER;
    const ABOUT: &'static str = "Deforms a sphere until it has the silhouettes of a target";

    /// Wide enough at first to prevent folding, and narrow at last for accurate hard silhouettes.
    ///
    /// Measured with a logistic on our airplane, hard `IoU` loss at the last step, mean of the five elevations: 0.101 for a decay from 0.03
    /// to 0.003, 0.137 at a fixed 0.003. At elevation 30 alone: 0.103 for a decay from 0.03 to 0.003, 0.104 to 0.002, 0.127 to 0.005 and
    /// 0.128 from 0.02 to 0.003; fixed, 0.126 at 0.002, 0.104 at 0.003, 0.139 at 0.005, 0.172 at 0.007, 0.261 at 0.01 and 0.507 at 0.02.
    /// The decay also has the smaller Chamfer distance, 0.28 compared with 0.53 at 0.003.
    const SCALES: Scales = Scales { schedule: Schedule::Decay, decay: [0.03, 0.003], fixed: 0.003 };

    type Args = Args;
    type Pictures = Views;

    fn solve_given(given: &Given<'_, Args>, flags: &Views) -> Option<anyhow::Result<Answer>> {
        solve_views(given, flags)
    }

    fn new(args: &Args, variant: Variant, _edges: &EdgeChoice) -> anyhow::Result<Self> {
        let (target, target_name) = target(variant, args)?;
        let level = args.detail.unwrap_or(DETAIL);
        let (template, template_name) = match &args.template {
            None => (icosphere(level as u32), "sphere".to_owned()),
            Some(path) => (Mesh::load(path)?, name(path)),
        };
        let chamfer = Chamfer::new(target.positions(), target.faces());
        let (faces, elevation_deg) = (template.faces().into(), args.elevation);
        Ok(Self { target, target_name, template, template_name, faces, elevation_deg, chamfer })
    }

    fn entry(args: &Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry> {
        Entry::new::<Self>(args, common, method)
    }

    fn measures() -> Measures {
        Measures {
            soft: "soft IoU loss",
            hard: "hard IoU loss",
            parameter: ["Chamfer distance", "1e-3 squared units"],
            further: &[],
            gains: &[],
        }
    }

    fn description(&self) -> Description {
        let settings = json!({
            "mesh": self.target_name,
            "template": self.template_name,
            "vertices": self.template.positions().len(),
            "views": VIEWS,
            "elevations": self.elevation_deg.map_or(ELEVATIONS_DEG.to_vec(), |one| vec![one]),
        });
        Description {
            faces: self.template.faces().len(),
            runs: ELEVATIONS_DEG.len(),
            success: format!("the hard IoU loss ends below {SUCCESS}"),
            settings: settings.as_object().cloned().unwrap_or_default(),
        }
    }

    fn errors(
        &self,
        _instances: &[Instance],
        scene: &Scene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>> {
        let vertices = numbers(scene.vertices(iterate.theta.clone()));
        let vertices: Vec<[f64; 3]> = vertices.chunks(3).map(|p| [p[0], p[1], p[2]]).collect();
        vec![vec![self.chamfer.distance(&vertices, &self.faces)]]
    }

    fn is_success(&self, hard: f64, _errors: &[f64]) -> bool {
        hard < SUCCESS
    }

    fn targets(&self, scene: &Scene<HostBackend>) -> Vec<f64> {
        numbers(scene.target())
    }

    fn picture(&self, image: &[f64], size: ImageSize) -> RgbImage {
        let view = |view: usize| &image[view * size.pixels()..(view + 1) * size.pixels()];
        let picture = |shown| rgb_from_gray(view(shown), size.width, size.height);
        contact_sheet(&SHOWN.map(picture), COLUMNS)
    }

    fn warnings(&self, run: &Ended<'_, Self>) -> Vec<String> {
        let Ended { seed, target, hard, .. } = *run;
        let mut warnings = Vec::new();
        let views = target.chunks(target.len() / VIEWS);
        let covered: Vec<f64> = views.map(|v| v.iter().sum::<f64>() / v.len() as f64).collect();
        let [empty, full] = [0.0, 1.0].map(|all| covered.iter().filter(|&&c| c == all).count());
        if empty > 0 {
            warnings.push(format!(
                "seed {seed}: {empty} of {VIEWS} target images are empty, so there is nothing to match in them: check that the mesh \
                 is around the origin (without --raw it is moved there) and raise --size"
            ));
        }
        if full > 0 {
            warnings.push(format!(
                "seed {seed}: the mesh fills {full} of {VIEWS} target images, so no edge shows its shape in them: leave out --raw \
                 or take a larger --size"
            ));
        }
        let radius = |p: [f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
        let radius = self.target.triangles().flatten().map(radius).fold(0.0, f64::max);
        if radius >= DISTANCE {
            warnings.push(format!(
                "seed {seed}: the target mesh reaches {radius:.3} from the origin, as far as the cameras at {DISTANCE}: leave out --raw"
            ));
        }
        if empty < VIEWS && hard >= 1.0 {
            warnings.push(format!(
                "seed {seed}: the result covers nothing of the target, so nothing pulls it there: try a larger --scale or a smaller \
                 --learning-rate"
            ));
        }
        warnings
    }

    fn detail(&self, args: &Args) -> Option<Detail<Args>> {
        let is_free = args.template.is_none() && args.detail.is_none();
        is_free.then(|| Detail {
            flag: "detail",
            values: DETAILS.to_vec(),
            set: |args: &mut Args, value| args.detail = Some(value),
        })
    }
}

/// The target mesh and its name.
fn target(variant: Variant, args: &Args) -> anyhow::Result<(Mesh, String)> {
    let (mesh, name) = match (&args.mesh, variant) {
        (Some(path), _) => (Mesh::load(path)?, name(path)),
        (None, Variant::Original) => (airplane(), "airplane".to_owned()),
        (None, Variant::Transfer) => (chair(), "chair".to_owned()),
    };
    if args.raw || args.mesh.is_none() {
        return Ok((mesh, name));
    }
    let halved = mesh.normalized().positions().iter().map(|p| p.map(|x| 0.5 * x)).collect();
    Ok((Mesh::new(halved, mesh.faces().to_vec())?, format!("{name}, normalized")))
}

fn name(path: &Path) -> String {
    path.display().to_string()
}
