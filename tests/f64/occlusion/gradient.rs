//! The gradient of the loss with respect to depths and parameters, and its Hessian-vector products, compared with central differences in
//! f64.

use occlusion::{Instance, Problem, Scene};
use softrast_raster::RasterBackend;
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, tensor};

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

const VIEWS: usize = 2;
const SIZE: usize = 12;
/// Step of the differences.
const H: f64 = 1e-5;

/// A softness of edges and depths, and the number of entries of the vector x that are φ of each; the rest of x is θ.
#[derive(Clone, Copy)]
struct Case {
    problem: Problem,
    edge: EdgeSoftness,
    depth: DepthSoftness,
}

impl Case {
    fn scene<T: RasterBackend>(&self) -> Scene<T> {
        let instances: Vec<Instance> =
            (0..VIEWS as u64).map(|seed| Instance::seeded(seed, &self.problem)).collect();
        Scene::new(&self.problem, &instances, SIZE)
    }

    /// θ of the start, φ of the edges and φ of the depths, concatenated.
    fn x(&self) -> Vec<f64> {
        let start = numbers(self.scene::<B>().start());
        [start, self.edge.default_phi(0.03), self.depth.default_phi(0.3)].concat()
    }

    /// Sum of the losses of all views.
    fn loss<T: RasterBackend>(&self, x: Tensor<T, 1>) -> Tensor<T, 1> {
        let scene = self.scene::<T>();
        let (depths, edge) = (VIEWS * self.problem.quads, self.edge.default_phi(1.0).len());
        let theta = x.clone().narrow(0, 0, depths).reshape([VIEWS, self.problem.quads]);
        let edges = scene.edges(&self.edge, x.clone().narrow(0, depths, edge));
        let phi = x.clone().narrow(0, depths + edge, self.depth.parameters());
        scene.loss(scene.image(theta, edges, self.depth, phi)).sum()
    }

    fn gradient(&self, x: &[f64]) -> Vec<f64> {
        let leaf = tensor::<A, 1>(x, [x.len()]).require_grad();
        let grads = self.loss(leaf.clone()).backward();
        numbers(leaf.grad(&grads).unwrap())
    }

    fn check(&self) {
        let x = self.x();
        let count = x.len();
        let value = |x: &[f64]| self.loss(tensor::<B, 1>(x, [count])).into_scalar();
        let gradient = self.gradient(&x);
        let size = |values: &[f64]| values.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        for (k, grad) in gradient.iter().enumerate() {
            let at = |h: f64| {
                let mut moved = x.clone();
                moved[k] += h;
                value(&moved)
            };
            let slope = (at(H) - at(-H)) / (2.0 * H);
            let off = (grad - slope).abs() / size(&gradient);
            assert!(off < 1e-6, "{} entry {k}: {grad} and {slope}, off by {off:.1e}", self.depth);
        }

        let direction: Vec<f64> = (0..count).map(|k| (0.9 * k as f64).cos()).collect();
        let inner = tensor::<A, 1>(&x, [count]).require_grad();
        let leaf = Tensor::<AA, 1>::from_inner(inner.clone()).require_grad();
        let grads = self.loss(leaf.clone()).backward();
        let along = (leaf.grad(&grads).unwrap() * tensor(&direction, [count])).sum();
        let product = numbers(inner.grad(&along.backward()).unwrap());
        let shifted = |h: f64| -> Vec<f64> {
            self.gradient(&x.iter().zip(&direction).map(|(x, d)| x + h * d).collect::<Vec<_>>())
        };
        let (after, before) = (shifted(H), shifted(-H));
        for (k, product) in product.iter().enumerate() {
            let expected = (after[k] - before[k]) / (2.0 * H);
            let off = (product - expected).abs() / size(&after);
            assert!(off < 1e-5, "{} entry {k}: {product} and {expected}", self.depth);
        }
    }
}

fn logistic_edges(problem: Problem, depth: DepthSoftness) -> Case {
    Case { problem, edge: EdgeSoftness::new(Family::Logistic), depth }
}

#[test]
fn derivatives_match_central_differences_for_every_smooth_family() {
    for family in [Family::Logistic, Family::Gauss, Family::Exp, Family::Gamma, Family::Mlp] {
        logistic_edges(Problem::ORIGINAL, DepthSoftness::Family(family)).check();
    }
}

#[test]
fn derivatives_match_central_differences_for_the_depth_network() {
    logistic_edges(Problem::ORIGINAL, DepthSoftness::Mlp).check();
}

#[test]
fn derivatives_match_central_differences_for_eight_quads() {
    let depth = DepthSoftness::Family(Family::Exp);
    let edge = EdgeSoftness::squared(Family::Gauss);
    Case { problem: Problem::TRANSFER, edge, depth }.check();
}
