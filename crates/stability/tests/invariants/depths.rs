//! Colours of faces that hide one another, by depth (Wu et al. 2024, Eq. 4).

use occlusion::{Args, Instance, Occlusion, Problem, Quad, Texture};
use softrast_cli::{EdgeChoice, Task, Variant};
use softrast_inverse::SolveConfig;
use softrast_raster::{Background, blend};
use softrast_softness::{DepthSoftness, Family};
use softrast_tensor::{Autodiff, numbers, tensor};
use stability::{
    Level, Trial,
    cases::SCALE,
    descend,
    drawing::{Exact, Single, largest},
};

use crate::{SIZE, hold_for_the_paper};

/// F07.
#[test]
fn faces_at_almost_one_depth_change_places_smoothly() {
    hold_every_depth(ties);
}

/// F12: only the background is visible far from all faces.
#[test]
fn far_from_all_faces_is_the_background() {
    hold_every_depth(far);
}

fn hold_every_depth(promise: impl Fn(DepthSoftness) -> Vec<Level>) {
    let families = Family::ALL.into_iter().filter(|family| *family != Family::Mlp);
    let every = families.map(DepthSoftness::Family).chain([DepthSoftness::Mlp]);
    for softness in every {
        for Level { label, trials, .. } in promise(softness) {
            let kept = trials.iter().all(|trial| trial.reached && trial.finite);
            assert!(kept, "{softness:?}, {label}: {trials:?}");
        }
    }
}

/// O24: equal colours, positions and depths at the start.
#[test]
fn an_order_that_no_image_shows_keeps_depths_within_their_room() {
    let problem = Problem::ORIGINAL;
    let given = Instance::seeded(3, &problem);
    let first = given.quads[0];
    let coloured =
        |quad: Quad| Quad { texture: Texture { colour: [0.7; 3], ..quad.texture }, ..quad };
    let one_colour = Instance {
        quads: given.quads.iter().map(|&quad| coloured(quad)).collect(),
        ..given.clone()
    };
    let one_place = Instance { quads: vec![first; 3], ..given.clone() };
    let one_depth = Instance { start: vec![1.0; 3], ..given.clone() };
    let task = Occlusion::new(&Args::default(), Variant::Original, &EdgeChoice::default()).unwrap();
    let config = SolveConfig { size: SIZE, steps: 50, learning_rate: 0.3 };
    hold_for_the_paper(|tested| {
        let level = |instance: &Instance| {
            let found = descend(&task, std::slice::from_ref(instance), tested.at(SCALE), config)?;
            let [least, most] = problem.room();
            let (middle, reach) = (0.5 * (least + most), 0.5 * (most - least));
            let far = largest(found.last().iter().map(|depth| (depth - middle) / reach));
            Ok(Level::named("", vec![Trial::at_most(far, 1.0 + 1e-5).with(&found.numbers)]))
        };
        [&one_colour, &one_place, &one_depth].map(level).into_iter().collect()
    });
}

/// A depth softness with its parameters.
fn depth(softness: DepthSoftness) -> (DepthSoftness, Vec<f64>) {
    (softness, softness.default_phi(0.1))
}

/// Red and green of one pixel under two faces at these nearnesses, and the gradients of red to both.
fn blended(softness: DepthSoftness, near: [f64; 2]) -> Vec<f64> {
    type A = Autodiff<Exact>;
    let (softness, phi) = depth(softness);
    let phi = tensor::<A, 1>(phi.clone(), [phi.len()]);
    let leaf = tensor::<A, 3>(near.into(), [1, 2, 1]).require_grad();
    let colour = tensor::<A, 4>(vec![1.0, 0.0, 0.0, 1.0], [1, 2, 2, 1]);
    let background = Background {
        colour: tensor(vec![0.0; 2], [2]),
        log_weight: softness.log_weight(phi.clone(), tensor::<A, 1>(vec![0.0], [1])) - 7.0,
    };
    let seen = blend(softness.log_weight(phi, leaf.clone()), colour, &background);
    let grads = seen.clone().narrow(1, 0, 1).sum().backward();
    let gradient = leaf.grad(&grads).map(numbers).unwrap_or_default();
    numbers(seen.inner()).into_iter().chain(gradient).collect()
}

fn ties(softness: DepthSoftness) -> Vec<Level> {
    let tie = blended(softness, [0.5, 0.5]);
    let level = |by: f64| {
        let [one, other] = [[0.5, 0.5 + by], [0.5 + by, 0.5]].map(|near| blended(softness, near));
        let slope = largest(one[2..].iter().chain(&tie[2..]).copied());
        let allowed = 1e-6 + slope * by;
        let swapped = largest([one[0] - other[1], one[1] - other[0]]) / 1e-6;
        let jump = largest([one[0] - tie[0], one[1] - tie[1]]) / allowed;
        Level::new(by, vec![Trial::at_most(swapped.max(jump), 1.01).with(&one).with(&other)])
    };
    [0.0, 1e-8, 1e-6, 1e-4, 1e-2, 1e-1].map(level).into()
}

fn far(softness: DepthSoftness) -> Vec<Level> {
    type A = Autodiff<Single>;
    let level = |weight: f64| {
        let (softness, phi) = depth(softness);
        let phi = tensor::<A, 1>(phi.clone(), [phi.len()]);
        let near = tensor::<A, 3>(vec![0.5], [1, 1, 1]).require_grad();
        let log_weight = softness.log_weight(phi, near.clone()) + weight;
        let background =
            Background { colour: tensor(vec![0.2], [1]), log_weight: tensor(vec![-7.0], [1]) };
        let seen = blend(log_weight, tensor::<A, 4>(vec![1.0], [1, 1, 1, 1]), &background);
        let grads = seen.clone().sum().backward();
        let gradient = near.grad(&grads).map(numbers).unwrap_or_default();
        let off = (numbers(seen.inner())[0] - 0.2).abs();
        let limit = (weight + 7.0).exp() + 1e-6;
        Level::new(weight, vec![Trial::at_most(off, limit).with(&gradient)])
    };
    [-1e1, -1e2, -1e3, -1e6].map(level).into()
}
