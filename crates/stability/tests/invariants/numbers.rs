//! Ends of floats: softnesses, scales of the world, files, meshes and parameters.

use softrast_inverse::{PhiLayout, Resolution, ScheduledRenderer, ScheduledSoftness};
use softrast_mesh::{Mesh, icosphere};
use softrast_raster::{RasterBackend, low_level::Rasterizer, project};
use softrast_softness::Softness;
use softrast_tensor::{numbers, tensor};
use stability::{
    Level, Tested, Trial,
    cases::SCALE,
    drawing::{Exact, RenderRequest, Single, largest},
    planar_scene::PlanarScene,
};

use crate::{Levels, SIZE, hold};

/// F13: tolerances from 1e-2 to 1e-8.
#[test]
fn culling_keeps_to_its_tolerance() {
    hold(culling);
}

/// F15.
#[test]
fn f32_is_near_f64_at_any_size_of_the_world() {
    hold(world);
}

/// F18.
#[test]
fn softnesses_from_1e_12_to_1e3_are_as_defined() {
    hold(softness);
}

/// F22.
#[test]
fn softness_files_with_what_is_no_number_are_refused() {
    hold(files);
}

/// F24.
#[test]
fn hostile_parameters_give_coverages() {
    hold(parameters);
}

/// F23.
#[test]
fn meshes_with_what_is_no_number_are_refused() {
    for word in ["nan", "inf", "1e400", "wide"] {
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 {word} 0\nf 1 2 3\n");
        assert!(Mesh::parse(text.as_bytes(), "broken.obj").is_err(), "{word}");
    }
}

fn culling(tested: &Tested) -> Levels {
    let softness = tested.at(0.05);
    let flat = PlanarScene::random(8, 30);
    let dense = RenderRequest::new(&softness, &flat, SIZE).dense();
    let level = |tolerance: f64| {
        let drawing = RenderRequest { tolerance, ..RenderRequest::new(&softness, &flat, SIZE) };
        let drawn = drawing.fused::<Exact>();
        let limit = if tolerance < 1e-6 { 1.5 } else { 1.0 };
        let off = drawn.off(&dense) / tolerance;
        Level::new(tolerance, vec![Trial::at_most(off, limit).with(&drawn.all())])
    };
    Ok([1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8].map(level).into())
}

fn world(tested: &Tested) -> Levels {
    let softness = tested.at(0.02);
    let sphere = icosphere(0);
    let level = |factor: f64| {
        let exact = viewed::<Exact>(&softness, &sphere, factor);
        let single = viewed::<Single>(&softness, &sphere, factor);
        let off = largest(exact.iter().zip(&single).map(|(a, b)| a - b));
        Level::new(factor, vec![Trial::at_most(off, 1e-4).with(&single)])
    };
    Ok([1e-1, 1.0, 1e1, 1e3, 1e6].map(level).into())
}

/// The silhouette of a mesh whose coordinates and camera are multiplied by `factor`.
fn viewed<B: RasterBackend>(softness: &ScheduledSoftness, mesh: &Mesh, factor: f64) -> Vec<f64> {
    let positions: Vec<f64> = mesh.positions().iter().flatten().map(|x| factor * x).collect();
    let vertices = tensor::<B, 3>(positions, [1, mesh.positions().len(), 3]);
    let orbit = tensor::<B, 2>(vec![3.0 * factor, 21.0, 35.0, 50.0], [1, 4]);
    let layout = PhiLayout::new(softness.clone(), Vec::new(), 1, SIZE);
    let (phi, faces) = (layout.start(), Some(mesh.faces().into()));
    let rasterizer = Rasterizer::new(SIZE);
    let renderer = ScheduledRenderer::new(layout, &phi, rasterizer, Resolution::Full, faces);
    numbers(renderer.at(1).silhouette(project(vertices, orbit)))
}

fn softness(tested: &Tested) -> Levels {
    let flat = PlanarScene::random(9, 12);
    let level = |scale: f64| {
        let softness = tested.at(scale);
        let drawing = RenderRequest::new(&softness, &flat, SIZE);
        let off = drawing.fused::<Exact>().off(&drawing.dense());
        let single = drawing.fused::<Single>();
        Ok(Level::new(scale, vec![Trial::at_most(off, 1e-5).with(&single.all())]))
    };
    [1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 1e-1, 1e1, 1e3].map(level).into_iter().collect()
}

fn files(tested: &Tested) -> Levels {
    let softness = tested.at(SCALE);
    let (softness, phi) = (softness.softness, softness.phi_at(1.0, SIZE));
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("softness.json");
    let level = |word: &str| {
        let mut words: Vec<String> = phi.iter().map(|x| format!("{x:?}")).collect();
        word.clone_into(&mut words[0]);
        let text = format!(
            "{{\"softness\": {}, \"phi\": [{}]}}",
            serde_json::to_string(&softness)?,
            words.join(", ")
        );
        std::fs::write(&path, text)?;
        let refused = ScheduledSoftness::load(&path).is_err();
        Ok(Level::named(word, vec![Trial::holds(refused)]))
    };
    ["NaN", "Infinity", "1e999", "\"wide\"", "null"].map(level).into_iter().collect()
}

fn parameters(tested: &Tested) -> Levels {
    let softness = tested.at(SCALE);
    let edge = softness.softness;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("softness.json");
    let flat = PlanarScene::random(10, 12);
    // Parameters of families other than the network are logarithms or shifts.
    let big = if edge.parameters() > 3 { 1e4 } else { 60.0 };
    let small = if edge.parameters() > 3 { -1.0 } else { -60.0 };
    // Name, sign of each parameter, their size.
    type Weights = (&'static str, fn(usize) -> f64, f64);
    let levels: [Weights; 5] = [
        ("all equal", |_| 1.0, 0.5),
        ("huge", |_| 1.0, big),
        ("zero", |_| 0.0, 1.0),
        ("negative", |_| 1.0, small),
        ("alternating", |k| if k.is_multiple_of(2) { 1.0 } else { -1.0 }, 3.0),
    ];
    let level = |(name, sign, size): Weights| {
        let phi = (0..edge.parameters()).map(|k| sign(k) * size).collect();
        ScheduledSoftness {
            softness: edge,
            phi,
            schedule: None,
            adaptive: None,
            surrogate: None,
            learning_rate: None,
            rate_end: None,
            task: None,
            note: None,
        }
        .save(&path)?;
        let softness = ScheduledSoftness::load(&path)?;
        let single = RenderRequest::new(&softness, &flat, SIZE).fused::<Single>();
        let outside = single.image.iter().filter(|a| !(0.0..=1.0).contains(*a)).count();
        let share = outside as f64 / single.image.len() as f64;
        Ok(Level::named(name, vec![Trial::at_most(share, 0.0).with(&single.all())]))
    };
    levels.map(level).into_iter().collect()
}
