//! Guarantees of this project for every softness and scene: a trial that misses its target is a fault.
//!
//! Identifiers such as F01 are those of docs/studies/stability.md.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod depths;
mod descents;
mod faces;
mod gradients;
mod many;
mod meta_gradients;
mod numbers;

use std::sync::Arc;

use softrast_softness::{Family, Softness};
use softrast_tensor::{numbers, tensor};
use stability::{
    Level, Tested, Trial,
    cases::SCALE,
    drawing::{Exact, RenderRequest, Renderer, Single, weights},
    planar_scene::PlanarScene,
};

type Levels = anyhow::Result<Vec<Level>>;
/// Faces, and their renderers in both float types.
type Renderers = (Arc<[[u32; 3]]>, Renderer<Exact>, Renderer<Single>);

/// Width and height of small images.
const SIZE: usize = 16;

/// Checks a guarantee for every family, and for a decaying width.
fn hold(promise: impl Fn(&Tested) -> Levels) {
    let families = Family::ALL.into_iter().map(Tested::family);
    families.chain([Tested::decay()]).for_each(|tested| hold_one(&promise, &tested));
}

/// Families whose tails do not end, so that a face is faintly visible at any distance: tails of Lévy, Cauchy and the reciprocal fall as a
/// power of the distance, and the logit of a network that has not been trained stops at 15, which leaves 3e-7 everywhere.
const ENDLESS: [Family; 5] =
    [Family::Levy, Family::LevyForward, Family::Cauchy, Family::Reciprocal, Family::Mlp];

#[test]
fn the_families_without_an_end_of_their_tails_are_those_of_the_list() {
    let is_endless = |family: &Family| {
        let softness = Tested::family(*family).at(SCALE);
        let phi = tensor::<Exact, 1>(softness.phi_at(1.0, SIZE), [softness.softness.parameters()]);
        let far = tensor::<Exact, 1>(vec![-1000.0 * SCALE, 1000.0 * SCALE], [2]);
        let tails = numbers(softness.softness.value(phi, far));
        tails[0].max(1.0 - tails[1]) >= 1e-9
    };
    let endless: Vec<Family> = Family::ALL.into_iter().filter(is_endless).collect();
    assert_eq!(endless, ENDLESS);
}

/// Checks a guarantee for every family whose tails end, and for a decaying width.
fn hold_where_tails_end(promise: impl Fn(&Tested) -> Levels) {
    let families = Family::ALL.into_iter().filter(|family| !ENDLESS.contains(family));
    let tested = families.map(Tested::family).chain([Tested::decay()]);
    tested.for_each(|tested| hold_one(&promise, &tested));
}

/// Checks a guarantee for the families of the paper only, where it takes whole descents.
fn hold_for_the_paper(promise: impl Fn(&Tested) -> Levels) {
    Tested::all(None).unwrap().iter().for_each(|tested| hold_one(&promise, tested));
}

fn hold_one(promise: impl Fn(&Tested) -> Levels, tested: &Tested) {
    let levels = promise(tested).unwrap();
    assert!(!levels.is_empty() && levels.iter().all(|level| !level.trials.is_empty()));
    for Level { label, trials, .. } in levels {
        let kept = trials.iter().all(|trial| trial.reached && trial.finite);
        assert!(kept, "{}, {label}: {trials:?}", tested.name);
    }
}

/// One level for each scene: the largest error of a pixel against the definition, at most 1e-5, with finite gradients in both float
/// types.
fn against_dense<L: Into<String>>(
    tested: &Tested,
    scenes: impl IntoIterator<Item = (L, PlanarScene)>,
) -> Levels {
    let softness = tested.at(SCALE);
    let weights = weights(SIZE);
    let mut renderers: Option<Renderers> = None;
    let mut levels = Vec::new();
    for (label, flat) in scenes {
        let drawing = RenderRequest::new(&softness, &flat, SIZE);
        // Choosing the knots costs more than an image.
        let kept = renderers.take().filter(|(faces, ..)| *faces == flat.faces);
        let made = || (flat.faces.clone(), drawing.renderer(), drawing.renderer());
        let (_, exact, single) = renderers.insert(kept.unwrap_or_else(made));
        let exact = exact.draw(&flat, &weights);
        let single = single.draw(&flat, &weights);
        let off = exact.off(&drawing.dense());
        let trial = Trial::at_most(off, 1e-5).with(&exact.all()).with(&single.all());
        levels.push(Level::named(label, vec![trial]));
    }
    Ok(levels)
}
