use std::{cell::RefCell, collections::BTreeMap, sync::Arc};

use burn::tensor::{Element, Tensor, TensorData};
use softrast_raster::{RasterBackend, Rasterizer, Silhouette};
use softrast_runner::{Curve, Figure, Plan};
use softrast_softness::{EdgeSoftness, Family, ScalePath, Softness, SoftnessFile};

use crate::{Method, numbers, tensor};

/// A scale may fall by this factor before support and knots are chosen anew, which costs as much here
/// as drawing several images.
const STALE: f64 = 0.85;
/// Least share of a scale that stands above the floor where a path starts.
const ABOVE_FLOOR: f64 = 0.05;

/// The softness of edges as something to learn.
///
/// What is learned is one vector: the parameters of a softness that stays as it is; or, where its
/// scale moves, first the knots of a [`ScalePath`], then the parameters at scale 1 without the
/// logarithm of the scale, which the path replaces.
#[derive(Clone, Debug)]
pub struct LearnedEdge {
    softness: EdgeSoftness,
    /// Parameters to start from; at scale 1 where there is a path.
    phi: Vec<f64>,
    path: Option<ScalePath>,
    steps: usize,
    size: usize,
}

impl LearnedEdge {
    /// Begins with what `method` does on runs of `steps` steps and images of `size` × `size` pixels.
    pub fn new(method: &Method, plan: &Plan, steps: usize, size: usize) -> Self {
        let softness = method.softness();
        if method.is_static() {
            let phi = method.phi(method.scale(0, steps));
            return Self { softness, phi, path: None, steps, size };
        }
        let mut path = ScalePath { knots: Vec::new(), floor_px: plan.floor_px };
        let floor = path.floor(softness, size);
        let last = plan.knots.max(2) - 1;
        path.knots = (0..plan.knots)
            .map(|k| {
                let step = (steps.saturating_sub(1) * k).div_ceil(last);
                let scale = method.scale(step, steps);
                (scale - floor).max(ABOVE_FLOOR * scale).ln()
            })
            .collect();
        Self { softness, phi: method.unit_phi(), path: Some(path), steps, size }
    }

    /// The vector that learning starts from.
    pub fn start(&self) -> Vec<f64> {
        let knots = self.path.iter().flat_map(|path| &path.knots);
        knots.chain(&self.phi[self.fixed()..]).copied().collect()
    }

    /// Length of the learned vector.
    pub fn parameters(&self) -> usize {
        self.knots() + self.phi.len() - self.fixed()
    }

    /// Softness and parameters `[P]` at an inner step, from the learned vector.
    pub fn phi<B: RasterBackend>(&self, learned: &Tensor<B, 1>, step: usize) -> Tensor<B, 1> {
        let Some(path) = &self.path else { return learned.clone() };
        let (knots, fixed) = (self.knots(), self.fixed());
        let scale = ScalePath::scale(
            &learned.clone().narrow(0, 0, knots),
            path.floor(self.softness, self.size),
            self.part(step),
        );
        let mut parts = vec![tensor(self.phi[..fixed].to_vec(), [fixed])];
        if self.phi.len() > fixed {
            parts.push(learned.clone().narrow(0, knots, self.phi.len() - fixed));
        }
        parts.retain(|part| part.dims() != [0]);
        self.softness.widened(Tensor::cat(parts, 0), scale)
    }

    /// Which softness the parameters belong to.
    pub fn softness(&self) -> EdgeSoftness {
        self.softness
    }

    /// Prepares silhouettes of meshes with these faces for all steps of a run near `learned`.
    pub fn prepare<B: RasterBackend>(
        &self,
        rasterizer: Rasterizer,
        faces: &Arc<[[u32; 3]]>,
        learned: &[f64],
    ) -> PreparedRun {
        let learned = tensor::<B, 1>(learned.to_vec(), [learned.len()]);
        let mut silhouettes: Vec<Silhouette<EdgeSoftness>> = Vec::new();
        let (mut of_step, mut prepared) = (Vec::new(), f64::NAN);
        for step in 0..=self.steps {
            let scale = match &self.path {
                None => 1.0,
                Some(_) => self.scale(&learned, step),
            };
            // Not a number at first, which is in no range.
            if !(STALE..=1.0).contains(&(scale / prepared)) {
                let phi = self.phi(&learned, step);
                silhouettes.push(rasterizer.prepare(faces, self.softness, &phi));
                prepared = scale;
            }
            of_step.push(silhouettes.len() - 1);
        }
        PreparedRun { silhouettes, of_step, tables: RefCell::default() }
    }

    /// The file `softness.json` of a vector that was learned at a learning rate of the inner loops:
    /// name and text.
    ///
    /// # Errors
    ///
    /// If the vector is not what a file may hold.
    pub fn files(
        &self,
        learned: &[f64],
        learning_rate: f64,
        note: &str,
    ) -> anyhow::Result<Vec<(&'static str, String)>> {
        let (knots, own) = learned.split_at(self.knots());
        let phi = self.phi[..self.fixed()].iter().chain(own).copied().collect();
        let path = self.path.as_ref().map(|path| ScalePath { knots: knots.to_vec(), ..*path });
        let (softness, note) = (self.softness, Some(note.to_owned()));
        let learning_rate = Some(learning_rate);
        let file = SoftnessFile { softness, phi, path, learning_rate, note };
        let name = "softness.json";
        Ok(vec![(name, file.text(name.as_ref())?)])
    }

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
        let wanted: Vec<_> = wanted.collect();
        let reach = wanted.iter().map(|(_, phi, step)| self.reach(phi, *step)).fold(0.0, f64::max);
        let curves = wanted.iter().map(|(name, phi, step)| Curve {
            name: name.clone(),
            points: self.curve(phi, *step, reach),
        });
        let mut figures = vec![Figure {
            caption:
                "The softness: coverage over the signed distance from an edge, positive inside."
                    .into(),
            axes: ["signed distance (pixels)".into(), "coverage".into()],
            logarithmic: false,
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
                logarithmic: true,
                curves: curves.into(),
            });
        }
        figures
    }

    /// How far from the edge the softness is still above a hundredth, in NDC.
    fn reach<B: RasterBackend>(&self, learned: &Tensor<B, 1>, step: usize) -> f64 {
        const PLACES: usize = 60;
        let places: Vec<f64> = (0..PLACES).map(|k| 1e-4 * 1.2f64.powi(k as i32)).collect();
        let outside = tensor(places.iter().map(|d| -d).collect(), [PLACES]);
        let value = numbers(self.softness.value(self.phi(learned, step), outside));
        let last = value.iter().rposition(|&s| s > 0.01).map_or(1e-4, |k| places[k]);
        last.min(1.0)
    }

    fn curve<B: RasterBackend>(
        &self,
        learned: &Tensor<B, 1>,
        step: usize,
        reach: f64,
    ) -> Vec<[f64; 2]> {
        const HALF: i32 = 150;
        let places: Vec<f64> =
            (-HALF..=HALF).map(|k| 1.3 * reach * f64::from(k) / f64::from(HALF)).collect();
        let x = tensor::<B, 1>(places.clone(), [places.len()]);
        let value = numbers(self.softness.value(self.phi(learned, step), x));
        let pixels = self.size as f64 / 2.0;
        places.into_iter().zip(value).map(|(d, s)| [d * pixels, s]).collect()
    }

    fn scale<B: RasterBackend>(&self, learned: &Tensor<B, 1>, step: usize) -> f64 {
        let Some(path) = &self.path else { return 1.0 };
        let floor = path.floor(self.softness, self.size);
        let knots = learned.clone().narrow(0, 0, self.knots());
        numbers(ScalePath::scale(&knots, floor, self.part(step)))[0]
    }

    /// Which part of the run is over; the last gradient is taken at the last scale, as in [`Method`].
    fn part(&self, step: usize) -> f64 {
        let last = self.steps.saturating_sub(1).max(1);
        step.min(last) as f64 / last as f64
    }

    /// Steps with the same number have the same softness.
    pub fn stage(&self, step: usize) -> usize {
        if self.path.is_some() { step } else { 0 }
    }

    fn knots(&self) -> usize {
        self.path.as_ref().map_or(0, |path| path.knots.len())
    }

    /// Leading parameters that a path replaces.
    fn fixed(&self) -> usize {
        usize::from(self.path.is_some() && self.softness.family != Family::Mlp)
    }
}

/// A step of an inner loop, and what it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// How many steps came before.
    pub number: usize,
    /// What the vector is that stands for the softness.
    pub of: Of,
}

/// What stands for a softness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// φ, by which derivatives are asked for.
    Phi,
    /// φ as mere numbers: what depends on it alone may be kept.
    Values,
    /// What [`Lesson::prepared`](crate::Lesson::prepared) gave.
    Prepared,
}

/// Silhouettes for every step of a run, whose support and knots suit the scale there.
#[derive(Clone, Debug)]
pub struct PreparedRun {
    silhouettes: Vec<Silhouette<EdgeSoftness>>,
    of_step: Vec<usize>,
    /// A learned vector, and tables of the steps that were drawn under it without a gradient to it.
    tables: RefCell<Tables>,
}

#[derive(Clone, Debug, Default)]
struct Tables {
    learned: Vec<f64>,
    of_step: BTreeMap<usize, TensorData>,
}

impl PreparedRun {
    /// Coverage `[views, size, size]` of `vertices` `[views, vertices, 3]` at an inner step, the
    /// last one for later ones.
    pub fn image<B: RasterBackend>(
        &self,
        edge: &LearnedEdge,
        vertices: Tensor<B, 3>,
        learned: &Tensor<B, 1>,
        step: Step,
    ) -> Tensor<B, 3> {
        let number = step.number.min(self.of_step.len() - 1);
        let silhouette = &self.silhouettes[self.of_step[number]];
        let table = match step.of {
            Of::Prepared => learned.clone().reshape([-1, 4]),
            Of::Phi => silhouette.table(edge.phi(learned, number)),
            Of::Values => {
                let mut tables = self.tables.borrow_mut();
                let values = numbers(learned.clone());
                if tables.learned != values {
                    *tables = Tables { learned: values, of_step: BTreeMap::new() };
                }
                let table = tables
                    .of_step
                    .entry(edge.stage(number))
                    .or_insert_with(|| silhouette.table(edge.phi(learned, number)).into_data());
                let dtype = <B::FloatElem as Element>::dtype();
                Tensor::from_data(table.clone(), (&learned.device(), dtype))
            }
        };
        silhouette.coverage_by_table(vertices, table)
    }

    /// The table of a step, flat: all that [`image`](PreparedRun::image) needs of the softness.
    pub fn prepared<B: RasterBackend>(
        &self,
        edge: &LearnedEdge,
        learned: &Tensor<B, 1>,
        step: usize,
    ) -> Tensor<B, 1> {
        let number = step.min(self.of_step.len() - 1);
        self.silhouettes[self.of_step[number]].table(edge.phi(learned, number)).flatten(0, 1)
    }
}
