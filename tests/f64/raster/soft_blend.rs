//! Soft colours of whole meshes: by hand, kernel compared with reference, by differences, and their properties.

use std::sync::Arc;

use softrast_raster::{
    Attributes, Background, ColourRenderer, Projected, RasterBackend, Weighting,
    reference::{self, Scene},
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::{numbers, tensor, vector};

use super::triangles::triangles;

type B = NdArray<f64>;
type A = Autodiff<B>;
type AA = Autodiff<A>;

const SIZE: [usize; 2] = [11, 14];
const PIXELS: usize = SIZE[0] * SIZE[1];
const PLANES: [f64; 2] = [1.0, 4.0];

/// A scene: vertices `[vertices, 3]`, faces, and rendering parameters.
struct Case<S = EdgeSoftness> {
    vertices: Vec<f64>,
    faces: Arc<[[u32; 3]]>,
    /// `[entries, channels]` and the entries of the faces.
    attributes: Vec<f64>,
    entries: Arc<[[u32; 3]]>,
    channels: usize,
    /// Rows and columns of a texture, and its texels: attributes are then coordinates on it.
    texture: Option<([usize; 2], Vec<f64>)>,
    weighting: Weighting<S>,
    phi: [Vec<f64>; 2],
    /// The colour, then the logarithm of the weight.
    background: Vec<f64>,
    tolerance: f64,
    /// Whether the kernel culls back faces.
    culls: bool,
}

/// Inputs of a case, concatenated: vertices, attributes, both parameters, background, and texels if there are any.
type Inputs<T> = Vec<Tensor<T, 1>>;

impl<S: Softness> Case<S> {
    /// Random triangles at random depths with these softnesses.
    fn random(seed: u64, faces: usize, weighting: Weighting<S>, phi: [Vec<f64>; 2]) -> Self {
        let (mut vertices, faces) = triangles(seed, faces);
        for (k, z) in vertices.iter_mut().skip(2).step_by(3).enumerate() {
            if *z > 0.0 {
                *z = 2.5 + 1.4 * (2.3 * k as f64 + seed as f64).sin();
            }
        }
        let channels = 3;
        let attributes = (0..vertices.len() / 3 * channels).map(|k| (1.3 * k as f64).sin());
        Self {
            attributes: attributes.collect(),
            entries: faces.clone(),
            vertices,
            faces,
            channels,
            texture: None,
            weighting,
            phi,
            background: vec![0.2, -0.3, 0.5, -5.0],
            tolerance: 1e-9,
            culls: false,
        }
    }

    /// A case with this many channels.
    fn with_channels(mut self, channels: usize) -> Self {
        self.channels = channels;
        self.attributes = wave(self.vertices.len() / 3 * channels, 1.3);
        self.background = [wave(channels, 0.8), vec![-5.0]].concat();
        self
    }

    /// The faces whose corners appear counter-clockwise.
    fn front_faces(&self) -> Arc<[[u32; 3]]> {
        let is_front = |face: &&[u32; 3]| {
            let [a, b, c] = face.map(|v| &self.vertices[3 * v as usize..3 * v as usize + 2]);
            (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0])
        };
        self.faces.iter().filter(is_front).copied().collect()
    }

    /// The case with a texture; faces show pieces of any size.
    fn textured(mut self) -> Self {
        let size = [5, 7];
        self.attributes = wave(self.vertices.len() / 3 * 2, 1.7).iter().map(|x| 0.9 * x).collect();
        self.texture = Some((size, wave(size[0] * size[1] * self.channels, 0.77)));
        self
    }

    fn inputs<T: Backend>(&self) -> Inputs<T> {
        let [edge, depth] = &self.phi;
        let inputs = [&self.vertices, &self.attributes, edge, depth, &self.background];
        let texels = self.texture.iter().map(|(_, texels)| texels);
        inputs.into_iter().chain(texels).map(|x| vector(x)).collect()
    }

    fn renderer(&self) -> ColourRenderer<S> {
        let (faces, weighting) = (self.faces.clone(), self.weighting.clone());
        let renderer = ColourRenderer::with_weighting(faces, SIZE, weighting, self.phi.clone())
            .with_tolerance(self.tolerance);
        if self.culls { renderer.without_back_faces() } else { renderer }
    }

    /// The image `[1, channels + 1, height, width]` by the kernel or by the reference.
    fn image<T: RasterBackend>(&self, inputs: Inputs<T>, by_kernel: bool) -> Tensor<T, 4> {
        self.image_by(inputs, by_kernel.then(|| self.renderer()).as_ref())
    }

    /// The image by an existing renderer, or by the reference.
    fn image_by<T: RasterBackend>(
        &self,
        inputs: Inputs<T>,
        renderer: Option<&ColourRenderer<S>>,
    ) -> Tensor<T, 4> {
        let mut inputs = inputs.into_iter();
        let mut next = || inputs.next().expect("an input");
        let [vertices, attributes, edge, depth, background] = [(); 5].map(|()| next());
        let vertices = vertices.reshape([1, -1, 3]);
        let numbers = if self.texture.is_some() { 2 } else { self.channels };
        let attributes = attributes.reshape([1, -1, numbers as i64]);
        let mut attributes = Attributes::new(attributes, self.entries.clone());
        if let Some(([height, width], _)) = self.texture {
            attributes = attributes.with_texture(next().reshape([height, width, self.channels]));
        }
        let background = Background {
            colour: background.clone().narrow(0, 0, self.channels),
            log_weight: background.narrow(0, self.channels, 1),
        };
        if let Some(renderer) = renderer {
            renderer.image_with(Projected::new(vertices), &attributes, [&edge, &depth], &background)
        } else {
            let scene = Scene { faces: &self.faces, size: SIZE.into() };
            let phi = [edge, depth];
            reference::blended(scene, vertices, &attributes, &self.weighting, phi, &background)
        }
    }

    /// The image, the gradients of a sum of squares of it with respect to all inputs, and the gradients of a sum of these.
    fn derivatives(&self, by_kernel: bool) -> Vec<Vec<f64>> {
        let inner: Inputs<A> = self.inputs().into_iter().map(Tensor::require_grad).collect();
        let outer = |x: &Tensor<A, 1>| Tensor::<AA, 1>::from_inner(x.clone()).require_grad();
        let leaves: Inputs<AA> = inner.iter().map(outer).collect();
        let image = self.image(leaves.clone(), by_kernel);
        let planes = self.channels + 1;
        let weights = wave(planes * PIXELS, 0.37);
        let weights = tensor::<AA, 4>(&weights, [1, planes, SIZE[0], SIZE[1]]);
        let mut found = vec![numbers(image.clone().inner().inner())];
        let grads = (image.clone() * image * weights).sum().backward();
        let of = |leaf: &Tensor<AA, 1>| leaf.grad(&grads).expect("the image depends on it");
        let grads: Vec<_> = leaves.iter().map(of).collect();
        found.extend(grads.iter().map(|grad| numbers(grad.clone().inner())));
        let ramps = grads.into_iter().enumerate().map(|(k, grad)| {
            let length = grad.dims()[0];
            (grad * vector::<A>(&wave(length, 0.11 + 0.1 * k as f64))).sum()
        });
        let again = ramps.reduce(|a, b| a + b).expect("five inputs or more").backward();
        found.extend(inner.iter().map(|x| numbers(x.grad(&again).expect("second order"))));
        found
    }
}

fn wave(count: usize, step: f64) -> Vec<f64> {
    (0..count).map(|k| (step * k as f64 + 0.5).sin()).collect()
}

fn relative(a: &[f64], b: &[f64]) -> f64 {
    let norm = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>().sqrt();
    norm(&mut a.iter().zip(b).map(|(a, b)| a - b)) / norm(&mut b.iter().copied()).max(1e-12)
}

fn weighting<S>(edge: S, depth: DepthSoftness) -> Weighting<S> {
    Weighting { edge, depth, planes: PLANES }
}

const NAMES: [&str; 6] = ["vertices", "attributes", "edge", "depth", "background", "texels"];

fn compare(name: &str, case: &Case<impl Softness>, bounds: [f64; 3]) {
    assert_same(name, [case.derivatives(true), case.derivatives(false)], bounds);
}

/// Compares results of [`Case::derivatives`] with expected ones, by order.
fn assert_same(name: &str, [found, expected]: [Vec<Vec<f64>>; 2], bounds: [f64; 3]) {
    let inputs = found.len() / 2;
    for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
        let order = k.div_ceil(inputs);
        let of = if k == 0 { "image" } else { NAMES[(k - 1) % inputs] };
        let (error, bound) = (relative(found, expected), bounds[order]);
        assert!(error <= bound, "{name}, {of}, order {order}: {error:e} above {bound:e}");
    }
}

const LOGISTIC: EdgeSoftness = EdgeSoftness::new(Family::Logistic);
const EXP: DepthSoftness = DepthSoftness::Family(Family::Exp);

#[test]
fn the_kernel_agrees_with_the_reference_to_second_order() {
    let weighting = weighting(LOGISTIC, EXP);
    let phi = [LOGISTIC.default_phi(0.05), EXP.default_phi(0.1)];
    for seed in 0..5 {
        compare("logistic", &Case::random(seed, 20, weighting, phi.clone()), [1e-8, 1e-6, 1e-4]);
    }
}

#[test]
fn any_number_of_channels_agrees_with_the_reference() {
    let weighting = weighting(LOGISTIC, EXP);
    let phi = [LOGISTIC.default_phi(0.05), EXP.default_phi(0.1)];
    for channels in [1, 4, 8] {
        let case = Case::random(1, 12, weighting, phi.clone()).with_channels(channels);
        compare("channels", &case, [1e-8, 1e-6, 1e-4]);
    }
    for channels in [1, 4] {
        let case = Case::random(1, 12, weighting, phi.clone()).with_channels(channels).textured();
        compare("channels of a texture", &case, [1e-8, 1e-6, 1e-4]);
    }
}

/// A custom softness with nothing but its value.
#[derive(Clone, Debug)]
struct Tanh;

impl Softness for Tanh {
    fn value<T: Backend, const D: usize>(
        &self,
        phi: Tensor<T, 1>,
        x: Tensor<T, D>,
    ) -> Tensor<T, D> {
        ((x * phi.neg().exp().reshape([1; D])).tanh() + 1.0) * 0.5
    }
}

#[test]
fn a_softness_of_ones_own_draws_colours_to_second_order() {
    let phi = [Tanh.default_phi(0.05), EXP.default_phi(0.1)];
    for seed in 0..2 {
        let case = Case::random(seed, 20, weighting(Tanh, EXP), phi.clone());
        compare("tanh", &case, [1e-8, 1e-6, 1e-4]);
    }
}

#[test]
fn without_back_faces_there_are_only_front_faces() {
    let edge = LOGISTIC;
    let phi = [edge.default_phi(0.05), EXP.default_phi(0.2)];
    for seed in 0..3 {
        let mut case = Case::random(seed, 24, weighting(edge, EXP), phi.clone());
        let mut fronts = Case::random(seed, 24, weighting(edge, EXP), phi.clone());
        fronts.faces = fronts.front_faces();
        fronts.entries = fronts.faces.clone();
        assert!((2..23).contains(&fronts.faces.len()), "{} front faces", fronts.faces.len());
        case.culls = true;
        let both = [case.derivatives(true), fronts.derivatives(false)];
        assert_same("front faces", both, [1e-8, 1e-6, 1e-4]);
    }
}

#[test]
fn textures_agree_with_the_reference_to_second_order() {
    let weighting = weighting(LOGISTIC, EXP);
    let phi = [LOGISTIC.default_phi(0.05), EXP.default_phi(0.1)];
    // Two seeds are enough, since a texture is looked up before everything that the test above checks with five.
    for seed in 0..2 {
        let case = Case::random(seed, 20, weighting, phi.clone()).textured();
        compare("textured", &case, [1e-8, 1e-6, 1e-4]);
    }
    let mut one = Case::random(1, 20, weighting, phi).textured();
    one.texture = Some(([1, 1], vec![0.3, -0.2, 0.9]));
    let image = numbers(one.image(one.inputs::<B>(), true));
    one.attributes = [0.3, -0.2, 0.9].repeat(one.vertices.len() / 3);
    one.texture = None;
    let plain = numbers(one.image(one.inputs::<B>(), true));
    assert!(relative(&image, &plain) < 1e-12, "one texel is one colour");
}

#[test]
fn a_texture_is_seen_upright_and_repeats() {
    // A square that covers the image, of two faces, and four texels.
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let vertices: Vec<f64> = corners.iter().flat_map(|&[x, y]| [x, y, 2.0]).collect();
    let faces = [[0, 1, 2], [0, 2, 3]];
    let renderer = ColourRenderer::new(&faces, 8, Family::Logistic, 1e-6, [1.0, 3.0]);
    let seen = |turns: f64| {
        let places = corners.map(|[x, y]| [0.5 + 0.5 * x + turns, 0.5 + 0.5 * y - turns]);
        let places = tensor::<B, 3>(places.as_flattened(), [1, 4, 2]);
        let texels = tensor(&[1.0, 2.0, 3.0, 4.0], [2, 2, 1]);
        let attributes = Attributes::of_vertices(places, &faces).with_texture(texels);
        let background =
            Background { colour: tensor(&[0.0], [1]), log_weight: tensor(&[-90.0], [1]) };
        let vertices = tensor::<B, 3>(&vertices, [1, 4, 3]);
        numbers(renderer.image(Projected::new(vertices), &attributes, &background))[..64].to_vec()
    };
    let image = seen(0.0);
    let at = |row: usize, column: usize| image[8 * row + column];
    let between = |t: f64, a: f64, b: f64| a + t * (b - a);
    // Centres of pixels are at (2 k + 1) / 8 texels, those of texels at 1/2 and 3/2.
    for row in 2..6 {
        for column in 2..6 {
            let [down, right] = [row, column].map(|k| (2 * k + 1) as f64 / 8.0 - 0.5);
            let expected = between(down, between(right, 1.0, 2.0), between(right, 3.0, 4.0));
            assert!(
                (at(row, column) - expected).abs() < 1e-6,
                "{row} {column}: {}",
                at(row, column)
            );
        }
    }
    // The first texel follows the last.
    let edge = between(0.375, 1.0, 2.0);
    let wanted = between(0.375, edge, between(0.375, 3.0, 4.0));
    assert!((at(0, 0) - wanted).abs() < 1e-6, "{} {wanted}", at(0, 0));
    for (a, b) in seen(3.0).iter().zip(&image) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
}

#[test]
fn every_edge_softness_agrees_with_the_reference() {
    let squared = Family::ALL.map(EdgeSoftness::squared);
    // The kernel receives a table and no family. Squaring of the distance is the same for all, and is tested for all in fused.rs.
    let squared = squared.into_iter().step_by(3);
    let plain = Family::ALL.into_iter().map(EdgeSoftness::new);
    for edge in plain.chain(squared) {
        let (family, squared) = (edge.family, edge.scale_is_squared());
        let phi = [edge.default_phi(if squared { 0.01 } else { 0.05 }), EXP.default_phi(0.1)];
        let case = Case::random(3, 20, weighting(edge, EXP), phi);
        // The curvature of the law of Levy nearly vanishes next to the edge, and then increases faster than any other.
        let second = if family == Family::LevyForward { 2e-4 } else { 1e-4 };
        compare(&format!("{family}, squared {squared}"), &case, [1e-8, 1e-6, second]);
    }
}

#[test]
fn every_depth_softness_agrees_with_the_reference() {
    let families = Family::ALL.map(DepthSoftness::Family);
    for depth in families.into_iter().chain([DepthSoftness::Mlp]) {
        let phi = [LOGISTIC.default_phi(0.05), depth.default_phi(0.2)];
        let mut case = Case::random(4, 20, weighting(LOGISTIC, depth), phi);
        // Forward families are 0 behind the near plane: all faces have their least weight, and need a lower background.
        case.background[3] = -20.0;
        compare(&format!("depth {depth}"), &case, [1e-8, 1e-6, 1e-4]);
    }
}

/// Faces `[3 faces, 3]` with one colour each, on an image of `size`.
fn flat_faces<T: RasterBackend>(
    renderer: &ColourRenderer<impl Softness>,
    corners: &[[f64; 3]],
    colours: &[f64],
    log_weight: f64,
) -> Vec<f64> {
    let vertices = tensor::<T, 3>(corners.as_flattened(), [1, corners.len(), 3]);
    let attributes = Attributes::of_faces(tensor(colours, [1, colours.len(), 1]));
    let background =
        Background { colour: tensor(&[0.0], [1]), log_weight: tensor(&[log_weight], [1]) };
    numbers(renderer.image(Projected::new(vertices), &attributes, &background))
}

fn own_faces(count: usize) -> Arc<[[u32; 3]]> {
    (0..count as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect()
}

#[test]
fn a_pixel_worked_by_hand() {
    // The only pixel has its centre at 0. The left edge of the first face is 0.1 to its right, at depths 2 and 4: the closest point is its
    // middle, where 1/z = (1/2 + 1/4) / 2, so z = 8/3. The second face contains the pixel, at a depth of 3.
    let corners = [
        [0.1, -0.5, 2.0],
        [0.9, 0.0, 3.0],
        [0.1, 0.5, 4.0],
        [-9.0, -9.0, 3.0],
        [9.0, -9.0, 3.0],
        [0.0, 9.0, 3.0],
    ];
    let planes = [1.0, 5.0];
    let weighting = Weighting { edge: LOGISTIC, depth: EXP, planes };
    let phi = [LOGISTIC.default_phi(0.1), EXP.default_phi(0.5)];
    let renderer =
        ColourRenderer::with_weighting(own_faces(2), 1, weighting, phi).with_tolerance(1e-9);
    let [first, second] = [1.0 / (1.0 + 1f64.exp()), 1.0].map(|s: f64| s);
    let by_depth = |z: f64| (-(z - 1.0) / 4.0 / 0.5).exp();
    let (first, second) = (first * by_depth(8.0 / 3.0), second * by_depth(3.0));
    let behind = 0.01;
    let share = (first + second) / (first + second + behind);
    // At that point the attribute of corners 0 and 2, in perspective, has weight two thirds of the nearer one.
    let attributes =
        Attributes::of_corners(tensor::<B, 3>(&[3.0, 7.0, 6.0, 1.0, 1.0, 1.0], [1, 6, 1]));
    let background =
        Background { colour: tensor(&[-2.0], [1]), log_weight: tensor(&[f64::ln(behind)], [1]) };
    let vertices = tensor::<B, 3>(corners.as_flattened(), [1, 6, 3]);
    let found = numbers(renderer.image(Projected::new(vertices), &attributes, &background));
    let colour = (first * 4.0 + second - 2.0 * behind) / (first + second + behind);
    assert!((found[0] - colour).abs() < 1e-7, "{} instead of {colour}", found[0]);
    assert!((found[1] - share).abs() < 1e-7, "{} instead of {share}", found[1]);
}

#[test]
fn gradients_match_central_differences() {
    const H: f64 = 1e-5;
    for (depth, textured) in [(EXP, false), (DepthSoftness::Mlp, false), (EXP, true)] {
        let phi = [LOGISTIC.default_phi(0.05), depth.default_phi(0.2)];
        let mut case = Case::random(5, 9, weighting(LOGISTIC, depth), phi);
        if textured {
            case = case.textured();
        }
        case.tolerance = 1e-11;
        let weights = tensor::<A, 4>(&wave(4 * PIXELS, 0.37), [1, 4, SIZE[0], SIZE[1]]);
        let renderer = case.renderer();
        let value = |inputs: Inputs<A>| {
            let image = case.image_by(inputs, Some(&renderer));
            (image.clone() * image * weights.clone()).sum()
        };
        let leaves: Inputs<A> = case.inputs().into_iter().map(Tensor::require_grad).collect();
        let grads = value(leaves.clone()).backward();
        let plain: Vec<_> = case.inputs::<B>().into_iter().map(numbers).collect();
        for (which, leaf) in leaves.iter().enumerate() {
            let grad = numbers(leaf.grad(&grads).unwrap());
            let most = grad.iter().fold(0.0, |most: f64, g| most.max(g.abs()));
            for k in (0..grad.len()).step_by(grad.len().div_ceil(30)) {
                // A sliver turns over within the step.
                if which == 0 && (k / 9) % 5 == 4 {
                    continue;
                }
                let at = |h: f64| {
                    let mut moved = plain.clone();
                    moved[which][k] += h;
                    value(moved.iter().map(|x| vector(x)).collect()).into_scalar()
                };
                let slope = (at(H) - at(-H)) / (2.0 * H);
                let name = NAMES[which];
                assert!(
                    (grad[k] - slope).abs() < 1e-5 * most,
                    "{name} {k}: {} and {slope}",
                    grad[k]
                );
            }
        }
    }
}

/// `softmax_rgb_blend` of PyTorch3D, with its background where no face counts, for one channel: `faces` are signed squared distance
/// (negative inside), nearness and colour.
fn softmax_blend(faces: &[[f64; 3]], sigma: f64, gamma: f64, behind: f64) -> (f64, f64) {
    const EPS: f64 = 1e-10;
    let nearest = faces.iter().fold(EPS, |most, face| most.max(face[1]));
    let delta = ((EPS - nearest) / gamma).exp().max(EPS);
    let weight = |&[distance, nearness, _]: &[f64; 3]| {
        1.0 / (1.0 + (distance / sigma).exp()) * ((nearness - nearest) / gamma).exp()
    };
    let total = faces.iter().map(weight).sum::<f64>() + delta;
    let seen = faces.iter().map(|face| weight(face) * face[2]).sum::<f64>() + delta * behind;
    (seen / total, (total - delta) / total)
}

#[test]
fn the_blend_is_that_of_soft_ras_and_pytorch3d_where_theirs_has_no_floor() {
    // Faces parallel to the image plane, so that all definitions of their depth agree.
    let count = 12;
    let (mut vertices, faces) = triangles(2, count);
    // PyTorch3D's usual sigma and gamma: there its background is clamped to 1e-10 of the nearest face, and ours is negligible. Then softer
    // ones, where it is not.
    let planes = [1.0, 2.0];
    for (sigma, gamma) in [(1e-4, 1e-4), (1e-3, 1e-1)] {
        // Depths that differ by a few gamma: else the nearest face would dominate, up to PyTorch3D's blur radius.
        let depth = |face: usize| 1.3 + 2.0 * gamma * (2.1 * face as f64).sin();
        for (k, z) in vertices.iter_mut().skip(2).step_by(3).enumerate() {
            *z = depth(k / 3);
        }
        let edge = EdgeSoftness::squared(Family::Logistic);
        let weighting = Weighting { edge, depth: EXP, planes };
        let phi = [edge.default_phi(sigma), EXP.default_phi(gamma)];
        let renderer = ColourRenderer::with_weighting(faces.clone(), 16, weighting, phi.clone())
            .with_tolerance(1e-6);
        let colours: Vec<f64> = (0..count).map(|k| 0.5 + 0.5 * (1.9 * k as f64).cos()).collect();
        let corners: Vec<[f64; 3]> = vertices.as_chunks().0.to_vec();
        // A face at the near plane has weight 1 here, exp(1 / gamma) there.
        let found = flat_faces::<B>(&renderer, &corners, &colours, (1e-10 - 1.0) / gamma);
        let scene = Scene { faces: &faces, size: 16.into() };
        let attributes = Attributes::of_faces(tensor::<B, 3>(&colours, [1, count, 1]));
        let background = Background {
            colour: tensor(&[0.0], [1]),
            log_weight: tensor(&[(1e-10 - 1.0) / gamma], [1]),
        };
        let shaped = tensor::<B, 3>(&vertices, [1, vertices.len() / 3, 3]);
        let phi = phi.map(|phi| vector(&phi));
        let exact =
            reference::blended(scene, shaped.clone(), &attributes, &weighting, phi, &background);
        let exact = numbers(exact);
        let place = |index: usize| (2.0 * index as f64 - 15.0) / 16.0;
        let mut compared = 0;
        for pixel in 0..256 {
            let at = tensor::<B, 2>(&[place(pixel % 16), -place(pixel / 16)], [1, 2]);
            let distances = numbers(reference::signed_distance(shaped.clone(), &faces, at));
            let of_face = |(face, &d): (usize, &f64)| {
                [-d * d.abs(), (planes[1] - depth(face)) / (planes[1] - planes[0]), colours[face]]
            };
            let of_faces: Vec<_> = distances.iter().enumerate().map(of_face).collect();
            let (colour, share) = softmax_blend(&of_faces, sigma, gamma, 0.0);
            // Where PyTorch3D's floor dominates, no face has a weight above 1e-4.
            if share < 1.0 - 1e-6 && gamma < 1e-3 {
                continue;
            }
            compared += 1;
            for image in [&found, &exact] {
                let (ours, covered) = (image[pixel], image[256 + pixel]);
                assert!((ours - colour).abs() < 1e-5, "pixel {pixel}: {ours}, not {colour}");
                assert!((covered - share).abs() < 1e-5, "pixel {pixel}: {covered}, not {share}");
            }
        }
        assert!(compared > 100, "{compared}");
    }
}

#[test]
fn one_face_alone_is_its_colour_by_its_share() {
    let corners = [[-0.5, -0.6, 2.0], [0.7, -0.3, 2.0], [0.1, 0.8, 2.0]];
    let renderer = ColourRenderer::new(&[[0, 1, 2]], 16, Family::Logistic, 0.05, [1.0, 3.0]);
    let found = flat_faces::<B>(&renderer, &corners, &[0.7], -6.0);
    let (colour, share) = found.split_at(256);
    for (colour, share) in colour.iter().zip(share) {
        assert!((colour - 0.7 * share).abs() < 1e-12, "{colour} {share}");
    }
}

#[test]
fn narrow_softnesses_give_the_hard_image() {
    let corners = [
        [-0.8, -0.8, 2.0],
        [0.8, -0.8, 3.0],
        [0.0, 0.8, 4.0],
        [-0.8, 0.7, 3.5],
        [0.8, 0.7, 2.5],
        [0.1, -0.8, 2.5],
    ];
    let size = 32;
    let renderer = ColourRenderer::new(&own_faces(2), size, Family::Logistic, 1e-8, [1.0, 5.0])
        .with_depth(EXP, 1e-4);
    let found = flat_faces::<B>(&renderer, &corners, &[1.0, 2.0], -8e3);
    let [xs, ys, zs] = [0, 1, 2].map(|axis| corners.map(|corner| corner[axis]));
    let mut seen = [0; 3];
    for (pixel, found) in found[..size * size].iter().enumerate() {
        let place = |index: usize| (2.0 * index as f64 + 1.0) / size as f64 - 1.0;
        let (px, py) = (place(pixel % size), -place(pixel / size));
        // The nearest of the faces that cover the pixel, by 1/z, which is linear on the screen.
        let depth = |face: usize| {
            let k = [3 * face, 3 * face + 1, 3 * face + 2];
            let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            };
            let [a, b, c] = k.map(|v| [xs[v], ys[v]]);
            let parts = [area([px, py], b, c), area(a, [px, py], c), area(a, b, [px, py])];
            let parts = parts.map(|part| part / area(a, b, c));
            let inverse: f64 = (0..3).map(|i| parts[i] / zs[k[i]]).sum();
            parts.iter().all(|&part| part > 0.0).then(|| inverse.recip())
        };
        let nearest = match (depth(0), depth(1)) {
            (Some(a), Some(b)) => 1 + usize::from(b < a),
            (a, b) => usize::from(a.is_some()) + 2 * usize::from(b.is_some()),
        };
        seen[nearest] += 1;
        assert!((found - nearest as f64).abs() < 2e-5, "{pixel}: {found} {nearest}");
    }
    assert!(seen.iter().all(|&count| count > 100), "{seen:?}");
}

#[test]
fn permuting_the_faces_changes_nothing_above_rounding() {
    for (edge, seed) in [(Family::Logistic, 1), (Family::Uniform, 2), (Family::Cauchy, 3)] {
        let edge = EdgeSoftness::new(edge);
        let phi = [edge.default_phi(0.1), EXP.default_phi(0.1)];
        let mut case = Case::random(seed, 24, weighting(edge, EXP), phi);
        let before = numbers(case.image(case.inputs::<B>(), true));
        let mut order: Vec<usize> = (0..24).collect();
        order.sort_by_key(|&k| (k * 7 + 3) % 24);
        let permuted = |faces: &Arc<[[u32; 3]]>| order.iter().map(|&k| faces[k]).collect();
        (case.faces, case.entries) = (permuted(&case.faces), permuted(&case.entries));
        for (a, b) in numbers(case.image(case.inputs::<B>(), true)).iter().zip(before) {
            assert!((a - b).abs() < 1e-13, "{a} {b}");
        }
    }
}

/// The largest errors of the op at some tolerances, relative to the reference, which has none.
fn errors_at<const N: usize>(case: &mut Case, tolerances: [f64; N]) -> [f64; N] {
    let exact = numbers(case.image(case.inputs::<B>(), false));
    tolerances.map(|tolerance| {
        case.tolerance = tolerance;
        let found = numbers(case.image(case.inputs::<B>(), true));
        found.iter().zip(&exact).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()))
    })
}

#[test]
fn no_pixel_is_off_by_more_than_the_tolerance() {
    let depths = [EXP, DepthSoftness::Family(Family::Logistic), DepthSoftness::Mlp];
    for seed in 0..40 {
        let k = seed as usize;
        let edge = [EdgeSoftness::squared, EdgeSoftness::new][k % 2];
        let edge = edge(Family::ALL[k % Family::ALL.len()]);
        let depth = depths[k % 3];
        let phi = [edge.default_phi([0.003, 0.03, 0.1][k % 3]), depth.default_phi(0.1)];
        let mut case = Case::random(seed, 60, weighting(edge, depth), phi);
        case.background[3] = [-1.0, -4.0, -8.0][k / 3 % 3];
        let tolerances = [1e-2, 1e-4, 1e-6];
        for (tolerance, error) in tolerances.into_iter().zip(errors_at(&mut case, tolerances)) {
            // Attributes lie in [-1, 1], and the share in [0, 1].
            assert!(error <= 2.0 * tolerance, "{edge:?}, {depth}, {tolerance:e}: {error:e}");
        }
    }
}

#[test]
fn a_wide_tolerance_leaves_something_out() {
    let phi = [LOGISTIC.default_phi(0.03), EXP.default_phi(0.1)];
    let mut case = Case::random(1, 60, weighting(LOGISTIC, EXP), phi);
    assert!(errors_at(&mut case, [0.1])[0] > 1e-6);
}

#[test]
fn a_tolerance_below_rounding_is_as_exact_as_can_be() {
    let phi = [LOGISTIC.default_phi(0.03), EXP.default_phi(0.1)];
    let mut case = Case::random(1, 60, weighting(LOGISTIC, EXP), phi);
    let tolerances = [1e-12, 1e-16, 1e-100];
    for (tolerance, error) in tolerances.into_iter().zip(errors_at(&mut case, tolerances)) {
        assert!(error < 1e-9, "{tolerance:e}: {error:e}");
    }
}

#[test]
fn a_softness_that_ends_leaves_the_rest_to_a_background_that_weighs_next_to_nothing() {
    for family in [Family::Uniform, Family::Wigner, Family::ExpForward] {
        let edge = EdgeSoftness::new(family);
        let phi = [edge.default_phi(0.05), EXP.default_phi(0.1)];
        let mut case = Case::random(6, 12, weighting(edge, EXP), phi);
        (case.background[3], case.tolerance) = (-1000.0, 1e-6);
        let [found, exact] = [true, false].map(|way| numbers(case.image(case.inputs::<B>(), way)));
        let share = &exact[3 * PIXELS..];
        assert!(share.contains(&0.0) && share.iter().any(|&share| share > 0.999), "{family}");
        for (a, b) in found.iter().zip(&exact) {
            assert!((a - b).abs() < 1e-3, "{family}: {a} {b}");
        }
    }
}
