//! What a learned softness looks like.

use burn::tensor::Tensor;
use softrast_raster::RasterBackend;
use softrast_runner::{Curve, Figure};
use softrast_softness::{EdgeSoftness, Softness};

use crate::{LearnedEdge, numbers, tensor};

/// Name, softness and parameters of a soft step to be shown.
type Step<B> = (String, EdgeSoftness, Tensor<B, 1>);

impl LearnedEdge {
    /// The learned softness beside that of the start, and how its scale moves.
    pub fn figures<B: RasterBackend>(&self, learned: &[f64]) -> Vec<Figure> {
        let [start, learned] =
            [self.start(), learned.to_vec()].map(|phi| tensor::<B, 1>(phi.clone(), [phi.len()]));
        let at: &[(&str, usize)] = match self.path {
            None => &[("", 0)],
            Some(_) => &[(", first step", 0), (", last step", self.steps)],
        };
        let named = [("start", &start), ("learned", &learned)];
        let wanted = named.iter().flat_map(|&(name, phi)| {
            at.iter().map(move |&(when, step)| (format!("{name}{when}"), phi, step))
        });
        let shown = wanted.map(|(name, phi, step)| (name, self.softness, self.phi(phi, step)));
        let wanted = named.iter().flat_map(|&(name, phi)| {
            at.iter().map(move |&(when, step)| (format!("{name}{when}, surrogate"), phi, step))
        });
        let felt = wanted.filter_map(|(name, phi, step)| {
            let (softness, phi) = self.felt(phi, step)?;
            Some((name, softness, phi))
        });
        let steps: Vec<Step<B>> = shown.chain(felt).collect();
        let reach =
            steps.iter().map(|(_, softness, phi)| reach(*softness, phi)).fold(0.0, f64::max);
        let curves = steps.iter().map(|(name, softness, phi)| Curve {
            name: name.clone(),
            points: curve(*softness, phi, reach, self.size),
        });
        let mut figures = vec![Figure {
            caption:
                "The softness: coverage over the signed distance from an edge, positive inside. Where \
                 it has a surrogate, that is what the gradient is taken of."
                    .into(),
            axes: ["signed distance (pixels)".into(), "coverage".into()],
            logarithmic: [false; 2],
            curves: curves.collect(),
        }];
        if self.path.is_some() {
            let scales = |phi: &Tensor<B, 1>| {
                let pixels = self.size as f64 / 2.0;
                let scale = |step| [step as f64, pixels * self.scale(phi, step)];
                (0..self.steps.max(1)).map(scale).collect()
            };
            let curves = named.map(|(name, phi)| Curve { name: name.into(), points: scales(phi) });
            figures.push(Figure {
                caption: "The scale of the softness over the inner steps.".into(),
                axes: ["inner step".into(), "scale (pixels)".into()],
                logarithmic: [false, true],
                curves: curves.into(),
            });
        }
        figures
    }
}

/// How far from the edge a softness is still above a hundredth, in NDC.
fn reach<B: RasterBackend>(softness: EdgeSoftness, phi: &Tensor<B, 1>) -> f64 {
    const PLACES: usize = 60;
    let places: Vec<f64> = (0..PLACES).map(|k| 1e-4 * 1.2f64.powi(k as i32)).collect();
    let outside = tensor(places.iter().map(|d| -d).collect(), [PLACES]);
    let value = numbers(softness.value(phi.clone(), outside));
    let last = value.iter().rposition(|&s| s > 0.01).map_or(1e-4, |k| places[k]);
    last.min(1.0)
}

/// Points of a softness, by the distance in pixels of an image of this size.
fn curve<B: RasterBackend>(
    softness: EdgeSoftness,
    phi: &Tensor<B, 1>,
    reach: f64,
    size: usize,
) -> Vec<[f64; 2]> {
    const HALF: i32 = 150;
    let places: Vec<f64> =
        (-HALF..=HALF).map(|k| 1.3 * reach * f64::from(k) / f64::from(HALF)).collect();
    let x = tensor::<B, 1>(places.clone(), [places.len()]);
    let value = numbers(softness.value(phi.clone(), x));
    let pixels = size as f64 / 2.0;
    places.into_iter().zip(value).map(|(d, s)| [d * pixels, s]).collect()
}
