//! Meta-gradients: without any gradient, against differences, clipped, with broken instances.

use softrast_inverse::ScheduledSoftness;
use softrast_meta::{Adam, MetaGradient, OuterLoop, Progress, TaskDistribution, Validation};
use softrast_tensor::{Tensor, numbers, tensor};
use stability::{
    Level, Tested, Trial,
    cases::learning::{Inner, SIDE, SOFT, Triangles, disk, phi, problem, three},
    drawing::{Exact, largest},
    planar_scene::PlanarScene,
};

use crate::{Levels, hold_for_the_paper};

/// M01.
#[test]
fn thirty_steps_without_a_gradient_have_a_finite_meta_gradient() {
    hold_for_the_paper(no_gradient);
}

/// M02.
#[test]
fn meta_gradients_are_the_limits_of_differences() {
    hold_for_the_paper(differences);
}

/// M04.
#[test]
fn clipped_meta_gradients_stay_small() {
    hold_for_the_paper(clipped);
}

/// M05.
#[test]
fn broken_instances_leave_the_parameters_finite() {
    hold_for_the_paper(broken);
}

fn no_gradient(tested: &Tested) -> Levels {
    let softness = tested.at(SOFT);
    let mut corners = three().corners[..6].to_vec();
    corners[3..].iter_mut().for_each(|p| p[0] += 500.0);
    let flat = PlanarScene::loose(corners);
    let level = |epsilon_root: f64| {
        let adam = Adam { epsilon_root, ..Adam::new(0.01) };
        let problem = problem(&softness, &flat, disk(), 30, adam);
        let found = MetaGradient::default().estimate(&problem, &phi(&softness), 0);
        let gradient = numbers(found.gradient);
        let bad = gradient.iter().filter(|g| !g.is_finite()).count();
        Level::new(epsilon_root, vec![Trial::at_most(bad as f64, 0.0).with(&gradient)])
    };
    Ok([1e-20, 1e-16, 1e-12].map(level).into())
}

fn differences(tested: &Tested) -> Levels {
    const STEP: f64 = 1e-5;
    let softness = tested.at(SOFT);
    let adam = Adam { epsilon_root: 1e-8, ..Adam::new(0.01) };
    let level = |steps: usize| {
        let problem = problem(&softness, &three(), disk(), steps, adam);
        let at = phi(&softness);
        // All weights of a network, which change its shape, but only the scale of the others: a shift of 0 puts the kink of a one-sided
        // family on the edge, without a derivative there.
        let network = tested.is_network();
        let share = |(k, p): (usize, f64)| if network || k == 0 { 0.3 + p.abs() } else { 0.0 };
        let way: Vec<f64> = numbers(at.clone()).into_iter().enumerate().map(share).collect();
        let way = tensor::<Exact, 1>(way.clone(), [way.len()]);
        let found = MetaGradient::Unrolled { clip: None }.estimate(&problem, &at, 0);
        let slope = numbers((found.gradient.clone() * way.clone()).sum())[0];
        let loss = |by: f64| problem.loss(&(at.clone() + way.clone() * by));
        let difference = (loss(STEP) - loss(-STEP)) / (2.0 * STEP);
        let off = (slope - difference).abs() / difference.abs().max(1e-6);
        let trial = Trial::at_most(off, 1e-3).with(&numbers(found.gradient));
        Level::new(steps as f64, vec![trial])
    };
    Ok([2, 4].map(level).into())
}

fn clipped(tested: &Tested) -> Levels {
    let softness = tested.at(SOFT);
    let level = |steps: usize| {
        let problem = problem(&softness, &three(), disk(), steps, Adam::new(0.01));
        let found = MetaGradient::default().estimate(&problem, &phi(&softness), 0);
        let gradient = numbers(found.gradient);
        let norm = gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        Level::new(steps as f64, vec![Trial::at_most(norm, 1e3).with(&gradient)])
    };
    Ok([10, 50, 100].map(level).into())
}

/// Instances of which the first `broken` of every four have a NaN target.
struct SomeBroken<'a> {
    softness: &'a ScheduledSoftness,
    broken: u64,
}

impl TaskDistribution<Exact> for SomeBroken<'_> {
    type Objective = Triangles;
    type OuterLoss = Triangles;
    type Optimizer = Adam;

    fn problem(&self, seed: u64, _: &Tensor<Exact, 1>) -> Inner {
        let target = if seed % 4 < self.broken { vec![f64::NAN; SIDE * SIDE] } else { disk() };
        problem(self.softness, &three(), target, 3, Adam::new(0.01))
    }
}

fn broken(tested: &Tested) -> Levels {
    let softness = tested.at(SOFT);
    let level = |broken: u64| {
        let outer_loop = OuterLoop {
            estimator: MetaGradient::default(),
            optimizer: Adam::new(0.01),
            clip: 1.0,
            steps: 2,
            batch: 4,
            seed: 0,
            validation: Validation { seed: 1003, count: 1, every: 1, patience: None },
        };
        let tasks = SomeBroken { softness: &softness, broken };
        let mut progress = Progress::new(numbers(phi(&softness)));
        let mut failed = false;
        for _ in 0..3 {
            failed |= outer_loop.step::<Exact>(&tasks, &mut progress).is_err();
        }
        let bad = progress.phi.iter().filter(|x| !x.is_finite()).count();
        let bad = if broken == 4 && !failed { 1 } else { bad };
        let trial = Trial::at_most(bad as f64, 0.0).with(&[largest(progress.phi.iter().copied())]);
        Level::named(format!("{broken} of 4"), vec![trial])
    };
    Ok([1, 3, 4].map(level).into())
}
