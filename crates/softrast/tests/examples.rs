//! Runs every example and checks its result. `cargo test` builds them next to this test.

use std::{env, fs, path::PathBuf, process::Command};

use softrast::{
    mesh::fox,
    prelude::*,
    tensor::{Autodiff, DType, NdArray, Tensor, TensorData},
};

fn folder() -> PathBuf {
    let test = env::current_exe().expect("a test has a path");
    test.ancestors().nth(2).expect("target/release/deps").join("examples")
}

fn runs(example: &str) -> String {
    runs_on(example, &[]).0
}

/// The output of an example, and its working folder.
fn runs_on(example: &str, words: &[&str]) -> (String, tempfile::TempDir) {
    let program = folder().join(format!("{example}{}", env::consts::EXE_SUFFIX));
    let elsewhere = tempfile::tempdir().expect("a temporary folder");
    let output = Command::new(&program).args(words).current_dir(&elsewhere).output();
    let output = output.unwrap_or_else(|error| panic!("cannot run {program:?}: {error}"));
    let [said, complained] = [&output.stdout, &output.stderr].map(|x| String::from_utf8_lossy(x));
    assert!(output.status.success(), "{example}: {said}{complained}");
    (said.into_owned(), elsewhere)
}

/// The number after the last occurrence of some words.
fn number_after(text: &str, words: &str) -> f64 {
    let rest = text.rsplit(words).next().unwrap_or_default().trim_start();
    let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
    rest[..end].parse().unwrap_or_else(|_| panic!("no number behind {words:?} in {text}"))
}

/// The mean coverage of the example's silhouette in f64, for a camera, a scale and a factor of the vertices.
fn mean_coverage(camera: Orbit, scale: f64, moved: f64) -> f64 {
    type Exact = NdArray<f64>;
    let mesh = fox();
    let positions: Vec<[f64; 3]> = mesh.positions().iter().map(|p| p.map(|x| x * moved)).collect();
    let positions: Vec<f64> = positions.into_iter().flatten().collect();
    let data = TensorData::new(positions, [1, mesh.positions().len(), 3]);
    let corners = Tensor::<Exact, 3>::from_data(data, (&Default::default(), DType::F64));
    let Orbit { distance, elevation_deg, azimuth_deg, fov_deg } = camera;
    let camera = TensorData::new(vec![distance, elevation_deg, azimuth_deg, fov_deg], [1, 4]);
    let camera = Tensor::<Exact, 2>::from_data(camera, (&Default::default(), DType::F64));
    let renderer =
        SoftRenderer::new(mesh.faces(), 64, Family::Logistic, scale).with_tolerance(1e-8);
    renderer.silhouette(project(corners, camera)).mean().into_scalar()
}

/// The number after a name in a line of debug output.
fn field(text: &str, name: &str) -> f64 {
    let rest = text.rsplit(name).next().unwrap_or_default();
    let end = rest.find([',', ')', ' ', '}']).unwrap_or(rest.len());
    rest[..end].parse().unwrap_or_else(|_| panic!("no number behind {name:?} in {text}"))
}

#[test]
fn a_silhouette_has_the_gradients_of_differences() {
    let said = runs("silhouette");
    let at = Orbit { distance: 2.7, elevation_deg: 20.0, azimuth_deg: 30.0, fov_deg: 60.0 };
    assert!((number_after(&said, "mean coverage") - mean_coverage(at, 0.01, 1.0)).abs() < 2e-3);
    let slope = |of: &dyn Fn(f64) -> f64, h: f64| (of(h) - of(-h)) / (2.0 * h);
    let by = |change: &dyn Fn(f64) -> Orbit| slope(&|h| mean_coverage(change(h), 0.01, 1.0), 1e-4);
    for (found, expected) in [
        (field(&said, "distance: "), by(&|h| Orbit { distance: at.distance + h, ..at })),
        (
            field(&said, "elevation_deg: "),
            by(&|h| Orbit { elevation_deg: at.elevation_deg + h, ..at }),
        ),
        (field(&said, "azimuth_deg: "), by(&|h| Orbit { azimuth_deg: at.azimuth_deg + h, ..at })),
        (field(&said, "fov_deg: "), by(&|h| Orbit { fov_deg: at.fov_deg + h, ..at })),
        (
            field(&said, "ln of the scale   Some("),
            slope(&|h| mean_coverage(at, 0.01 * h.exp(), 1.0), 1e-2),
        ),
    ] {
        assert!((found - expected).abs() < 2e-2 * expected.abs() + 1e-5, "{found} not {expected}");
    }
    // The norm of the gradient is at least its component along a direction: the one that enlarges the mesh.
    let norm = field(&said, "norm    Some(");
    let grown = slope(&|h| mean_coverage(at, 0.01, 1.0 + h), 1e-4);
    let length = fox().positions().iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
    assert!(norm >= 0.99 * grown / length && norm < 1.0, "{norm} {grown} {length}");
}

#[test]
fn an_own_softness_says_how_far_it_reaches_and_fits_a_sphere_to_masks() {
    let said = runs("own_softness");
    let [endless, ended] = [0, 1].map(|k| field(said.lines().nth(k).unwrap_or(""), "reach "));
    // The image is 120 / 90 * 2 wide, and its first edge 3 pixels on either side.
    assert!(endless > 1e3 && (ended / (3.0 * 2.0 / 90.0) - 1.0).abs() < 0.01, "{said}");
    assert!(number_after(&said, "loss") < 0.1, "{said}");
}

#[test]
fn an_own_softness_draws_colours_and_moves_a_mesh_to_a_picture() {
    let said = runs("own_colour");
    let first = said.lines().next().expect("a first step");
    let [start, end] = [first, &said].map(|text| number_after(text, "mean squared error"));
    assert!(start > 0.01 && end < 1e-4, "{said}");
    let shift = said.lines().last().and_then(|line| line.strip_prefix("shift [")).expect("a shift");
    let shift: Vec<f64> =
        shift.trim_end_matches(']').split(", ").filter_map(|x| x.parse().ok()).collect();
    let off = shift.iter().zip([0.05, 0.1, -0.05]).map(|(a, b)| (a - b).abs());
    assert!(shift.len() == 3 && off.fold(0.0, f64::max) < 0.005, "{said}");
}

#[test]
fn an_own_softness_is_learned_kept_in_a_file_and_solved_with() {
    let said = runs("own_learned");
    let [start, learned] =
        ["start: IoU loss", "learned: IoU loss"].map(|of| number_after(&said, of));
    assert!(learned < start, "{said}");
}

#[test]
fn a_sphere_comes_to_fit_the_masks_of_a_folder() {
    let views = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/views/fox");
    let (said, folder) = runs_on("fit_masks", &[views]);
    assert!(number_after(&said, "loss") < 0.1, "{said}");
    let mesh = Mesh::load(folder.path().join("fit.obj")).expect("a mesh");
    assert_eq!(mesh.positions().len(), 642);
}

#[test]
fn a_pose_is_found_from_a_mask() {
    assert!(number_after(&runs("pose_from_mask"), "IoU") > 0.97);
}

#[test]
fn colours_are_found_from_pictures() {
    assert!(number_after(&runs("colour"), "mean squared error") < 1e-4);
}

#[test]
fn learning_lowers_the_validation_loss() {
    let said = runs("learn");
    let losses: Vec<f64> = said
        .split("validation ")
        .skip(1)
        .map(|rest| rest.split_whitespace().next().unwrap_or_default().parse().unwrap_or(f64::NAN))
        .collect();
    let best = losses.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(best < 0.8 * losses[0], "{said}");
}

/// The loss of the pose after the example's ten steps, with the logarithm of the scale increased by `h`.
fn after_ten_steps(renderer: &SoftRenderer<Family>, h: f64) -> f64 {
    type Exact = NdArray<f64>;
    let (mesh, device) = (fox(), Default::default());
    let camera = Orbit { distance: 2.7, elevation_deg: 10.0, azimuth_deg: 0.0, fov_deg: 60.0 };
    let seen = project(vertex_tensor::<Exact>(mesh.positions(), &device), camera.tensor(&device));
    let target = hard_silhouette(seen, mesh.faces(), 32);
    let phi = renderer.phi_tensor::<Exact>(&device) + h;
    let start = Orbit { elevation_deg: 22.0, azimuth_deg: 15.0, ..camera };
    let rates = Orbit { distance: 0.0, elevation_deg: 300.0, azimuth_deg: 300.0, fov_deg: 0.0 };
    let (mut pose, rates) = (start.tensor::<Exact>(&device), rates.tensor::<Exact>(&device));
    for _ in 0..10 {
        let leaf = Tensor::<Autodiff<Exact>, 2>::from_inner(pose.clone()).require_grad();
        let corners = project(vertex_tensor(mesh.positions(), &device), leaf.clone());
        let image = renderer.silhouette_with(corners, &Tensor::from_inner(phi.clone()));
        let loss = iou_loss(image, Tensor::from_inner(target.clone())).mean();
        let gradient = leaf.grad(&loss.backward()).expect("the image depends on the pose");
        pose = pose - gradient * rates.clone();
    }
    (pose - camera.tensor(&device)).powi_scalar(2).sum().into_scalar()
}

#[test]
fn a_meta_gradient_is_that_of_differences() {
    let said = runs("meta_gradient");
    let renderer = SoftRenderer::new(fox().faces(), 32, Family::Logistic, 0.02);
    let off = number_after(&said, "squared error of the pose:");
    assert!((off - after_ten_steps(&renderer, 0.0)).abs() < 1e-2, "{said}");
    let h = 1e-4;
    let slope = (after_ten_steps(&renderer, h) - after_ten_steps(&renderer, -h)) / (2.0 * h);
    let found = number_after(&said, "of the scale:");
    assert!((found - slope).abs() < 1e-2 * slope.abs() + 1e-3, "{found} not {slope}");
}

#[test]
fn a_texture_is_found_from_pictures() {
    let said = runs("texture");
    let losses: Vec<f64> = said
        .split("mean squared error ")
        .skip(1)
        .map(|rest| rest.split_whitespace().next().unwrap_or_default().parse().unwrap_or(f64::NAN))
        .collect();
    assert!(losses.len() > 1 && losses[losses.len() - 1] < 0.1 * losses[0], "{said}");
}

#[test]
fn every_example_is_run_here() {
    let folder = env!("CARGO_MANIFEST_DIR");
    let this = fs::read_to_string(format!("{folder}/tests/examples.rs")).expect("this file");
    for entry in fs::read_dir(format!("{folder}/examples")).expect("a folder of examples") {
        let path = entry.expect("an example").path();
        let name = path.file_stem().expect("a name").to_string_lossy();
        let run = ["runs(", "runs_on("].map(|call| format!("{call}\"{name}\""));
        assert!(run.iter().any(|run| this.contains(run)), "{name} is not run");
    }
}
