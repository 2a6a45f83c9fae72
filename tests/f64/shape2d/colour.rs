//! 2D SHAPE in colour: derivatives of the loss compared with central differences, and a short solve.

use shape2d::{
    Args,
    colour::{Coloured, Colours, Scene, Start, landscape},
};
use softrast_cli::{EdgeChoice, Task, Variant};
use softrast_inverse::{InverseProblem, Method, ScheduledSoftness, SolveConfig, minimize};
use softrast_meta::Objective;
use softrast_raster::RasterBackend;
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{NdArray, Tensor};
use softrast_tests::numbers;

use crate::differences::{check_gradient, check_meta_gradient};

type B = NdArray<f64>;

const SIZE: usize = 12;
const TRIANGLES: usize = 7;
const SOFTNESS: EdgeSoftness = EdgeSoftness::new(Family::Logistic);
const SCALE: f64 = 0.08;

/// The loss of a few triangles relative to the landscape.
struct Small;

fn picture() -> Colours {
    Colours::new(landscape(SIZE), SIZE)
}

fn start() -> Start {
    Start::seeded(1, TRIANGLES, &picture())
}

impl<B: RasterBackend> Objective<B> for Small {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let scene = Scene::<B>::new(&picture(), &start());
        scene.image_loss(scene.image_with(theta, SOFTNESS, phi, 1e-10))
    }
}

/// Corners, colours and depths away from the start, where neighbours share edges.
fn theta() -> Vec<f64> {
    let start = numbers(Scene::<B>::new(&picture(), &start()).start());
    start.iter().enumerate().map(|(k, x)| x + 0.05 * (1.7 * k as f64).sin()).collect()
}

#[test]
fn the_gradient_to_corners_colours_and_depths_matches_central_differences() {
    check_gradient(&Small, &theta(), &SOFTNESS.default_phi(SCALE));
}

#[test]
fn the_meta_gradient_through_two_steps_matches_central_differences() {
    check_meta_gradient(&Small, 0.01, &theta(), SOFTNESS.default_phi(SCALE)[0]);
}

#[test]
fn a_short_solve_shows_a_small_picture() {
    let args = Args { triangles: Some(60), ..Args::default() };
    let task = Coloured::new(&args, Variant::Original, &EdgeChoice::default()).unwrap();
    let softness = ScheduledSoftness::decay(SOFTNESS, 0.02, 0.0005);
    let config = SolveConfig { size: 32, steps: 60, learning_rate: 0.01 };
    let instances = [task.instance(0).unwrap()];
    let mut psnr = Vec::new();
    let method = Method::new("logistic", softness);
    minimize::<_, B>(&task, &instances, &method, &config, |iterate, _| {
        psnr.push(-10.0 * iterate.hard_loss[0].log10());
        Ok(())
    })
    .unwrap();
    let (first, last) = (psnr[0], psnr[psnr.len() - 1]);
    assert!(last > 23.5 && last > first + 2.5, "from {first} to {last} dB");
}
