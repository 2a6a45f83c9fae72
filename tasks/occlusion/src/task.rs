use std::sync::Arc;

use image::RgbImage;
use serde_json::json;
use softrast_cli::{
    Common, Description, EdgeChoice, Ended, Entry, Measures, MethodArgs, NoArgs, OwnAxis, Paper,
    Scales, Schedule, Task, Variant, theta_of,
};
use softrast_inverse::{DepthSoftnessFile, InverseProblem, Iterate, SoftnessAt, SolveConfig};
use softrast_lab::{
    plot::{Axis, Plot, Series},
    rgb_from_planes,
};
use softrast_raster::{HostBackend, ImageSize, RasterBackend};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Tensor, numbers, vector};

use crate::{
    Args, DepthError, Instance, Problem, Scene,
    args::NAME,
    depth::Depth,
    instance::{front, pairs},
    paper::PAPER,
};

/// Instances solved together in `evaluate`.
const BATCH: usize = 10;

/// Widths of the depth softness that a search tries.
const DEPTH_SCALES: [f64; 4] = [0.05, 0.1, 0.2, 0.4];

/// Scales of the softnesses of the outer loss: edges in NDC, depths in units of the distance between the planes. The second is a fifth of
/// the task's default: narrower than any that can be optimised, and wide enough to have a gradient.
const SHARP: [f64; 2] = [0.0005, 0.02];

/// OCCLUSION: textured quads, and the image that shows their order.
pub struct Occlusion {
    problem: Problem,
    depth: Depth,
    variant: Variant,
}

impl InverseProblem for Occlusion {
    type Instance = Instance;
    type Scene<B: RasterBackend> = Scene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<Instance> {
        Ok(Instance::seeded(seed, &self.problem))
    }

    fn scene<B: RasterBackend>(&self, instances: &[Instance], size: usize) -> Scene<B> {
        Scene::new(&self.problem, instances, size)
    }

    /// None: colours are blended by tensor ops.
    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        None
    }

    /// The parameters of the depth softness.
    fn own_phi(&self) -> Vec<f64> {
        self.depth.phi.clone()
    }

    fn start<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        scene.start().flatten(0, 1)
    }

    fn allowed<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        scene.allowed(scene.by_view(theta)).flatten(0, 1)
    }

    fn image<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        let (edge, phi) = softness.edge();
        let edges = match softness.fixed_place() {
            Some(place) => scene.fixed_edges(place, edge, phi),
            None => scene.edges(edge, phi),
        };
        in_rows(scene.image(scene.by_view(theta), edges, self.depth.softness, softness.own()))
    }

    fn hard_image<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 4> {
        in_rows(scene.hard(scene.by_view(theta)))
    }

    /// The image under two narrow logistics.
    fn sharp_image<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
        _softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 4> {
        let [edge, depth] = SHARP.map(|scale| vector(&Family::Logistic.default_phi(scale)));
        let softness = EdgeSoftness::new(Family::Logistic);
        let edges = scene.fixed_edges(0, &softness, edge);
        let sharp = DepthSoftness::Family(Family::Logistic);
        in_rows(scene.image(scene.by_view(theta), edges, sharp, depth))
    }

    fn image_loss<B: RasterBackend>(&self, scene: &Scene<B>, image: Tensor<B, 4>) -> Tensor<B, 1> {
        scene.loss(image.flatten(2, 3))
    }

    /// The transfer has to cross 3.5 world units in ten steps. Front quads found out of 50 with
    /// `evaluate --variant transfer --size 32 --learning-rate X`: 74 % at 0.2, 92 % at 0.35, 100 % at 0.7 and at 1.4.
    fn defaults(&self) -> SolveConfig {
        match self.variant {
            Variant::Original => SolveConfig { size: 64, steps: 100, learning_rate: 0.03 },
            Variant::Transfer => SolveConfig { size: 64, steps: 10, learning_rate: 0.7 },
        }
    }
}

/// An image `[views, channels, pixels]` as `[views, channels, size, size]`.
fn in_rows<B: RasterBackend>(image: Tensor<B, 3>) -> Tensor<B, 4> {
    let [views, channels, pixels] = image.dims();
    let size = pixels.isqrt();
    image.reshape([views, channels, size, size])
}

impl Task for Occlusion {
    const NAME: &'static str = NAME;
    const TITLE: &'static str = "OCCLUSION";
    const PAPER: &'static Paper = &PAPER;
    const ABOUT: &'static str = "Finds which of several overlapping quads is in front";

    /// Narrow, because edges do not move, and wide edges only blur the image.
    ///
    /// Success of 50 seeds with `evaluate --runs 50 --size 32 --scale X`, original and transfer: 100 and 100 % at 0.0005 and at 0.002, 90
    /// and 100 % at 0.005, 48 and 70 % at 0.02, where near quads bleed over the background and over one another. At 64 pixels, `evaluate
    /// --runs 50` succeeds in 100 % of runs (95 % interval from 93 %), and `evaluate --variant transfer --runs 200` in 100 % (from 98 %).
    const SCALES: Scales =
        Scales { schedule: Schedule::Static, decay: [0.02, 0.0005], fixed: 0.0005 };

    const MOVES_EDGES: bool = false;

    type Args = Args;
    type Pictures = NoArgs;

    fn new(args: &Args, variant: Variant, edges: &EdgeChoice) -> anyhow::Result<Self> {
        Ok(Self { problem: Problem::of(variant), depth: Depth::new(args, edges)?, variant })
    }

    fn entry(args: &Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry> {
        Entry::new::<Self>(args, common, method)
    }

    fn measures() -> Measures {
        Measures {
            soft: "soft image MSE",
            hard: "hard image MSE",
            parameter: ["wrong depth order", "of pairs"],
            further: &[
                ["parameter_error.front", "wrong front quad", "of runs"],
                ["parameter_error.depth", "mean depth error", "world units"],
            ],
            gains: &[],
        }
    }

    fn description(&self) -> Description {
        let mut settings = json!({
            "depth_softness": self.depth.name,
            "background_weight": crate::BACKGROUND,
        });
        if let Some(scale) = self.depth.scale {
            settings["depth_scale"] = scale.into();
        }
        let success = match self.problem.front_only {
            false => "all quads end in the right order",
            true => "the front quad ends in front",
        };
        Description {
            faces: self.problem.quads,
            runs: 50,
            success: success.to_owned(),
            settings: settings.as_object().cloned().unwrap_or_default(),
        }
    }

    fn method_name(&self, edges: &str) -> String {
        let depths = &self.depth.name;
        if edges == depths {
            edges.to_owned()
        } else {
            format!("{edges} edges and {depths} depths")
        }
    }

    /// Methods are searched on the transfer, because most settings solve the original without an error.
    fn takes_learning_rate(&self) -> bool {
        self.variant == Variant::Transfer
    }

    fn batch_size(&self) -> usize {
        BATCH
    }

    fn errors(
        &self,
        instances: &[Instance],
        _scene: &Scene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>> {
        let depths = theta_of(&iterate.theta, instances.len());
        let error = |(found, instance): (&Vec<f64>, &Instance)| {
            let error = DepthError::new(found, &instance.target);
            let wrong_front = f64::from(u8::from(!error.right_front));
            vec![error.wrong_pairs, wrong_front, error.distance]
        };
        depths.iter().zip(instances).map(error).collect()
    }

    fn is_success(&self, _hard: f64, errors: &[f64]) -> bool {
        if self.problem.front_only { errors[1] == 0.0 } else { errors[0] == 0.0 }
    }

    fn targets(&self, scene: &Scene<HostBackend>) -> Vec<f64> {
        numbers(scene.target())
    }

    fn picture(&self, image: &[f64], size: ImageSize) -> RgbImage {
        rgb_from_planes(image, size.width, size.height)
    }

    fn warnings(&self, run: &Ended<'_, Self>) -> Vec<String> {
        let Ended { seed, instance, size, theta, .. } = *run;
        let mut warnings = Vec::new();
        if self.depth.contrast() < 1e-3 {
            warnings.push(format!(
                "the depth softness {} weighs all depths alike, so no image shows which quad is in front: try another --depth-scale",
                self.depth.name
            ));
        }
        let nearest = front(&instance.target);
        let asked =
            |(i, j): (usize, usize)| !self.problem.front_only || i == nearest || j == nearest;
        let overlaps = instance.visible_overlaps(size).into_iter().zip(pairs(instance.quads.len()));
        let counts: Vec<usize> =
            overlaps.filter(|&(_, pair)| asked(pair)).map(|(n, _)| n).collect();
        let unseen = counts.iter().filter(|&&count| count == 0).count();
        if unseen > 0 {
            warnings.push(format!(
                "seed {seed}: the target does not show the order of {unseen} of {} pairs of quads: raise --size",
                counts.len()
            ));
        }
        // The start has been rounded to the backend's float type.
        let stayed = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-6;
        if instance.quads.len() > 1 && theta.iter().zip(&instance.start).all(stayed) {
            warnings.push(format!(
                "seed {seed}: no quad moved, because no gradient reached a depth: try a larger --depth-scale"
            ));
        }
        warnings
    }

    fn own_axis(&self, args: &Args) -> Option<OwnAxis<Args>> {
        let is_free = args.depth_scale.is_none() && self.depth.scale.is_some();
        is_free.then(|| OwnAxis {
            flag: "depth-scale",
            values: DEPTH_SCALES.to_vec(),
            set: |args: &mut Args, value| args.depth_scale = Some(value),
        })
    }

    /// The scale of the task and a wider one, because edges do not move.
    fn searched_scales(around: Vec<f64>) -> Vec<f64> {
        around.into_iter().skip(2).step_by(2).collect()
    }

    fn own_file(&self, phi: &[f64], note: &str) -> anyhow::Result<Option<(&'static str, String)>> {
        let name = "depth_softness.json";
        let (depth_softness, note) = (self.depth.softness, Some(note.to_owned()));
        let file = DepthSoftnessFile { depth_softness, phi: phi.to_vec(), note };
        Ok(Some((name, file.text(name)?)))
    }

    fn own_chart(&self, start: &[f64], learned: &[f64]) -> Option<(Plot, &'static str)> {
        let series = [("start", start), ("learned", learned)].map(|(name, phi)| Series {
            name: name.into(),
            points: self.depth.log_weights(phi),
            ..Series::default()
        });
        let axes = Plot::new(Axis::linear("nearness"), Axis::linear("logarithm of the weight"));
        let caption = "Logarithm of the weight of a depth, over how near it is: 0 on the far plane, 1 on the near one. Only \
                       differences matter.";
        Some((Plot { series: series.into(), ..axes }, caption))
    }
}
