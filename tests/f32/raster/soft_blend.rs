//! Soft colours of whole meshes in f32: close to f64, and correct where the result is known.

use std::sync::Arc;

use softrast_raster::{
    Attributes, Background, ColourRenderer, NEAR, Projected, RasterBackend, Weighting,
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray, Tensor};
use softrast_tests::{numbers, tensor};

type B = NdArray<f32>;
type A = Autodiff<B>;

const SIZE: usize = 16;
const EXP: DepthSoftness = DepthSoftness::Family(Family::Exp);

/// Rendering parameters of a scene.
#[derive(Clone, Copy, Debug)]
struct Look {
    edge: EdgeSoftness,
    scale: f64,
    depth: DepthSoftness,
    depth_scale: f64,
    planes: [f64; 2],
    log_weight: f64,
}

const SOFT: Look = Look {
    edge: EdgeSoftness::new(Family::Logistic),
    scale: 0.05,
    depth: EXP,
    depth_scale: 0.05,
    planes: [1.0, 5.0],
    log_weight: -10.0,
};

/// The image `[2, size, size]` of faces of these colours in front of a black background; asserts that its colours are between theirs, and
/// its gradients are finite.
fn image(corners: &[[f64; 3]], colours: &[f64], look: Look) -> Vec<f64> {
    drawn::<B>(corners, colours, look)
}

/// [`image`], after asserting that its channels differ from the image in f64 by at most `bound`.
fn image_as_in_f64(corners: &[[f64; 3]], colours: &[f64], look: Look, bound: f64) {
    // Both start with the same numbers.
    let corners = in_f32(corners);
    let expected = drawn::<NdArray<f64>>(&corners, colours, look);
    assert_as_in_f64(&image(&corners, colours, look), &expected, look, bound);
}

/// Corners rounded to f32.
fn in_f32(corners: &[[f64; 3]]) -> Vec<[f64; 3]> {
    corners.iter().map(|corner| corner.map(|x| f64::from(x as f32))).collect()
}

fn assert_as_in_f64(found: &[f64], expected: &[f64], look: Look, bound: f64) {
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() <= bound, "{k}: {found} instead of {expected}, {look:?}");
    }
}

/// The largest error of an image due to rounding of the nearness, for a depth softness of this scale.
fn of_nearness(depth_scale: f64) -> f64 {
    1e-4 + 2e-7 / depth_scale
}

fn drawn<B: RasterBackend>(corners: &[[f64; 3]], colours: &[f64], look: Look) -> Vec<f64>
where
    Autodiff<B>: RasterBackend,
{
    drawn_by::<B>(&renderer(colours.len(), look), corners, colours, look.log_weight)
}

/// A renderer of `faces` faces.
fn renderer(faces: usize, look: Look) -> ColourRenderer {
    let faces: Arc<[[u32; 3]]> = (0..faces as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let weighting = Weighting { edge: look.edge, depth: look.depth, planes: look.planes };
    let phi = [look.edge.default_phi(look.scale), look.depth.default_phi(look.depth_scale)];
    ColourRenderer::with_weighting(faces, SIZE, weighting, phi)
}

fn drawn_by<B: RasterBackend>(
    renderer: &ColourRenderer,
    corners: &[[f64; 3]],
    colours: &[f64],
    log_weight: f64,
) -> Vec<f64>
where
    Autodiff<B>: RasterBackend,
{
    let phi = renderer.phi().clone();
    let vertices =
        tensor::<Autodiff<B>, 3>(corners.as_flattened(), [1, corners.len(), 3]).require_grad();
    let values = tensor::<Autodiff<B>, 3>(colours, [1, colours.len(), 1]).require_grad();
    let [edge, depth] = phi.map(|phi| tensor::<Autodiff<B>, 1>(&phi, [phi.len()]).require_grad());
    let log_weight = tensor::<Autodiff<B>, 1>(&[log_weight], [1]).require_grad();
    let background = Background { colour: tensor(&[0.0], [1]), log_weight: log_weight.clone() };
    let attributes = Attributes::of_faces(values.clone());
    let image = renderer.image_with(
        Projected::new(vertices.clone()),
        &attributes,
        [&edge, &depth],
        &background,
    );
    let grads = (image.clone() * image.clone()).sum().backward();
    let all = [
        numbers(vertices.grad(&grads).unwrap()),
        numbers(values.grad(&grads).unwrap()),
        numbers(edge.grad(&grads).unwrap()),
        numbers(depth.grad(&grads).unwrap()),
        numbers(log_weight.grad(&grads).unwrap()),
    ];
    assert!(all.iter().flatten().all(|g| g.is_finite()), "{all:?}");
    let image = numbers(image.inner());
    let range = colours.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
    for (k, &x) in image.iter().enumerate() {
        let most = if k < SIZE * SIZE { range } else { 1.0 };
        assert!(x.abs() <= most * (1.0 + 1e-6), "{x}");
    }
    image
}

const FACE: [[f64; 3]; 3] = [[-0.9, -0.9, 2.0], [0.9, -0.9, 2.0], [0.0, 0.9, 2.0]];

fn assert_near(found: &[f64], expected: impl Iterator<Item = f64>, bound: f64) {
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() <= bound, "{k}: {found} instead of {expected}");
    }
}

#[test]
fn coincident_faces_share_alike() {
    let alone = image(&FACE, &[1.0], SOFT);
    let both = image(&[FACE, FACE].concat(), &[0.2, 0.6], SOFT);
    let share = &both[SIZE * SIZE..];
    assert_near(&both, share.iter().map(|share| 0.4 * share), 1e-6);
    // Doubled odds.
    let odds = alone.iter().map(|share| 2.0 * share / (1.0 + share));
    assert_near(share, odds.take(SIZE * SIZE), 1e-5);
}

#[test]
fn faces_that_fight_for_the_front_blend_smoothly() {
    let tilted = [[-0.9, -0.9, 1.9], [0.9, -0.9, 2.1], [0.0, 0.9, 2.0]];
    for depth_scale in [1e-6, 1e-4, 1e-2] {
        let look = Look { depth_scale, log_weight: -2.0 / depth_scale, ..SOFT };
        image_as_in_f64(&[FACE, tilted].concat(), &[0.0, 1.0], look, of_nearness(depth_scale));
    }
}

#[test]
fn many_layers_add_up() {
    const LAYERS: usize = 3000;
    let alone = image(&FACE, &[1.0], SOFT);
    let stack: Vec<_> = (0..LAYERS).flat_map(|_| FACE).collect();
    let colours: Vec<f64> = (0..LAYERS).map(|k| (k % 2) as f64).collect();
    let found = image(&stack, &colours, SOFT);
    let (colour, share) = found.split_at(SIZE * SIZE);
    // Sequential sums of thousands of numbers.
    assert_near(colour, share.iter().map(|share| 0.5 * share), 1e-4);
    let layers = LAYERS as f64;
    let odds = alone.iter().map(|share| layers * share / (1.0 + (layers - 1.0) * share));
    assert_near(share, odds.take(SIZE * SIZE), 2e-4);
}

#[test]
fn faces_that_reach_behind_the_camera_leave_no_trace() {
    let through = [[-0.9, -0.9, 2.0], [0.9, -0.9, NEAR * 0.9], [0.0, 0.9, 2.0]];
    let found = image(&[FACE, through].concat(), &[1.0, 0.5], SOFT);
    assert_near(&found, image(&FACE, &[1.0], SOFT).into_iter(), 1e-5);
    for broken in [f64::NAN, f64::INFINITY, 1e30, -1e12] {
        for axis in 0..3 {
            let mut face = FACE;
            face[1][axis] = broken;
            let found = image(&face, &[1.0], SOFT);
            assert!(found.iter().all(|&x| x == 0.0), "{broken} {axis}: {found:?}");
        }
    }
}

#[test]
fn touching_the_near_plane_is_finite() {
    let touching = [[-0.9, -0.9, 2.0], [0.9, -0.9, NEAR], [0.0, 0.9, 2.0]];
    assert!(image(&touching, &[1.0], SOFT).iter().any(|&x| x > 0.5));
}

#[test]
fn a_background_that_weighs_nothing_is_seen_through() {
    // The background is visible where nothing else is: far outside the face it dominates.
    for log_weight in [-60.0, -600.0, -6e4] {
        let look = Look { log_weight, ..SOFT };
        let found = image(&FACE, &[1.0], look);
        assert!((found[SIZE * SIZE / 2 + SIZE / 2] - 1.0).abs() < 1e-5);
        // Logarithms of weights: that of the face in the corner is about -d / scale.
        let corner = if log_weight < -100.0 { 1.0 } else { found[SIZE - 1] };
        assert!((found[SIZE - 1] - corner).abs() < 1e-5);
    }
}

#[test]
fn depths_of_all_sizes_are_told_apart_as_in_f64() {
    for scale in [2e-2, 1e-1, 1.0, 1e2, 5e3] {
        let planes = [scale, 4.0 * scale];
        for depth in [EXP, DepthSoftness::Family(Family::Logistic), DepthSoftness::Mlp] {
            for depth_scale in [1e-5, 1e-2, 1.0] {
                let look = Look { planes, depth, depth_scale, ..SOFT };
                let at = |z: f64| FACE.map(|[x, y, _]| [x, y, z * scale]);
                // At the planes, between them, in front and behind.
                let faces = [at(1.0), at(1.5), at(4.0), at(40.0), at(1.0 + 1e-6)];
                let colours = [0.1, 0.3, 0.5, 0.7, 0.9];
                image_as_in_f64(&faces.concat(), &colours, look, of_nearness(depth_scale));
            }
        }
    }
}

#[test]
fn faces_of_all_kinds_are_drawn_under_every_softness() {
    let p = [0.1, 0.1, 2.0];
    let faces = [
        [p, p, p],
        [p, p, [0.3, 0.2, 3.0]],
        [[-0.5, 0.0, 2.0], [0.0, 0.0, 2.5], [0.5, 0.0, 3.0]],
        [[-0.7, 0.0, 2.0], [0.7, 0.1, 2.0], [0.7, 0.1 + 1e-7, 3.0]],
        [[-1e5, -1e5, 2.0], [1e5, -1e5, 3.0], [0.0, 1e5, 4.0]],
        [[40.0, 40.0, 2.0], [41.0, 40.0, 2.0], [40.0, 41.0, 2.0]],
        // Its corners are centres of pixels.
        [
            [-7.0 / 16.0, -7.0 / 16.0, 2.0],
            [5.0 / 16.0, -7.0 / 16.0, 3.0],
            [-7.0 / 16.0, 5.0 / 16.0, 4.0],
        ],
    ];
    for family in Family::ALL {
        for scale in [1e-9, 1e-3, 0.1, 1e3] {
            let look = Look { edge: EdgeSoftness::new(family), scale, ..SOFT };
            // Each chooses its knots once, for all weights.
            let [of_all, of_sound, exact] = [7, 5, 5].map(|count| renderer(count, look));
            for log_weight in [0.0, -10.0, -1000.0] {
                let colours = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7];
                drawn_by::<B>(&of_all, &faces.concat(), &colours, log_weight);
                // Without faces whose distances overflow f32.
                let sound = [faces[0], faces[1], faces[2], faces[5], faces[6]].concat();
                let (sound, colours) = (in_f32(&sound), [0.1, 0.2, 0.3, 0.6, 0.7]);
                let found = drawn_by::<B>(&of_sound, &sound, &colours, log_weight);
                let expected = drawn_by::<NdArray<f64>>(&exact, &sound, &colours, log_weight);
                assert_as_in_f64(&found, &expected, look, 1e-4);
            }
        }
    }
}

#[test]
fn second_order_is_finite_and_symmetric() {
    type AA = Autodiff<A>;
    let corners = [FACE, [[-0.7, 0.6, 2.2], [0.8, 0.5, 1.8], [0.1, -0.7, 2.5]]].concat();
    let faces = [[0, 1, 2], [3, 4, 5]];
    let renderer = ColourRenderer::new(&faces, SIZE, Family::Logistic, 0.05, [1.0, 4.0]);
    let product = |direction: [f64; 18]| {
        let inner = tensor::<Autodiff<B>, 3>(corners.as_flattened(), [1, 6, 3]).require_grad();
        let vertices = Tensor::<AA, 3>::from_inner(inner.clone()).require_grad();
        let attributes = Attributes::of_faces(tensor::<AA, 3>(&[0.2, 0.9], [1, 2, 1]));
        let background = renderer.background::<AA>(&[0.5], &Default::default());
        let image = renderer.image(Projected::new(vertices.clone()), &attributes, &background);
        let grads = (image.clone() * image).sum().backward();
        let along = vertices.grad(&grads).unwrap() * tensor::<A, 3>(&direction, [1, 6, 3]);
        numbers(inner.grad(&along.sum().backward()).unwrap())
    };
    let [a, b] = [0.7, 1.9].map(|step| std::array::from_fn(|k| (step * k as f64).sin()));
    let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
    let (ab, ba) = (dot(&product(a), &b), dot(&product(b), &a));
    assert!((ab - ba).abs() < 2e-3 * ab.abs().max(1.0), "{ab} {ba}");
}
