//! The squared error of an image in colour as one op: that of two ops.

use std::sync::Arc;

use softrast_raster::{
    Attributes, Background, ColourRenderer, Projected, RasterBackend, Weighting, mse_loss,
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::{numbers, tensor, vector};

use super::triangles::triangles;

type B = NdArray<f64>;
type A = Autodiff<B>;

const SIZE: [usize; 2] = [11, 14];
const VIEWS: usize = 3;
/// The two ops and the one add up the same numbers in another order.
const ROUNDING: f64 = 1e-12;

/// Random triangles in three views, with a texture or colours, shared or by view.
struct Case {
    vertices: Vec<f64>,
    faces: Arc<[[u32; 3]]>,
    renderer: ColourRenderer,
    channels: usize,
    texture: Option<[usize; 2]>,
    shared: bool,
}

impl Case {
    fn new(seed: u64, edge: EdgeSoftness, scale: f64) -> Self {
        let (mut vertices, faces) = triangles(seed, 30);
        for (k, z) in vertices.iter_mut().skip(2).step_by(3).enumerate() {
            *z = if *z > 0.0 { 2.5 + 1.4 * (2.3 * k as f64).sin() } else { *z };
        }
        let depth = DepthSoftness::Family(Family::Exp);
        let phi = [edge.default_phi(scale), depth.default_phi(0.2)];
        let weighting = Weighting { edge, depth, planes: [1.0, 4.0] };
        let renderer = ColourRenderer::with_weighting(faces.clone(), SIZE, weighting, phi);
        Self { vertices, faces, renderer, channels: 3, texture: None, shared: true }
    }

    /// Vertices of all views, attributes, background, and texels if there are any.
    fn inputs<T: Backend>(&self) -> Vec<Tensor<T, 1>> {
        let vertices: Vec<f64> = (0..VIEWS)
            .flat_map(|view| self.vertices.iter().map(move |x| x + 0.01 * view as f64))
            .collect();
        let entries = self.vertices.len() / 3 * if self.shared { 1 } else { VIEWS };
        let numbers = if self.texture.is_some() { 2 } else { self.channels };
        let background = [wave(self.channels, 0.8), vec![-3.0]].concat();
        let texels = self.texture.map(|[height, width]| wave(height * width * self.channels, 0.7));
        let all = [vertices, wave(entries * numbers, 1.3), background];
        all.iter().chain(&texels).map(|numbers| vector(numbers)).collect()
    }

    /// The loss `[views]`, by one op or by two.
    fn loss<T: RasterBackend>(
        &self,
        inputs: &[Tensor<T, 1>],
        target: Tensor<T, 4>,
        at_once: bool,
    ) -> Tensor<T, 1> {
        let views = if self.shared { 1 } else { VIEWS as i32 };
        let values = inputs[1].clone();
        let count = if self.texture.is_some() { 2 } else { self.channels as i32 };
        let mut attributes =
            Attributes::new(values.reshape([views, -1, count]), self.faces.clone());
        if let Some([height, width]) = self.texture {
            let texels = inputs[3].clone().reshape([height, width, self.channels]);
            attributes = attributes.with_texture(texels);
        }
        let background = Background {
            colour: inputs[2].clone().narrow(0, 0, self.channels),
            log_weight: inputs[2].clone().narrow(0, self.channels, 1),
        };
        let vertices = Projected::new(inputs[0].clone().reshape([VIEWS as i32, -1, 3]));
        if at_once {
            return self.renderer.mse_loss(vertices, &attributes, &background, target);
        }
        let planes = target.dims()[1];
        let image = self.renderer.image(vertices, &attributes, &background);
        mse_loss(image.narrow(1, 0, planes), target)
    }

    /// Losses, then gradients of their sum with these factors, with respect to the inputs that are `tracked`.
    fn gradients(
        &self,
        target: &Tensor<B, 4>,
        factors: &[f64; VIEWS],
        tracked: &[bool],
        at_once: bool,
    ) -> Vec<f64> {
        let inputs = self.inputs::<A>().into_iter().zip(tracked);
        let inputs: Vec<_> = inputs
            .map(|(input, &tracked)| if tracked { input.require_grad() } else { input })
            .collect();
        let losses = self.loss(&inputs, Tensor::from_inner(target.clone()), at_once);
        let mut all = numbers(losses.clone());
        let gradients = (losses * vector::<A>(factors)).sum().backward();
        for (input, _) in inputs.iter().zip(tracked).filter(|(_, tracked)| **tracked) {
            all.extend(numbers(input.grad(&gradients).expect("a gradient")));
        }
        all
    }
}

fn wave(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|k| (step * k as f64).sin()).collect()
}

fn target(views: usize, planes: usize) -> Tensor<B, 4> {
    let pixels = SIZE[0] * SIZE[1];
    tensor(&wave(views * planes * pixels, 0.37), [views, planes, SIZE[0], SIZE[1]])
}

fn assert_close(found: &[f64], expected: &[f64], of: &str) {
    assert_eq!(found.len(), expected.len(), "{of}");
    let largest = expected.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    assert!(largest > 1e-4, "{of}: nothing to compare");
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!((a - b).abs() < ROUNDING * (1.0 + largest), "{of}, {k}: {a} is not {b}");
    }
}

/// Exponential edges, and edges with a floor; colours, shared and by view, and a texture; all gradients, and those of vertices alone; factors
/// that agree, and that differ.
#[test]
fn one_op_gives_the_losses_and_gradients_of_two() {
    let logistic = || Case::new(3, EdgeSoftness::new(Family::Logistic), 0.03);
    let ends = || Case::new(4, EdgeSoftness::new(Family::CubicHermite), 0.2);
    let heavy = || Case::new(5, EdgeSoftness::new(Family::Cauchy), 0.02);
    let mut front = logistic();
    front.renderer = front.renderer.without_back_faces();
    let cases = [
        ("logistic", logistic()),
        ("by view", Case { shared: false, ..logistic() }),
        ("one channel", Case { channels: 1, ..ends() }),
        ("texture", Case { texture: Some([5, 7]), ..ends() }),
        ("heavy", heavy()),
        ("front faces", front),
    ];
    for (name, case) in &cases {
        let tracked = vec![true; case.inputs::<B>().len()];
        let alone: Vec<bool> = (0..tracked.len()).map(|k| k == 0).collect();
        for tracked in [tracked, alone] {
            for (factors, views, planes) in [
                ([1.0; VIEWS], 1, case.channels),
                ([0.25; VIEWS], VIEWS, case.channels + 1),
                ([0.5, -2.0, 0.0], VIEWS, case.channels),
                ([1.0, 0.0, 3.0], 1, case.channels),
            ] {
                let target = target(views, planes);
                let [found, expected] = [true, false]
                    .map(|at_once| case.gradients(&target, &factors, &tracked, at_once));
                assert_close(&found, &expected, &format!("{name}, {factors:?}, {tracked:?}"));
            }
        }
    }
}

/// The second order, and the gradient of the target, are those of two ops.
#[test]
fn second_orders_and_gradients_of_targets_are_those_of_two_ops() {
    let case = Case::new(6, EdgeSoftness::new(Family::Logistic), 0.05);
    let curvature = |at_once: bool| {
        let inputs: Vec<Tensor<Autodiff<A>, 1>> = case
            .inputs::<A>()
            .into_iter()
            .map(|input| Tensor::from_inner(input.require_grad()).require_grad())
            .collect();
        let target = Tensor::from_inner(Tensor::from_inner(target(1, 3)));
        let gradients = case.loss(&inputs, target, at_once).sum().backward();
        let slope = inputs[0].grad(&gradients).expect("a gradient");
        let second = (slope.clone() * slope).sum().backward();
        numbers(inputs[0].clone().inner().grad(&second).expect("a second derivative"))
    };
    assert_close(&curvature(true), &curvature(false), "second order");
    let of_target = |at_once: bool| {
        let target = Tensor::<A, 4>::from_inner(target(1, 3)).require_grad();
        let loss = case.loss(&case.inputs::<A>(), target.clone(), at_once);
        numbers(target.grad(&loss.sum().backward()).expect("a gradient"))
    };
    assert_close(&of_target(true), &of_target(false), "target");
}

#[test]
#[should_panic(expected = "a target of 3 views of 3 channels and ImageSize")]
fn another_size_is_refused() {
    let case = Case::new(7, EdgeSoftness::new(Family::Logistic), 0.05);
    let target = tensor::<B, 4>(&[0.0; 3 * 14 * 11], [1, 3, 14, 11]);
    case.loss(&case.inputs::<B>(), target, true);
}
