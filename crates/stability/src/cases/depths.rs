//! Colours of faces that hide one another.

use burn::{
    backend::Autodiff,
    tensor::{Tensor, backend::Backend},
};
use occlusion::{Instance, Occlusion, Problem, Quad, Scene};
use softrast_meta::{Adam, Optimizer};
use softrast_method::{numbers, tensor};
use softrast_raster::{Background, blend};
use softrast_softness::{DepthSoftness, Family};

use super::{SCALE, SIZE};
use crate::{
    Case, Level, Promise, Tested, Trial,
    drawn::{Exact, Single, largest},
};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "F07",
        name: "depth ties",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a red and a green face on one pixel, blended by depth (Eq. 4)",
        perturbation: "difference of their depths: 0, 1e-8 to 1e-1",
        measure: "difference of the colour when both change places, and its jump from the tie, over 1e-6 \
                  plus slope times difference",
        target: "at most 1, gradient finite",
        run: ties,
    },
    Case {
        id: "F12",
        name: "far from all faces",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "a pixel that no face covers by more than its weight",
        perturbation: "logarithm of the weight of the face: -1e1 to -1e6",
        measure: "difference of its colour from the background",
        target: "at most the weight over that of the background",
        run: far,
    },
    Case {
        id: "O13",
        name: "OCCLUSION by steps",
        quick: true,
        promise: Promise::Measured,
        scene: "OCCLUSION, 3 quads, 24 x 24, 10 seeds",
        perturbation: "10, 30 and 100 steps",
        measure: "share of pairs of quads in the wrong order",
        target: "0",
        run: steps,
    },
    Case {
        id: "O14",
        name: "OCCLUSION by depth softness",
        quick: false,
        promise: Promise::Measured,
        scene: "OCCLUSION, 3 quads, 24 x 24, 60 steps, 10 seeds",
        perturbation: "scale of the depth from 1e-3 to 10 (of no effect on the network)",
        measure: "share of pairs of quads in the wrong order",
        target: "0",
        run: depth_scales,
    },
    Case {
        id: "O23",
        name: "OCCLUSION, eight quads",
        quick: false,
        promise: Promise::Measured,
        scene: "OCCLUSION, transfer: 8 quads, 10 steps, 24 x 24, 10 seeds",
        perturbation: "learning rate from 0.07 to 7",
        measure: "1 if the front quad is wrong",
        target: "0",
        run: eight,
    },
    Case {
        id: "O24",
        name: "quads of one colour, all at one depth",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "OCCLUSION with an answer that no image shows: equal quads, equal depths",
        perturbation: "equal colours, equal places, equal depths at the start",
        measure: "farthest depth after 50 steps, over the room that depths have",
        target: "at most 1, all finite",
        run: unidentifiable,
    },
];

/// The depth softness that goes with a method.
fn depth(tested: &Tested) -> (DepthSoftness, Vec<f64>) {
    let softness = match tested.family() {
        Family::Mlp => DepthSoftness::Mlp,
        family => DepthSoftness::Family(family),
    };
    (softness, softness.default_phi(0.1))
}

/// Red and green of one pixel under two faces at these nearnesses, and the gradients of red to both.
fn blended(tested: &Tested, near: [f64; 2]) -> Vec<f64> {
    type A = Autodiff<Exact>;
    let (softness, phi) = depth(tested);
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

fn ties(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let tie = blended(tested, [0.5, 0.5]);
    let level = |by: f64| {
        let [one, other] = [[0.5, 0.5 + by], [0.5 + by, 0.5]].map(|near| blended(tested, near));
        let slope = largest(one[2..].iter().chain(&tie[2..]).copied());
        let allowed = 1e-6 + slope * by;
        let swapped = largest([one[0] - other[1], one[1] - other[0]]) / 1e-6;
        let jump = largest([one[0] - tie[0], one[1] - tie[1]]) / allowed;
        Level::new(by, vec![Trial::at_most(swapped.max(jump), 1.01).with(&one).with(&other)])
    };
    Ok([0.0, 1e-8, 1e-6, 1e-4, 1e-2, 1e-1].map(level).into())
}

fn far(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    type A = Autodiff<Single>;
    let level = |weight: f64| {
        let (softness, phi) = depth(tested);
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
    Ok([-1e1, -1e2, -1e3, -1e6].map(level).into())
}

fn order(tested: &Tested, flags: &str) -> anyhow::Result<Vec<Trial>> {
    super::poses::trials::<Occlusion>(tested, flags, 10, |run| {
        super::poses::end(run).map_or(f64::NAN, |end| end.parameter_error)
    })
}

fn steps(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |steps: u32| {
        let flags = format!("--size 24 --steps {steps}");
        Ok(Level::new(f64::from(steps), order(tested, &flags)?))
    };
    [10, 30, 100].map(level).into_iter().collect()
}

fn depth_scales(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |scale: f64| {
        let flag = match tested.family() {
            Family::Mlp => String::new(),
            _ => format!("--depth-scale {scale}"),
        };
        Ok(Level::new(scale, order(tested, &format!("--size 24 --steps 60 {flag}"))?))
    };
    [1e-3, 1e-2, 0.1, 1.0, 10.0].map(level).into_iter().collect()
}

fn eight(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |rate: f64| {
        let flags = format!("--variant transfer --size 24 --learning-rate {rate}");
        let trials = super::poses::trials::<Occlusion>(tested, &flags, 10, |run| {
            super::poses::end(run).map_or(f64::NAN, |end| end.extra[1])
        });
        Ok(Level::new(rate, trials?))
    };
    [0.07, 0.2, 0.7, 2.0, 7.0].map(level).into_iter().collect()
}

fn unidentifiable(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let problem = Problem::ORIGINAL;
    let given = Instance::seeded(3, &problem);
    let first = given.quads[0];
    let coloured = |quad: Quad| Quad {
        texture: occlusion::Texture { colour: [0.7; 3], ..quad.texture },
        ..quad
    };
    let one_colour = Instance {
        quads: given.quads.iter().map(|&quad| coloured(quad)).collect(),
        ..given.clone()
    };
    let one_place = Instance { quads: vec![first; 3], ..given.clone() };
    let one_depth = Instance { start: vec![1.0; 3], ..given.clone() };
    let cases = [("colours", one_colour), ("places", one_place), ("depths", one_depth)];
    let level = |(name, instance): (&str, Instance)| {
        let depths = descended::<Single>(tested, &problem, &instance)?;
        let [least, most] = problem.room();
        let (middle, reach) = (0.5 * (least + most), 0.5 * (most - least));
        let far = largest(depths.iter().map(|depth| (depth - middle) / reach));
        Ok(Level::named(name, vec![Trial::at_most(far, 1.0 + 1e-5).with(&depths)]))
    };
    cases.map(level).into_iter().collect()
}

/// Depths after 50 steps of a large learning rate.
fn descended<B: Backend>(
    tested: &Tested,
    problem: &Problem,
    instance: &Instance,
) -> anyhow::Result<Vec<f64>> {
    let method = tested.method_at(SCALE)?;
    let scene = Scene::<Autodiff<B>>::new(problem, std::slice::from_ref(instance), SIZE);
    let phi = method.phi(method.scale(1, 1));
    let edges = scene.edges(method.softness(), tensor(phi.clone(), [phi.len()])).detach();
    let (softness, phi) = depth(tested);
    let phi = tensor::<Autodiff<B>, 1>(phi.clone(), [phi.len()]);
    let adam = Adam::new(0.3);
    let mut theta = scene.start().inner();
    let mut state = adam.init(&theta);
    for _ in 0..50 {
        let leaf = Tensor::from_inner(theta.clone()).require_grad();
        let image = scene.image(leaf.clone(), edges.clone(), softness, phi.clone());
        let grads = scene.loss(image).sum().backward();
        let grad = leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like());
        let (moved, next) = adam.step(theta, grad, state);
        (theta, state) = (scene.allowed(Tensor::from_inner(moved)).inner(), next);
    }
    Ok(numbers(theta))
}
