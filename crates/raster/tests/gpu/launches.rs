//! Number of kernels that a step launches, from the log of `CubeCL`: each takes microseconds of the host, however small.

use std::{fs, process::Command, thread, time::Duration};

use softrast_mesh::icosphere;
use softrast_raster::{Orbit, RasterBackend, SoftRenderer, project, vertex_tensor};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::{Autodiff, Tensor};

use super::adapter;
use crate::{COPIES, Gpu};

/// Environment variable of the log in the process that runs the steps.
const LOG: &str = "CUBECL_DEBUG_LOG";
/// Number of steps, and the launch with which each starts.
const STEPS: usize = 4;
const FIRST: &str = "| OrbitMatrices |";

/// Losses of three views of a ball, and their gradient.
fn step<T: RasterBackend>(
    renderer: &SoftRenderer<EdgeSoftness>,
    target: Tensor<Autodiff<T>, 3>,
    pose: bool,
) {
    let device = Default::default();
    let ball = icosphere(2);
    let points = vertex_tensor::<Autodiff<T>>(ball.positions(), &device);
    let orbit =
        |azimuth_deg| Orbit { distance: 2.7, elevation_deg: 17.0, azimuth_deg, fov_deg: 60.0 };
    let orbits = Orbit::tensors::<Autodiff<T>>(&[4.0, 108.0, 211.0].map(orbit), &device);
    let (points, orbits) =
        if pose { (points, orbits.require_grad()) } else { (points.require_grad(), orbits) };
    let seen = project(points.clone(), orbits.clone());
    let loss = match pose {
        true => renderer.iou_loss(seen, target),
        false => renderer.mse_loss(seen, target),
    };
    // The gradient of the sum of the losses.
    let gradients = loss.backward();
    let _ = match pose {
        true => orbits.grad(&gradients).expect("a gradient").into_data(),
        false => points.grad(&gradients).expect("a gradient").into_data(),
    };
}

fn take_steps(pose: bool, size: usize) {
    let Some(log) = std::env::var_os(LOG) else { return };
    let softness = EdgeSoftness::squared(Family::Logistic);
    let renderer = SoftRenderer::new(icosphere(2).faces(), size, softness, 1e-3);
    let target = Tensor::zeros([3, size, size], &Default::default());
    for _ in 0..STEPS {
        step::<Gpu>(&renderer, target.clone(), pose);
    }
    // CubeCL writes its log in the background, and incompletely if the process ends.
    let begun = || fs::read_to_string(&log).map_or(0, |text| text.matches(FIRST).count());
    for _ in 0..600 {
        if begun() == STEPS {
            return;
        }
        thread::sleep(Duration::from_millis(100));
    }
    panic!("the log has {} of {STEPS} steps", begun());
}

#[test]
#[ignore = "run by another test, with a log of its own"]
fn steps_of_a_shape() {
    take_steps(false, 64);
}

#[test]
#[ignore = "run by another test, with a log of its own"]
fn steps_of_a_larger_shape() {
    take_steps(false, 80);
}

#[test]
#[ignore = "run by another test, with a log of its own"]
fn steps_of_a_pose() {
    take_steps(true, 64);
}

/// Launches of a step, by their names and times.
fn launched(name: &str) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a folder");
    let log = folder.path().join("log");
    let test = format!("gpu::launches::{name}");
    let run = Command::new(std::env::current_exe().expect("this test"))
        .args(["--exact", &test, "--ignored", "--nocapture"])
        .env(LOG, &log)
        .output()
        .expect("the test runs again");
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stdout));
    let text = fs::read_to_string(&log).expect("a log");
    let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("| ")).collect();
    let begins = |line: &&str| line.contains(FIRST);
    let starts: Vec<usize> = (0..lines.len()).filter(|&k| begins(&lines[k])).collect();
    // The second-to-last step is complete, and compiles nothing.
    let [.., start, end] = starts[..] else { panic!("no steps in {text}") };
    lines[start..end].iter().map(|&line| line.to_owned()).collect()
}

fn assert_few(name: &str, most: usize) {
    if !adapter() {
        return;
    }
    let found = launched(name);
    println!("{name}: {} launches a step\n{}", found.len(), found.join("\n"));
    assert!(found.len() <= most + COPIES, "{name}: {} launches a step", found.len());
}

#[test]
fn a_step_of_a_shape_launches_few_kernels() {
    assert_few("steps_of_a_shape", 15);
    assert_few("steps_of_a_larger_shape", 16);
}

#[test]
fn a_step_of_a_pose_launches_few_kernels() {
    assert_few("steps_of_a_pose", 17);
}
