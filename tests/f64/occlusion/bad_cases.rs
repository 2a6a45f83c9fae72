//! Degenerate scenes: every number stays finite, and known results are met.

use std::panic::catch_unwind;

use occlusion::{Instance, Pattern, Problem, Quad, Scene, Texture};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray};
use softrast_tests::{numbers, tensor};

type B = NdArray<f64>;
type A = Autodiff<B>;

fn quad(x: f64, colour: [f64; 3]) -> Quad {
    let texture = Texture { colour, pattern: Pattern::Checks, fields: 2 };
    Quad { centre: [x, 0.0], half: [0.5, 0.5], angle_deg: 10.0, texture }
}

const RED: [f64; 3] = [1.0, 0.2, 0.1];
const BLUE: [f64; 3] = [0.1, 0.3, 1.0];

fn instance(quads: Vec<Quad>, target: &[f64], start: &[f64]) -> (Problem, Instance) {
    let problem = Problem { quads: quads.len(), ..Problem::ORIGINAL };
    (problem, Instance { quads, target: target.into(), start: start.into() })
}

/// Image and gradient of its loss with respect to the depths for every depth softness from sharp to dull; asserts that all are finite.
fn assert_finite(name: &str, (problem, instance): &(Problem, Instance), size: usize) {
    let scene = Scene::<A>::new(problem, std::slice::from_ref(instance), size);
    let edge = EdgeSoftness::new(Family::Logistic);
    let families = Family::ALL.map(DepthSoftness::Family);
    for depth in families.into_iter().chain([DepthSoftness::Mlp]) {
        for scale in [1e-9, 1e-3, 0.1, 1e6] {
            for edge_scale in [1e-9, 0.01, 1e3] {
                let edge_phi = edge.default_phi(edge_scale);
                let edges = scene.edges(&edge, tensor(&edge_phi, [edge_phi.len()]));
                let leaf = scene.start().require_grad();
                let phi = depth.default_phi(scale);
                let phi = tensor(&phi, [phi.len()]);
                let image = scene.image(leaf.clone(), edges, depth, phi);
                let loss = scene.loss(image.clone());
                let what = format!("{name}, {depth} at {scale}, edges at {edge_scale}");
                let colours = numbers(image.inner());
                assert!(colours.iter().all(|c| (0.0..=1.0).contains(c)), "{what}: {colours:?}");
                let grads = loss.sum().backward();
                let grad = numbers(leaf.grad(&grads).unwrap());
                assert!(grad.iter().all(|g| g.is_finite()), "{what}: {grad:?}");
            }
        }
    }
}

#[test]
fn ties_of_depth_and_colour_give_finite_numbers() {
    let twins = || vec![quad(0.0, RED), quad(0.2, RED), quad(0.0, BLUE)];
    assert_finite("all at one depth", &instance(twins(), &[1.0; 3], &[1.0; 3]), 6);
    assert_finite("far apart", &instance(twins(), &[0.5, 1.0, 1.5], &[1.5, 0.0, 2.0]), 6);
    let same = vec![quad(0.0, RED); 2];
    assert_finite("twice the same", &instance(same, &[1.0, 1.2], &[1.2, 1.0]), 6);
}

#[test]
fn quads_out_of_view_alone_and_on_one_pixel_give_finite_numbers() {
    let off_screen = vec![quad(0.0, RED), quad(40.0, BLUE), quad(1e6, BLUE)];
    assert_finite("off screen", &instance(off_screen, &[1.0, 0.6, 0.7], &[0.6, 1.0, 0.7]), 6);
    let nothing = vec![quad(-9.0, RED), quad(9.0, BLUE)];
    assert_finite("nothing in view", &instance(nothing, &[1.0, 0.6], &[0.6, 1.0]), 6);
    assert_finite("one quad", &instance(vec![quad(0.0, RED)], &[0.7], &[1.2]), 6);
    let pair = vec![quad(0.0, RED), quad(0.1, BLUE)];
    assert_finite("one pixel", &instance(pair, &[1.0, 0.6], &[0.6, 1.0]), 1);
}

#[test]
fn one_quad_alone_is_drawn_as_it_is() {
    let (problem, instance) = instance(vec![quad(0.0, RED)], &[0.7], &[1.2]);
    let scene = Scene::<B>::new(&problem, &[instance], 16);
    let edge = EdgeSoftness::new(Family::Exp);
    let phi = edge.default_phi(1e-4);
    let edges = scene.edges(&edge, tensor(&phi, [2]));
    let depth = DepthSoftness::Family(Family::Exp);
    let image = scene.image(scene.start(), edges, depth, tensor(&depth.default_phi(0.1), [2]));
    let loss: f64 = scene.loss(image).into_scalar();
    assert!(loss < 1e-6, "{loss}");
}

#[test]
fn depths_that_leave_their_room_keep_their_order() {
    let (problem, instance) =
        instance(vec![quad(0.0, RED); 4], &[1.0, 1.1, 1.2, 1.3], &[1.0, 1.1, 1.2, 1.3]);
    let scene = Scene::<B>::new(&problem, &[instance], 2);
    let allowed = |theta: [f64; 4]| numbers(scene.allowed(tensor(&theta, [1, 4])));
    assert_eq!(problem.room(), [0.0, 2.0]);
    for (theta, expected) in [
        ([0.1, 0.5, 1.5, 1.9], [0.1, 0.5, 1.5, 1.9]),
        ([-1.0, -0.8, 1.0, 1.2], [0.0, 0.1, 1.0, 1.1]),
        ([1.0, 1.0, 1.0, 6.0], [1.0, 1.0, 1.0, 2.0]),
    ] {
        for (found, expected) in allowed(theta).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{theta:?}: {found}, not {expected}");
        }
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let refused = |broken: fn(&mut Instance)| {
        let (problem, mut instance) = instance(vec![quad(0.0, RED)], &[0.7], &[1.2]);
        broken(&mut instance);
        catch_unwind(move || Scene::<B>::new(&problem, &[instance], 4).start()).is_err()
    };
    assert!(!refused(|_| ()));
    assert!(refused(|instance| instance.start[0] = f64::NAN));
    assert!(refused(|instance| instance.target[0] = f64::INFINITY));
    assert!(refused(|instance| instance.quads[0].centre[1] = f64::NAN));
    assert!(refused(|instance| instance.quads[0].half[0] = 0.0));
    assert!(refused(|instance| instance.quads[0].texture.colour[2] = f64::NAN));
}
