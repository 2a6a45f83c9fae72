use anyhow::ensure;
use rand::{SeedableRng, rngs::StdRng, seq::SliceRandom};
use rayon::prelude::*;
use softrast_mesh::{Mesh, icosphere};

use super::{stage::Stage, target::Target, view::ViewOfShape};
use crate::RemeshingAdam;

/// Fewest pixels per side, from a sphere and from an approximate surface.
const COARSEST: [usize; 2] = [32, 64];
/// Fewest and most pixels per side at the end, by default.
const LEAST: f64 = 64.0;
const MOST: f64 = 256.0;
/// The default is a multiple of this, so that it can be halved.
const EVEN: f64 = 32.0;
/// Length of edges in pixels, in all stages: without normals, and the shortest with normals.
const EDGE_PX: [f64; 2] = [2.4, 1.8];
/// Longest edges relative to the shortest, with normals. The surface is rougher without: curvature would be that of noise.
const LONGEST: f64 = 2.0;
/// Fraction of a stage during which edges shorten to its length.
const SHORTENS: f64 = 1.0 / 3.0;
/// Fraction of the last stage after which the rate falls, and final over initial rate.
const SETTLES: [f64; 2] = [0.15, 0.05];
/// Radius of the sphere, in units of half the extent of the object.
const SPHERE: f64 = 0.5;
/// Smoothing of a surface that is fitted to colours, relative to one that is not.
const BY_COLOURS: f64 = 5.0;
/// Steps of a stage over those of a stage at half the resolution.
const MORE: f64 = 1.3;

/// Fits the surface of an object to views by gradient descent: to masks and, where known, to normals and colours.
///
/// A closed surface is remeshed as it moves ([`RemeshingAdam`]), first on few pixels with long edges, then on more pixels with shorter
/// ones. Each step draws one view. The loss of a pixel is the absolute difference of coverage, of normals, and of colours; vertex colours
/// are optimised together with the shape. At the final resolution coverage is hard, with the gradient of soft coverage
/// ([`SoftRenderer::with_hard_image`](softrast_raster::SoftRenderer::with_hard_image)), because soft coverage would leave the surface too
/// far inside. The fit runs on the CPU, and its result is reproducible with the same steps.
///
/// The object lies around the origin, as in the frame of [`frame_of_masks`](softrast_views::frame_of_masks).
///
/// ```
/// use softrast_inverse::shape::{FoundShape, ShapeFit, ViewOfShape};
/// # use softrast_mesh::icosphere;
/// # use softrast_raster::Pinhole;
/// # use softrast_views::{Picture, View, coloured_pixels};
/// # let views: Vec<View> = [[0.0, 0.0, 4.0], [4.0, 0.0, 0.0], [0.0, 3.9, 0.5]].map(|eye| {
/// #     let camera = Pinhole::look_at(eye, [0.0; 3], [0.1, 1.0, 0.0], 40.0, 64);
/// #     let [.., mask] = coloured_pixels(&icosphere(2), &camera);
/// #     let mask = Picture::new(mask.iter().map(|&x| x as f32).collect(), 64);
/// #     View { name: "ball".into(), picture: "".into(), mask, camera, distortion: None, off: 0.0 }
/// # }).into();
/// let views = views.iter().map(ViewOfShape::of_mask).collect::<anyhow::Result<Vec<_>>>()?;
/// let found: FoundShape = ShapeFit::new(views).with_size(32).with_steps(60).run()?;
/// assert!((found.mesh.area() / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.1);
/// # Ok::<(), anyhow::Error>(())
/// ```
#[must_use]
pub struct ShapeFit<'a> {
    views: Vec<ViewOfShape>,
    start: Option<Mesh>,
    steps: usize,
    size: usize,
    most: usize,
    smoothing: f64,
    told: Box<Told<'a>>,
}

/// Callback with the number of steps taken, and the loss of the last one.
type Told<'a> = dyn FnMut(usize, f64) -> anyhow::Result<()> + 'a;

/// A fitted surface.
#[derive(Debug)]
pub struct FoundShape {
    /// The surface: closed, manifold, and in the colours of the views if they have some.
    pub mesh: Mesh,
    /// The error of `progress` that ended the fit early, if any; the mesh is that of the last step then.
    pub stopped: Option<anyhow::Error>,
}

impl<'a> ShapeFit<'a> {
    /// Largest smoothing relative to the usual.
    pub const SMOOTHEST: f64 = RemeshingAdam::SMOOTHEST / BY_COLOURS;

    /// A fit from a sphere, with 500 steps, at the resolution of the pictures around the object, from 64 × 64 to 256 × 256 pixels.
    pub fn new(views: Vec<ViewOfShape>) -> Self {
        let told = Box::new(|_, _| Ok(()));
        let pixels = views.iter().map(ViewOfShape::pixels).fold(0.0, f64::max);
        // Sizes that stay whole over a few halvings.
        let size = ((pixels / EVEN).round() * EVEN).clamp(LEAST, MOST) as usize;
        let (steps, most, smoothing) = (500, RemeshingAdam::MOST_FACES, 1.0);
        Self { views, start: None, steps, size, most, smoothing, told }
    }

    /// Starts at this surface, which is closed and approximately right.
    pub fn starting_at(self, mesh: Mesh) -> Self {
        Self { start: Some(mesh), ..self }
    }

    /// Sets the total number of steps.
    pub fn with_steps(self, steps: usize) -> Self {
        Self { steps, ..self }
    }

    /// Sets the final resolution to `size` × `size` pixels, `size` being at least 8. Edges become 2.4 of these pixels long;
    /// if all views have normals, 1.8 where the surface is curved and up to 3.6 where it is flat.
    pub fn with_size(self, size: usize) -> Self {
        Self { size, ..self }
    }

    /// Sets the largest number of faces.
    pub fn with_most_faces(self, most: usize) -> Self {
        Self { most, ..self }
    }

    /// Sets the smoothing of the surface relative to the usual.
    ///
    /// # Panics
    ///
    /// If `smoothing` is not above 0 and at most [`SMOOTHEST`](Self::SMOOTHEST).
    pub fn with_smoothing(self, smoothing: f64) -> Self {
        assert!(smoothing > 0.0 && smoothing <= Self::SMOOTHEST, "smoothing by {smoothing}");
        Self { smoothing, ..self }
    }

    /// Sets a callback with the number of steps taken and the loss, a mean over pixels. An error ends the fit.
    pub fn progress(self, told: impl FnMut(usize, f64) -> anyhow::Result<()> + 'a) -> Self {
        Self { told: Box::new(told), ..self }
    }

    /// Runs the fit.
    ///
    /// # Errors
    ///
    /// If there is no view, or the start is not closed.
    ///
    /// # Panics
    ///
    /// If `size` is below 8.
    pub fn run(mut self) -> anyhow::Result<FoundShape> {
        ensure!(!self.views.is_empty(), "a shape needs a view");
        assert!(self.size >= 8, "images of {} pixels a side", self.size);
        let reaches = || self.views.iter().map(ViewOfShape::reach);
        let reach = reaches().fold(0.0, f64::max);
        let half = reaches().sum::<f64>() / self.views.len() as f64;
        let mut levels = self.levels();
        let edge_px = EDGE_PX[usize::from(self.has_normals())];
        let length = |size: usize| edge_px * 2.0 * half / size as f64;
        let has_colours = self.views.iter().any(|view| view.colours.is_some());
        let mut before = length(levels[levels.len() - 1][0].size);
        let colour = has_colours.then(|| mean_colour(&levels[levels.len() - 1]));
        let mut shape = self.shape(half, before, colour)?;
        let steps = steps(self.steps, levels.len());
        let (mut order, mut random) = (Vec::new(), StdRng::seed_from_u64(0));
        let (mut done, mut stopped) = (0, None);
        'stages: for steps in steps {
            let targets = levels.pop().expect("a level for each stage");
            let (wanted, is_last) = (length(targets[0].size), levels.is_empty());
            let mut stage = Stage::new(&self.views, targets, reach, is_last);
            for step in 0..steps {
                let part = step as f64 / steps as f64;
                shape.set_length(before * (wanted / before).powf((part / SHORTENS).min(1.0)));
                let settled = ((part - SETTLES[0]) / (1.0 - SETTLES[0])).max(0.0);
                shape.set_rate(if is_last { SETTLES[1].powf(settled) } else { 1.0 });
                if order.is_empty() {
                    order = (0..self.views.len()).collect();
                    order.shuffle(&mut random);
                }
                let view = order.pop().expect("there is a view");
                let pulled = stage.pull(&shape, view);
                shape.step_by(pulled.vertices, pulled.colours);
                done += 1;
                if let Err(error) = (self.told)(done, pulled.loss) {
                    stopped = Some(error);
                    break 'stages;
                }
            }
            before = wanted;
        }
        let mesh = shape.mesh()?.without_self_intersections();
        if !has_colours {
            return Ok(FoundShape { mesh, stopped });
        }
        let colours = shape.colours();
        let colours = colours.chunks_exact(3).map(|c| [0, 1, 2].map(|k| f64::from(c[k])));
        Ok(FoundShape { mesh: mesh.with_colours(colours.collect())?, stopped })
    }

    /// Whether all views have normals.
    fn has_normals(&self) -> bool {
        self.views.iter().all(|view| view.normals.is_some())
    }

    /// Targets of all views by stage, those of the last stage first.
    fn levels(&self) -> Vec<Vec<Target>> {
        let coarsest = COARSEST[usize::from(self.start.is_some())];
        let size = self.size;
        let finest = self.views.par_iter().map(|view| Target::new(view, size)).collect();
        let mut levels: Vec<Vec<Target>> = vec![finest];
        loop {
            let last = &levels[levels.len() - 1];
            if last[0].size % 2 == 1 || last[0].size < 2 * coarsest {
                return levels;
            }
            let halved = last.par_iter().map(Target::halved).collect();
            levels.push(halved);
        }
    }

    /// The initial surface, with edges of this length.
    fn shape(
        &mut self,
        half: f64,
        length: f64,
        colour: Option<[f32; 3]>,
    ) -> anyhow::Result<RemeshingAdam> {
        let start = match self.start.take() {
            Some(mesh) => mesh,
            None => {
                let ball = icosphere(3);
                let place = |p: &[f64; 3]| p.map(|x| SPHERE * half * x);
                ball.with_positions(ball.positions().iter().map(place).collect())?
            }
        };
        let shape = match colour {
            Some(colour) => RemeshingAdam::with_colours(&start, length, colour)?,
            None => RemeshingAdam::new(&start, length)?,
        };
        // Colours are a noisy cue to the surface, normals a better one.
        let by_colours = colour.is_some() && self.views.iter().all(|view| view.normals.is_none());
        let usual = if by_colours { BY_COLOURS } else { 1.0 };
        let longest = if self.has_normals() { LONGEST } else { 1.0 };
        let shape = shape.with_most_faces(self.most).with_smoothing(usual * self.smoothing);
        Ok(shape.with_longest(longest))
    }
}

/// The mean colour of the pixels of some targets, weighted by the part that counts.
fn mean_colour(targets: &[Target]) -> [f32; 3] {
    let colours = || targets.iter().filter_map(|target| target.colours.as_ref());
    let counts: f32 = colours().flat_map(|colours| &colours.part).sum();
    let sum = |k: usize| colours().flat_map(|colours| &colours.levels[k]).sum::<f32>();
    [0, 1, 2].map(|k| (sum(k) / counts.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0))
}

/// Steps of each stage.
fn steps(all: usize, stages: usize) -> Vec<usize> {
    let weights: Vec<f64> = (0..stages).map(|k| MORE.powi(k as i32)).collect();
    let sum: f64 = weights.iter().sum();
    let until = |k: usize| (all as f64 * weights[..k].iter().sum::<f64>() / sum).round() as usize;
    (0..stages).map(|k| until(k + 1) - until(k)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_steps_are_taken() {
        for (all, stages) in [(500, 4), (7, 3), (1, 2), (0, 1)] {
            let steps = steps(all, stages);
            assert_eq!(steps.iter().sum::<usize>(), all);
            assert!(steps.is_sorted());
        }
    }
}
