use std::{cell::RefCell, collections::BTreeMap, rc::Rc, sync::Arc};

use image::RgbImage;
use serde_json::json;
use softrast_cli::{
    Common, Description, Detail, EdgeChoice, Ended, Entry, Measures, MethodArgs, NoArgs, Scales,
    Schedule, Task, Variant,
};
use softrast_inverse::{InverseProblem, Iterate, SoftnessAt, SolveConfig};
use softrast_lab::rgb_from_planes;
use softrast_raster::{HostBackend, ImageSize, RasterBackend};
use softrast_softness::Softness;
use softrast_tensor::{Tensor, numbers};
use softrast_views::Picture;

use crate::{
    Args, Shape2d,
    colour::{Colours, Scene, Start, landscape},
    target::ensure_not_thin,
};

/// Least final PSNR of the hard image of a successful run.
const SUCCESS_DB: f64 = 24.0;
/// Lower limit of the mean squared error in a PSNR, so that it is finite: at most 100 dB.
const LEAST_MSE: f64 = 1e-10;
/// Shorter side of the picture for the start of triangles, in pixels, independent of the size of the image.
const START_SIZE: usize = 256;

/// 2D SHAPE in colour: loose triangles with colours and depths, and their target picture.
pub struct Coloured {
    name: String,
    /// Red, green and blue of the picture; `None` for our own.
    picture: Option<[Picture; 3]>,
    /// The picture at every size requested so far.
    sizes: RefCell<BTreeMap<usize, Rc<Colours>>>,
    triangles: usize,
    /// The default number of triangles.
    usual_triangles: usize,
}

impl Coloured {
    fn target(&self, size: usize) -> Rc<Colours> {
        let made = || {
            let pixels = match &self.picture {
                None => landscape(size),
                Some(picture) => {
                    let full = self.image_size(size);
                    let [red, green, blue] = picture.each_ref().map(|plane| plane.resized(full));
                    (0..full.pixels()).map(|k| [red[k], green[k], blue[k]]).collect()
                }
            };
            Rc::new(Colours::new(pixels, self.image_size(size)))
        };
        self.sizes.borrow_mut().entry(size).or_insert_with(made).clone()
    }
}

impl InverseProblem for Coloured {
    type Instance = Start;
    type Scene<B: RasterBackend> = Scene<B>;

    fn instance(&self, seed: u64) -> anyhow::Result<Start> {
        Ok(Start::seeded(seed, self.triangles, &self.target(START_SIZE)))
    }

    fn image_size(&self, size: usize) -> ImageSize {
        self.picture.as_ref().map_or(size.into(), |[red, ..]| red.size_at(size))
    }

    /// The scene of the single instance.
    fn scene<B: RasterBackend>(&self, instances: &[Start], size: usize) -> Scene<B> {
        assert_eq!(instances.len(), 1, "a scene has one instance");
        Scene::new(&self.target(size), &instances[0])
    }

    /// None: colours are blended, and there is no silhouette.
    fn faces(&self) -> Option<Arc<[[u32; 3]]>> {
        None
    }

    fn start<B: RasterBackend>(&self, scene: &Scene<B>) -> Tensor<B, 1> {
        scene.start()
    }

    fn allowed<B: RasterBackend>(&self, scene: &Scene<B>, theta: Tensor<B, 1>) -> Tensor<B, 1> {
        scene.allowed(theta)
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

    fn loss_at<B: RasterBackend>(
        &self,
        scene: &Scene<B>,
        theta: Tensor<B, 1>,
        softness: &SoftnessAt<'_, B, impl Softness>,
    ) -> Tensor<B, 1> {
        scene.loss(theta, softness)
    }

    fn defaults(&self) -> SolveConfig {
        SolveConfig { size: 256, steps: 400, learning_rate: 0.002 }
    }
}

impl Task for Coloured {
    const NAME: &'static str = "shape2d-colour";
    const PROGRAM: &'static str = "shape2d";
    const TITLE: &'static str = "2D SHAPE in colour";
    const ABOUT: &'static str = "Moves loose triangles until they cover a picture in its colours";

    /// From a third of a pixel of the default size, so that edges find their place, down to where
    /// the soft image nearly equals the hard one.
    const SCALES: Scales =
        Scales { schedule: Schedule::Decay, decay: [0.003, 0.0001], fixed: 0.0004 };
    const DRAWS: bool = true;

    type Args = Args;
    type Pictures = NoArgs;

    fn new(args: &Args, variant: Variant, _edges: &EdgeChoice) -> anyhow::Result<Self> {
        let usual_triangles = Args::usual_triangles(variant);
        let (name, picture) = match &args.target {
            None => ("landscape".to_owned(), None),
            Some(path) => {
                let picture = Picture::load_colours(path)?;
                ensure_not_thin(&picture[0], path)?;
                (path.display().to_string(), Some(picture))
            }
        };
        let triangles = args.triangles.unwrap_or(usual_triangles);
        Ok(Self { name, picture, sizes: RefCell::default(), triangles, usual_triangles })
    }

    fn entry(args: &Args, common: &Common, method: &MethodArgs) -> anyhow::Result<Entry> {
        Entry::new::<Self>(args, common, method)
    }

    fn measures() -> Measures {
        Measures {
            gains: &[["psnr.hard", "hard PSNR", "dB"], ["psnr.soft", "soft PSNR", "dB"]],
            ..Shape2d::measures()
        }
    }

    fn description(&self) -> Description {
        let settings = json!({ "target": self.name, "colour": true });
        Description {
            faces: self.triangles,
            runs: 20,
            success: format!("the hard PSNR ends at {SUCCESS_DB} dB or more"),
            settings: settings.as_object().cloned().unwrap_or_default(),
        }
    }

    fn errors(
        &self,
        _instances: &[Start],
        _scene: &Scene<HostBackend>,
        iterate: &Iterate,
    ) -> Vec<Vec<f64>> {
        let (hard, soft) = (iterate.hard_loss[0], iterate.soft_loss[0]);
        vec![vec![hard, psnr(hard), psnr(soft)]]
    }

    fn is_success(&self, hard: f64, _errors: &[f64]) -> bool {
        psnr(hard) >= SUCCESS_DB
    }

    fn targets(&self, scene: &Scene<HostBackend>) -> Vec<f64> {
        numbers(scene.target())
    }

    fn picture(&self, image: &[f64], size: ImageSize) -> RgbImage {
        rgb_from_planes(image, size.width, size.height)
    }

    fn drawing(&self, scene: &Scene<HostBackend>, theta: &[f64]) -> Option<String> {
        Some(scene.svg(theta))
    }

    fn warnings(&self, run: &Ended<'_, Self>) -> Vec<String> {
        let Ended { seed, target, hard, .. } = *run;
        // The error of the mean colour alone.
        let variance = target.chunks(target.len() / 3).map(|plane| {
            let mean = plane.iter().sum::<f64>() / plane.len() as f64;
            plane.iter().map(|level| (level - mean).powi(2)).sum::<f64>() / plane.len() as f64
        });
        let variance = variance.sum::<f64>() / 3.0;
        let warning = if variance < LEAST_MSE {
            "the target has one colour, so it shows nothing: give another --target or raise --size (what is transparent is black)".to_owned()
        } else if hard >= variance {
            format!(
                "seed {seed}: the triangles end no nearer to the target than its mean colour: try a lower --learning-rate or more --triangles"
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

/// `-10 log₁₀` of a mean squared error, in dB.
fn psnr(mse: f64) -> f64 {
    -10.0 * mse.max(LEAST_MSE).log10()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psnr_is_ten_for_each_power_of_ten_and_never_infinite() {
        assert!((psnr(1e-3) - 30.0).abs() < 1e-12);
        assert!((psnr(0.0) - 100.0).abs() < 1e-12);
    }
}
