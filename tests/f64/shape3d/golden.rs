//! Values before any step compared with recorded ones, to 5e-4.
//!
//! Source: docs/notes.md, Regression values. The meshes are third-party and not part of this repository.

use shape3d::{Instance, Scene, VIEWS};
use softrast_mesh::{Mesh, airplane, chair, icosphere};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::paper_mesh;

type B = NdArray<f64>;

const SIZE: usize = 64;
const TOLERANCE: f64 = 5e-4;

/// Coverage of the targets and the hard loss of the template, from this elevation.
fn start(target: &Mesh, template: &Mesh, elevation_deg: f64) -> [f64; 2] {
    let instance = Instance { elevation_deg, turn: 0 };
    let scene = Scene::<B>::new(target, template, &instance, SIZE);
    let vertices = scene.vertices(scene.start());
    let loss = scene.image_loss(scene.hard(scene.project(vertices)));
    [scene.target().mean(), loss].map(|tensor: Tensor<B, 1>| tensor.into_scalar())
}

fn assert_close(what: &str, found: f64, expected: f64) {
    let off = (found / expected - 1.0).abs();
    assert!(off < TOLERANCE, "{what}: {found}, expected {expected}, off by {off:.1e}");
}

#[test]
#[ignore = "needs the paper's meshes"]
fn the_airplane_and_the_sphere_are_as_far_apart_as_measured_before() {
    let [coverage, hard] = start(&paper_mesh("airplane.obj"), &icosphere(3), 30.0);
    assert_close("hard loss", hard, 0.8795);
    // Known to three digits.
    assert!((coverage - 0.0455).abs() < 5e-5, "coverage {coverage}");
}

#[test]
#[ignore = "needs the paper's meshes"]
fn the_released_sphere_gives_the_same() {
    let [target, template] = ["airplane.obj", "sphere_642.obj"].map(paper_mesh);
    assert_close("hard loss", start(&target, &template, 30.0)[1], 0.8795);
}

#[test]
fn our_own_targets_start_as_far_from_the_sphere_as_ever() {
    // Source: this test; a change of it is a change of the task.
    for (target, expected) in [(airplane(), 0.7765), (chair(), 0.6058)] {
        assert_close("hard loss", start(&target, &icosphere(3), 30.0)[1], expected);
    }
}

#[test]
fn there_are_24_views_of_the_target() {
    let instance = Instance { elevation_deg: 0.0, turn: 0 };
    let scene = Scene::<B>::new(&airplane(), &icosphere(0), &instance, 16);
    assert_eq!(scene.target().dims(), [VIEWS, 16, 16]);
}
