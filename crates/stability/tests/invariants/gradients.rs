//! Gradients against the definition and against differences, and at ends of the softness.

use stability::{
    Level, Tested, Trial,
    drawing::{Exact, RenderRequest, Single, weights},
    planar_scene::PlanarScene,
};

use crate::{Levels, SIZE, hold};

/// G04.
#[test]
fn gradients_are_those_of_all_pairs() {
    hold(against_all_pairs);
}

/// G05.
#[test]
fn gradients_are_the_limits_of_differences() {
    hold(against_differences);
}

/// G06.
#[test]
fn gradients_of_softnesses_from_1e_12_to_1e3_are_finite() {
    hold(ends);
}

fn against_all_pairs(tested: &Tested) -> Levels {
    let flat = PlanarScene::random(12, 12);
    let level = |scale: f64| {
        let softness = tested.at(scale);
        let drawing = RenderRequest::new(&softness, &flat, SIZE);
        let drawn = drawing.fused::<Exact>();
        let off = drawn.gradient_off(&drawing.dense(), 1e-12);
        Ok(Level::new(scale, vec![Trial::at_most(off, 1e-2).with(&drawn.all())]))
    };
    [0.003, 0.01, 0.03, 0.1, 0.3].map(level).into_iter().collect()
}

fn against_differences(tested: &Tested) -> Levels {
    const STEP: f64 = 1e-6;
    let softness = tested.at(0.1);
    let renderer = RenderRequest::new(&softness, &PlanarScene::plain(), SIZE).renderer::<Exact>();
    let weights = weights(SIZE);
    let level = |seed: u64| {
        let flat = PlanarScene::random(seed, 1);
        let drawn = renderer.draw(&flat, &weights);
        let weighed = |flat: &PlanarScene| {
            let image = renderer.draw(flat, &weights).image;
            image.iter().zip(&weights).map(|(a, w)| a * w).sum::<f64>()
        };
        let mut off = Vec::new();
        for k in 0..6 {
            let moved = |by: f64| {
                let mut flat = flat.clone();
                flat.corners[k / 2][k % 2] += by;
                weighed(&flat)
            };
            let difference = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            off.push(drawn.gradient[3 * (k / 2) + k % 2] - difference);
        }
        let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let off = length(&off) / length(&drawn.gradient).max(1e-9);
        Level::named(format!("seed {seed}"), vec![Trial::at_most(off, 1e-3).with(&drawn.all())])
    };
    Ok([21, 22, 23].map(level).into())
}

fn ends(tested: &Tested) -> Levels {
    let flat = PlanarScene::random(13, 12);
    let level = |scale: f64| {
        let softness = tested.at(scale);
        let drawn = RenderRequest::new(&softness, &flat, SIZE).fused::<Single>();
        let bad = drawn.gradient.iter().filter(|g| !g.is_finite()).count();
        Ok(Level::new(scale, vec![Trial::at_most(bad as f64, 0.0).with(&drawn.all())]))
    };
    [1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e3].map(level).into_iter().collect()
}
