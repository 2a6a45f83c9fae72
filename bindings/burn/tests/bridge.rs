//! Values equal those of softrast on burn 0.21, and derivatives agree with finite differences.

use softrast_burn::{
    Colours, Objective, Silhouettes,
    burn::tensor::{DType, Device, Tensor, TensorData},
    project, project_orbits,
    softrast::{
        mesh::fox,
        prelude::{
            Attributes, ColourRenderer, Family, Orbit, Pinhole, Pinholes, Projected, SoftRenderer,
        },
        raster,
        tensor::{NdArray, Tensor as Inner, numbers, tensor},
    },
};

#[allow(dead_code, reason = "the example has a program around what is tested")]
#[path = "../examples/fit.rs"]
mod example;

type Plain = NdArray<f64>;

const FACES: [[u32; 3]; 2] = [[0, 1, 2], [1, 3, 2]];
const SIZE: [usize; 2] = [6, 5];
/// Half a step of the finite differences.
const H: f64 = 1e-6;

/// Projected vertices, `[2, 4, 3]`. No pixel is so near to the end of an edge, where second
/// derivatives jump, or so near to an edge, that differences of this step miss it.
const SEEN: [[f64; 3]; 8] = [
    [-0.613, -0.487, 2.113],
    [0.521, -0.573, 1.807],
    [0.053, 0.547, 2.019],
    [0.811, 0.423, 2.317],
    [-0.519, -0.683, 2.207],
    [0.617, -0.411, 1.913],
    [-0.107, 0.523, 2.411],
    [0.709, 0.601, 2.003],
];

fn of<const D: usize>(values: Vec<f64>, dims: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, dims), (device, DType::F64))
}

fn seen() -> Tensor<3> {
    of(SEEN.concat(), [2, 4, 3], &Device::flex())
}

fn inner_seen() -> Projected<Plain> {
    Projected::new(tensor(SEEN.concat(), [2, 4, 3]))
}

/// Distinct numbers in [-1, 1].
fn wave_numbers(count: usize, phase: f64) -> Vec<f64> {
    (0..count).map(|k| (1.7 * k as f64 + phase).sin()).collect()
}

fn wave<const D: usize>(dims: [usize; D], phase: f64) -> Tensor<D> {
    of(wave_numbers(dims.iter().product(), phase), dims, &Device::flex())
}

fn soft() -> SoftRenderer<Family> {
    SoftRenderer::new(&FACES, SIZE, Family::Logistic, 0.1).with_tolerance(1e-9)
}

fn silhouettes() -> Silhouettes<Family> {
    soft().into()
}

fn colour_renderer() -> ColourRenderer<Family> {
    ColourRenderer::new(&FACES, SIZE, Family::Logistic, 0.1, [1.0, 3.0]).with_tolerance(1e-9)
}

fn colours() -> Colours<Family> {
    Colours::new(colour_renderer(), &FACES, &[0.1, 0.2])
}

/// A mask `[1, 6, 5]` with a hole, the target of all views.
fn mask_numbers() -> Vec<f64> {
    (0..30).map(|k| f64::from(u8::from(k % 5 > 0 && k != 12))).collect()
}

fn mask() -> Tensor<3> {
    of(mask_numbers(), [1, 6, 5], &Device::flex())
}

fn cameras() -> [Pinhole; 2] {
    [[0.3, 0.4, -2.5], [2.4, 0.2, 0.5]]
        .map(|eye| Pinhole::look_at(eye, [0.0; 3], [0.0, 1.0, 0.0], 50.0, SIZE))
}

const ORBITS: [Orbit; 2] = [
    Orbit { distance: 2.5, elevation_deg: 10.0, azimuth_deg: 20.0, fov_deg: 50.0 },
    Orbit { distance: 2.8, elevation_deg: -5.0, azimuth_deg: 70.0, fov_deg: 45.0 },
];

fn orbits() -> Tensor<2> {
    of(numbers(Orbit::tensors::<Plain>(&ORBITS, &Default::default())), [2, 4], &Device::flex())
}

fn world() -> Tensor<3> {
    wave([1, 4, 3], 0.5)
}

fn near<const D: usize>(found: Tensor<D>, expected: Vec<f64>, off: f64) {
    let found: Vec<f64> = found.into_data().iter().collect();
    assert_eq!(found.len(), expected.len());
    let largest = expected.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    assert!(largest > 0.0, "zeros show nothing");
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= off * largest.max(1.0), "{found} is not {expected}");
    }
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}

/// The gradient of `Σ w f` with respect to each input, along a direction.
fn gradients_are_those_of_differences<const D: usize>(
    inputs: &[Tensor<3>],
    f: impl Fn(&[Tensor<3>]) -> Tensor<D>,
) {
    let weights = wave(f(inputs).dims(), 0.3);
    let sum = |inputs: &[Tensor<3>]| (f(inputs) * weights.clone()).sum();
    let leaves: Vec<_> = inputs.iter().map(|x| x.clone().autodiff().require_grad()).collect();
    let gradients = sum(&leaves).backward();
    for (k, input) in inputs.iter().enumerate() {
        let direction = wave(input.dims(), k as f64);
        let moved = |by: f64| {
            let mut inputs = inputs.to_vec();
            inputs[k] = input.clone() + direction.clone() * by;
            sum(&inputs).into_scalar::<f64>()
        };
        let expected = (moved(H) - moved(-H)) / (2.0 * H);
        let gradient = leaves[k].grad(&gradients).expect("every input has a gradient");
        near((gradient * direction).sum(), vec![expected], 1e-6);
    }
}

#[test]
fn values_are_those_of_softrast() {
    let target = || tensor::<Plain, 3>(mask_numbers(), [1, 6, 5]);
    let (draw, inner) = (silhouettes(), soft());
    near(draw.silhouette(seen()), numbers(inner.silhouette(inner_seen())), 1e-12);
    near(draw.iou_loss(seen(), mask()), numbers(inner.iou_loss(inner_seen(), target())), 1e-12);
    near(draw.mse_loss(seen(), mask()), numbers(inner.mse_loss(inner_seen(), target())), 1e-12);

    let shown = tensor::<Plain, 3>(wave_numbers(8, 0.0), [1, 4, 2]);
    let background = colour_renderer().background(&[0.1, 0.2], &Default::default());
    let shown = Attributes::of_vertices(shown, &FACES);
    let image = colour_renderer().image(inner_seen(), &shown, &background);
    assert_eq!(image.dims(), [2, 3, 6, 5]);
    near(colours().image(seen(), wave([1, 4, 2], 0.0)), numbers(image), 1e-12);

    let corners = tensor::<Plain, 3>(wave_numbers(12, 0.5), [1, 4, 3]);
    let pinholes = Pinholes::new(&cameras(), &Default::default());
    let expected = numbers(raster::project(corners.clone(), pinholes).tensor());
    near(project(world(), &cameras()), expected, 1e-12);
    let inner_orbits: Inner<Plain, 2> = Orbit::tensors(&ORBITS, &Default::default());
    let expected = numbers(raster::project(corners, inner_orbits).tensor());
    near(project_orbits(world(), orbits()), expected, 1e-12);
}

#[test]
fn f32_stays_f32_with_the_values_of_softrast() {
    let mesh = fox();
    let renderer = SoftRenderer::new(mesh.faces(), 24, Family::Gauss, 0.02);
    let corners = softrast_burn::vertex_tensor(mesh.positions(), &Device::flex());
    let camera = cameras()[0];
    let image = Silhouettes::new(renderer.clone()).silhouette(project(corners, &[camera]));
    assert_eq!((image.dtype(), image.dims()), (DType::F32, [1, 24, 24]));
    let corners = raster::vertex_tensor::<NdArray>(mesh.positions(), &Default::default());
    let pinholes = Pinholes::new(&[camera], &Default::default());
    let expected = renderer.silhouette(raster::project(corners, pinholes));
    near(image, numbers(expected), 1e-6);
}

#[test]
fn gradients_of_silhouettes() {
    gradients_are_those_of_differences(&[seen()], |x| silhouettes().silhouette(x[0].clone()));
}

#[test]
fn gradients_of_losses() {
    gradients_are_those_of_differences(&[seen()], |x| silhouettes().iou_loss(x[0].clone(), mask()));
    gradients_are_those_of_differences(&[seen()], |x| silhouettes().mse_loss(x[0].clone(), mask()));
}

#[test]
fn gradients_of_colours() {
    let draw = colours();
    let inputs = [seen(), wave([1, 4, 2], 0.0)];
    gradients_are_those_of_differences(&inputs, |x| draw.image(x[0].clone(), x[1].clone()));
}

#[test]
fn gradients_of_projections() {
    gradients_are_those_of_differences(&[world()], |x| project(x[0].clone(), &cameras()));
    let inputs = [world(), orbits().unsqueeze_dim(0)];
    gradients_are_those_of_differences(&inputs, |x| {
        project_orbits(x[0].clone(), x[1].clone().squeeze_dim(0))
    });
}

#[test]
fn gradients_pass_through_ops_of_burn_and_of_softrast() {
    gradients_are_those_of_differences(&[world()], |x| {
        let seen = project(x[0].clone().sin() * 0.5, &cameras());
        silhouettes().silhouette(seen.clone()).exp().sum_dim(2) + seen.mean_dim(1).sum_dim(2)
    });
}

#[test]
fn the_jvp_is_that_of_differences() {
    let (draw, direction) = (silhouettes(), wave([2, 4, 3], 0.7));
    let moved = |by: f64| draw.silhouette(seen() + direction.clone() * by);
    let expected = (moved(H) - moved(-H)) / (2.0 * H);
    let found = draw.jvp(seen().autodiff().require_grad(), direction);
    assert!(!found.is_autodiff());
    near(found, values(expected), 1e-6);
}

#[test]
fn the_hvp_is_that_of_differences_of_gradients() {
    let (draw, direction) = (silhouettes(), wave([2, 4, 3], 0.7));
    let weights = wave([2, 6, 5], 0.1);
    for objective in [Objective::Weighted(weights), Objective::Iou(mask()), Objective::Mse(mask())]
    {
        let gradient = |by: f64| {
            let leaf = (seen() + direction.clone() * by).autodiff().require_grad();
            let value = match &objective {
                Objective::Weighted(weights) => {
                    (draw.silhouette(leaf.clone()) * weights.clone()).sum()
                }
                Objective::Iou(mask) => draw.iou_loss(leaf.clone(), mask.clone()).sum(),
                Objective::Mse(mask) => draw.mse_loss(leaf.clone(), mask.clone()).sum(),
            };
            leaf.grad(&value.backward()).expect("the value depends on the vertices")
        };
        let expected = (gradient(H) - gradient(-H)) / (2.0 * H);
        let found = draw.hvp(seen(), direction.clone(), &objective);
        assert!(!found.is_autodiff());
        near(found, values(expected), 1e-5);
    }
}

#[test]
fn constants_have_no_gradient() {
    let device = Device::flex().autodiff();
    let constant = of(SEEN.concat(), [2, 4, 3], &device);
    assert!(!silhouettes().silhouette(constant.clone()).is_tracked());
    // One of two inputs is tracked, and the other has no autodiff at all.
    let shown = wave([1, 4, 2], 0.0).autodiff().require_grad();
    let image = colours().image(seen(), shown.clone());
    let gradients = image.sum().backward();
    assert!(shown.grad(&gradients).is_some() && constant.grad(&gradients).is_none());
}

#[test]
fn a_target_has_no_gradient() {
    let [leaf, target] = [seen(), mask()].map(|x| x.autodiff().require_grad());
    let gradients = silhouettes().iou_loss(leaf.clone(), target.clone()).sum().backward();
    assert!(leaf.grad(&gradients).is_some() && target.grad(&gradients).is_none());
}

#[test]
fn an_image_keeps_its_gradient_when_the_renderer_changes() {
    let gradient = |change: bool| {
        let (mut draw, leaf) = (silhouettes(), seen().autodiff().require_grad());
        let image = draw.silhouette(leaf.clone());
        if change {
            draw.renderer_mut().set_width(0.3);
        }
        values(leaf.grad(&image.sum().backward()).expect("the image depends on the vertices"))
    };
    assert_eq!(gradient(true), gradient(false));
}

#[test]
#[should_panic(expected = "one float type")]
fn two_float_types_panic() {
    let half = mask().cast(DType::F32);
    silhouettes().iou_loss(seen(), half);
}

#[test]
fn the_example_lowers_its_loss() {
    let losses = example::fit(24, 40);
    let (first, last) = (losses[0], losses[39]);
    assert!(last < 0.6 * first, "from {first} to {last}");
}

#[cfg(feature = "ndarray")]
#[test]
#[allow(deprecated)]
fn ndarray_draws_the_same() {
    let device = Device::ndarray().autodiff();
    let draw = |x: Tensor<3>| {
        let leaf = x.autodiff().require_grad();
        let image = silhouettes().silhouette(leaf.clone());
        let gradients = image.clone().sum().backward();
        [values(image), values(leaf.grad(&gradients).expect("the image depends on it"))]
    };
    assert_eq!(draw(of(SEEN.concat(), [2, 4, 3], &device)), draw(seen()));
}
