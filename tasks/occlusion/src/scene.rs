use std::cell::RefCell;

use softrast_raster::{Background, RasterBackend, blend, hard_colour, mse_loss, nearness};
use softrast_softness::{DepthSoftness, Softness};
use softrast_tensor::{Tensor, tensor};

use crate::{Instance, Problem, instance::places};

/// Weight of the background relative to a quad that covers the pixel at the largest allowed depth.
///
/// That depth is in front of the far plane, where the depth network is 0. If a quad covers a pixel, the background has
/// at most this share of it; outside all quads it dominates. Not in the paper, whose Eq. 4 is 0/0 far from all faces;
/// this is the smallest weight in the range of docs/notes.md, Colour.
pub const BACKGROUND: f64 = 1e-3;

/// Colour behind all quads.
const BLACK: [f64; 3] = [0.0; 3];

/// Instances of OCCLUSION that are solved together, one view each.
///
/// The optimised θ is `[views, quads]`: the depth of each quad, smaller is nearer. Positions of
/// quads are fixed, so distances and textures are computed once.
#[derive(Clone, Debug)]
pub struct Scene<B: RasterBackend> {
    problem: Problem,
    /// Signed distance in NDC, `[views, quads, pixels]`.
    distance: Tensor<B, 3>,
    /// Texture, `[views, quads, 3, pixels]`.
    colour: Tensor<B, 4>,
    start: Tensor<B, 2>,
    target: Tensor<B, 3>,
    /// The edge factor of a softness that is not differentiated with respect to φ, and the key of its progress.
    fixed_edges: RefCell<Option<(u64, Tensor<B, 3>)>>,
}

impl<B: RasterBackend> Scene<B> {
    /// Instances of `problem` on images of `size` × `size` pixels.
    ///
    /// # Panics
    ///
    /// If there is no instance or no pixel, if the number of quads of an instance is not the
    /// problem's, or if a number of an instance is not finite.
    pub fn new(problem: &Problem, instances: &[Instance], size: usize) -> Self {
        assert!(!instances.is_empty() && size > 0, "a scene needs an instance and a pixel");
        instances.iter().for_each(|instance| check(problem, instance));
        let (views, count, pixels) = (instances.len(), problem.quads, size * size);
        let places: Vec<[f64; 2]> = places(size).collect();
        let quads = || instances.iter().flat_map(|instance| &instance.quads);
        let distance = quads().flat_map(|quad| places.iter().map(|&place| quad.distance(place)));
        let colour = quads().flat_map(|quad| {
            let colours: Vec<[f64; 3]> =
                places.iter().map(|&place| quad.colour_at(place)).collect();
            (0..3).flat_map(move |channel| colours.clone().into_iter().map(move |c| c[channel]))
        });
        let distance = tensor::<B, 3>(distance.collect(), [views, count, pixels]);
        let colour = tensor::<B, 4>(colour.collect(), [views, count, 3, pixels]);
        let depths = |of: fn(&Instance) -> &Vec<f64>| -> Tensor<B, 2> {
            tensor(instances.iter().flat_map(of).copied().collect(), [views, count])
        };
        let start = depths(|instance| &instance.start);
        let answer = depths(|instance| &instance.target);
        let black = tensor(BLACK.to_vec(), [3]);
        let target = hard_colour(distance.clone(), answer, colour.clone(), black);
        let fixed_edges = RefCell::new(None);
        Self { problem: *problem, distance, colour, start, target, fixed_edges }
    }

    /// θ before the first step.
    pub fn start(&self) -> Tensor<B, 2> {
        self.start.clone()
    }

    /// The target hard image, `[views, 3, pixels]`, top row first.
    pub fn target(&self) -> Tensor<B, 3> {
        self.target.clone()
    }

    /// Logarithm of the edge factor `a(d)` of Eq. 4, `[views, quads, pixels]`, for a softness with
    /// the parameters `phi`. It does not depend on θ: compute it once per `phi`.
    pub fn edges(&self, softness: &impl Softness, phi: Tensor<B, 1>) -> Tensor<B, 3> {
        softness.log_value(phi, self.distance.clone())
    }

    /// [`Scene::edges`] of a softness that is not differentiated with respect to φ, recomputed only
    /// for another `place` (key of the progress).
    pub(crate) fn fixed_edges(
        &self,
        place: u64,
        softness: &impl Softness,
        phi: Tensor<B, 1>,
    ) -> Tensor<B, 3> {
        let mut kept = self.fixed_edges.borrow_mut();
        match kept.as_ref().filter(|(of, _)| *of == place) {
            Some((_, edges)) => edges.clone(),
            None => {
                let edges = self.edges(softness, phi).detach();
                *kept = Some((place, edges.clone()));
                edges
            }
        }
    }

    /// A flat θ as `[views, quads]`.
    pub fn by_view(&self, theta: Tensor<B, 1>) -> Tensor<B, 2> {
        theta.reshape(self.start.dims())
    }

    /// The soft image at θ, `[views, 3, pixels]`: Eq. 4 with `edges` from [`Scene::edges`] and a
    /// depth softness with the parameters `phi`.
    pub fn image(
        &self,
        theta: Tensor<B, 2>,
        edges: Tensor<B, 3>,
        softness: DepthSoftness,
        phi: Tensor<B, 1>,
    ) -> Tensor<B, 3> {
        let [views, count] = theta.dims();
        let near = nearness(theta, self.problem.planes());
        let depths = softness.log_weight(phi.clone(), near).reshape([views, count, 1]);
        let [_, farthest] = self.problem.room();
        let farthest = nearness(tensor::<B, 1>(vec![farthest], [1]), self.problem.planes());
        let far = softness.log_weight(phi, farthest);
        let background =
            Background { colour: tensor(BLACK.to_vec(), [3]), log_weight: far + BACKGROUND.ln() };
        blend(edges + depths, self.colour.clone(), &background)
    }

    /// The hard image at θ, `[views, 3, pixels]`; it has no gradient.
    pub fn hard(&self, theta: Tensor<B, 2>) -> Tensor<B, 3> {
        let black = tensor(BLACK.to_vec(), [3]);
        hard_colour(self.distance.clone(), theta, self.colour.clone(), black)
    }

    /// Mean squared difference of an image `[views, 3, pixels]` and the target, `[views]`.
    pub fn loss(&self, image: Tensor<B, 3>) -> Tensor<B, 1> {
        mse_loss(image, self.target())
    }

    /// Brings θ into the range of [`Problem::room`]: if a depth is outside, all depths of that view
    /// are scaled about the middle of the range, by the factor that brings the farthest back.
    ///
    /// This preserves their order, which a clamp would turn into ties. Not in the paper: without
    /// it, depths drift apart without bound once their order is right.
    pub fn allowed(&self, theta: Tensor<B, 2>) -> Tensor<B, 2> {
        let [least, largest] = self.problem.room();
        let [middle, reach] = [0.5 * (largest + least), 0.5 * (largest - least)];
        let off = theta - middle;
        let farthest = off.clone().abs().max_dim(1).clamp_min(reach);
        off * farthest.recip() * reach + middle
    }
}

fn check(problem: &Problem, instance: &Instance) {
    let Instance { quads, target, start } = instance;
    let counts = [quads.len(), target.len(), start.len()];
    assert_eq!(counts, [problem.quads; 3], "quads, target and start of an instance");
    let of_quads = quads.iter().flat_map(|quad| {
        let [x, y] = quad.centre;
        let [width, height] = quad.half;
        [x, y, width, height, quad.angle_deg].into_iter().chain(quad.texture.colour)
    });
    let finite = of_quads.chain(target.iter().copied()).chain(start.iter().copied());
    assert!(
        finite.into_iter().all(f64::is_finite),
        "an instance holds a number that is not finite"
    );
    let flat = quads.iter().any(|quad| quad.half.iter().any(|&half| half <= 0.0));
    assert!(!flat, "a quad of an instance has no area");
}
