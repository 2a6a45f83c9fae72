//! Meta-gradients on losses in closed form, in f64.

use softrast_meta::{
    Adam, BilevelProblem, InnerLoop, MetaEstimate, MetaGradient, Objective, Optimizer, OuterSteps,
    Sgd,
};
use softrast_tensor::{Autodiff, Backend, NdArray, Tensor};
use softrast_tests::{WAVES, Waves, numbers, vector};

type B = NdArray<f64>;
type A = Autodiff<B>;

const PHI: [f64; 2] = [-0.3, 0.4];
const START: [f64; 3] = [1.5, -0.7, 0.4];
const EXACT: MetaGradient = MetaGradient::Unrolled { clip: None };

/// `Σ (θ - 0.1)²`, for any softness.
#[derive(Clone, Copy)]
struct Distance;

impl<B: Backend> Objective<B> for Distance {
    fn loss(&self, theta: Tensor<B, 1>, _phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let off = theta - 0.1;
        (off.clone() * off).sum()
    }
}

fn problem<R, O>(outer_loss: R, optimizer: O, steps: usize) -> BilevelProblem<B, Waves, R, O> {
    let inner = InnerLoop { optimizer, steps };
    let start = vector(&START);
    BilevelProblem { objective: WAVES, outer_loss, inner, start, outer_steps: OuterSteps::Last }
}

fn estimate<R: Objective<B> + Objective<A>>(
    problem: &BilevelProblem<B, Waves, R, impl Optimizer>,
    estimator: MetaGradient,
) -> MetaEstimate<B> {
    estimator.estimate(problem, &vector(&PHI), 5)
}

fn gradient<R: Objective<B> + Objective<A>>(
    problem: &BilevelProblem<B, Waves, R, impl Optimizer>,
    estimator: MetaGradient,
) -> Vec<f64> {
    numbers(estimate(problem, estimator).gradient)
}

/// The loss and its gradient through a single tape of the whole inner loop.
fn whole_tape<R: Objective<A>>(
    problem: &BilevelProblem<B, Waves, R, impl Optimizer + Copy>,
    at: &[usize],
) -> (f64, Vec<f64>) {
    let phi = vector::<A>(&PHI).require_grad();
    let losses = at.iter().map(|&steps| {
        let inner = InnerLoop { steps, ..problem.inner };
        let theta = inner.solve(&problem.objective, vector::<A>(&START), &phi);
        problem.outer_loss.loss(theta, phi.clone(), steps)
    });
    let loss = losses.reduce(|a, b| a + b).expect("a loss") * (at.len() as f64).recip();
    let grads = loss.backward();
    (loss.into_scalar(), numbers(phi.grad(&grads).expect("it depends on phi")))
}

fn assert_close(found: &[f64], expected: &[f64], bound: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let error = (found - expected).abs() / expected.abs();
        assert!(error <= bound, "{found} against {expected}: {error:.1e}");
    }
}

fn adam() -> Adam {
    Adam::new(0.05)
}

#[test]
fn going_back_step_by_step_is_the_tape_of_the_whole_loop() {
    let sgd = problem(Distance, Sgd { learning_rate: 0.1 }, 12);
    let (loss, whole) = whole_tape(&sgd, &[12]);
    let found = estimate(&sgd, EXACT);
    assert_close(&[found.loss], &[loss], 1e-15);
    assert_close(&numbers(found.gradient), &whole, 1e-12);

    for steps in [1, 2, 12, 30] {
        let adam = problem(Distance, adam(), steps);
        assert_close(&gradient(&adam, EXACT), &whole_tape(&adam, &[steps]).1, 1e-12);
    }
}

#[test]
fn an_outer_loss_that_depends_on_the_softness_adds_its_own_share() {
    let adam = problem(WAVES, adam(), 9);
    assert_close(&gradient(&adam, EXACT), &whole_tape(&adam, &[9]).1, 1e-12);
}

#[test]
fn losses_on_the_way_are_averaged() {
    let adam = BilevelProblem { outer_steps: OuterSteps::Quarters, ..problem(WAVES, adam(), 12) };
    let (loss, whole) = whole_tape(&adam, &[3, 6, 12]);
    let found = estimate(&adam, EXACT);
    assert_close(&[found.loss, adam.loss(&vector(&PHI))], &[loss, loss], 1e-14);
    assert_close(&numbers(found.gradient), &whole, 1e-12);
}

/// Derivative of the outer loss by central differences.
fn central_difference(problem: &BilevelProblem<B, Waves, Distance, impl Optimizer>) -> Vec<f64> {
    let h = 1e-5;
    let slope = |k: usize| {
        let [low, high] = [-h, h].map(|h| {
            let mut phi = PHI;
            phi[k] += h;
            problem.loss(&vector(&phi))
        });
        (high - low) / (2.0 * h)
    };
    (0..2).map(slope).collect()
}

#[test]
fn unrolled_gradients_agree_with_central_differences() {
    // Source: docs/notes.md, Meta-gradients: checks. These losses have no kinks.
    for steps in [1, 3, 10, 30] {
        let sgd = problem(Distance, Sgd { learning_rate: 0.1 }, steps);
        assert_close(&gradient(&sgd, EXACT), &central_difference(&sgd), 1e-7);
        let adam = problem(Distance, adam(), steps);
        assert_close(&gradient(&adam, EXACT), &central_difference(&adam), 1e-5);
    }
}

#[test]
fn all_steps_truncated_are_all_steps_unrolled() {
    let adam = problem(WAVES, adam(), 8);
    let truncated = |steps| gradient(&adam, MetaGradient::Truncated { steps, clip: None });
    assert_eq!(truncated(8), gradient(&adam, EXACT));
    assert_eq!(truncated(100), gradient(&adam, EXACT));
    assert_eq!(truncated(0), gradient(&adam, MetaGradient::Direct));
}

#[test]
fn direct_is_the_slope_of_the_loss_at_the_solution() {
    let adam = problem(WAVES, adam(), 8);
    let theta = numbers(adam.inner.solve(&WAVES, vector::<B>(&START), &vector(&PHI)));
    let valley: f64 = theta.iter().map(|x| PHI[0].exp() * (x - 0.2).cosh().ln()).sum();
    let tilt: f64 = (0..3).map(|k| theta[k].sin() * theta[(k + 1) % 3]).sum();
    // After eight steps the waves are 1.8 times as high.
    let expected = [1.8 * valley, 1.8 * tilt];
    assert_close(&gradient(&adam, MetaGradient::Direct), &expected, 1e-12);
    let judged =
        BilevelProblem { outer_loss: Distance, ..problem(Distance, adam.inner.optimizer, 8) };
    assert_eq!(gradient(&judged, MetaGradient::Direct), [0.0, 0.0]);
}

#[test]
fn modes_differ() {
    // A first-order gradient could be confused with the exact one (docs/notes.md, Meta-gradients: orders).
    let adam = problem(WAVES, adam(), 8);
    let modes = [
        EXACT,
        MetaGradient::Truncated { steps: 3, clip: None },
        MetaGradient::Direct,
        MetaGradient::EvolutionStrategy { sigma: 0.1, pairs: 4 },
    ];
    let found = modes.map(|mode| gradient(&adam, mode));
    for (k, one) in found.iter().enumerate() {
        for other in &found[..k] {
            let apart = one.iter().zip(other).any(|(a, b)| (a - b).abs() > 0.01 * a.abs());
            assert!(apart, "{one:?} {other:?}");
        }
    }
}

#[test]
fn parameters_without_gradient_leave_every_mode_finite_and_unchanged() {
    // Source: docs/notes.md, Meta-gradients: checks.
    let objective = Waves { dead: true };
    for epsilon_root in [1e-20, 1e-16, 1e-12] {
        let optimizer = Adam { epsilon_root, ..adam() };
        let with = |start: &[f64], objective| {
            let problem = BilevelProblem {
                objective,
                start: vector(start),
                ..problem(objective, optimizer, 20)
            };
            numbers(EXACT.estimate(&problem, &vector(&PHI), 0).gradient)
        };
        assert_eq!(with(&START, objective), with(&START[..2], WAVES));
    }
}

#[test]
fn clipping_only_rescales_the_adjoint() {
    let adam = problem(Distance, adam(), 20);
    let free = estimate(&adam, EXACT);
    let loose = estimate(&adam, MetaGradient::Unrolled { clip: Some(1e9) });
    assert_eq!((loose.clips, numbers(loose.gradient)), (0, numbers(free.gradient.clone())));
    assert_eq!(loose.adjoint_norms, free.adjoint_norms);

    // A limit that every step reaches: all norms are at most that of the last step.
    let clip = 0.01;
    let tight = estimate(&adam, MetaGradient::Unrolled { clip: Some(clip) });
    assert!(tight.clips > 0 && tight.is_finite());
    // The effect of steps on an adjoint does not depend on its length.
    assert!((tight.adjoint_growth - free.adjoint_growth).abs() < 1e-9);
    assert_eq!(free.adjoint_norms.len(), 21);
    let growth = (free.adjoint_norms[20] / free.adjoint_norms[0]).log10();
    assert!((growth - free.adjoint_growth).abs() < 1e-9);

    // Clipped only at the first backward step, the rest of the gradient shrinks by one factor.
    let two = problem(Distance, adam.inner.optimizer, 2);
    let [last, exact] =
        [1, 2].map(|steps| gradient(&two, MetaGradient::Truncated { steps, clip: None }));
    let clipped = estimate(&two, MetaGradient::Unrolled { clip: Some(clip) });
    let norms = estimate(&two, EXACT).adjoint_norms;
    let factor = clip * norms[0] / norms[1];
    let expected: Vec<f64> = last.iter().zip(&exact).map(|(l, e)| l + factor * (e - l)).collect();
    assert_close(&numbers(clipped.gradient), &expected, 1e-12);
}

#[test]
fn memory_is_the_states_of_the_steps_walked_back() {
    // Three parameters, and Adam's two moments of each (docs/notes.md, Meta-gradients: checks).
    for (steps, stored) in [(10, 90), (100, 900)] {
        assert_eq!(estimate(&problem(Distance, adam(), steps), EXACT).stored, stored);
    }
    let truncated = MetaGradient::Truncated { steps: 5, clip: None };
    assert_eq!(estimate(&problem(Distance, adam(), 100), truncated).stored, 45);
    let sgd = problem(Distance, Sgd { learning_rate: 0.1 }, 100);
    assert_eq!(estimate(&sgd, EXACT).stored, 300);
}

#[test]
fn evolution_agrees_with_the_exact_gradient_within_its_standard_error() {
    // Adam moves by the sign of small gradients, so its loss is rough on the scale of sigma.
    let smooth = problem(Distance, Sgd { learning_rate: 0.1 }, 10);
    let exact = gradient(&smooth, EXACT);
    let mode = MetaGradient::EvolutionStrategy { sigma: 0.01, pairs: 1 };
    let draws: Vec<Vec<f64>> = (0..400)
        .map(|seed| numbers(mode.estimate(&smooth, &vector(&PHI), seed).gradient))
        .collect();
    for (k, exact) in exact.iter().enumerate() {
        let count = draws.len() as f64;
        let mean = draws.iter().map(|draw| draw[k]).sum::<f64>() / count;
        let variance = draws.iter().map(|draw| (draw[k] - mean).powi(2)).sum::<f64>() / count;
        let error = (variance / count).sqrt();
        assert!((mean - exact).abs() < 3.0 * error, "{mean} ± {error} against {exact}");
    }
}

#[test]
fn evolution_repeats_itself_under_a_seed() {
    let adam = problem(Distance, adam(), 3);
    let draw = |seed| {
        let mode = MetaGradient::EvolutionStrategy { sigma: 0.1, pairs: 3 };
        numbers(mode.estimate(&adam, &vector(&PHI), seed).gradient)
    };
    assert_eq!(draw(1), draw(1));
    assert_ne!(draw(1), draw(2));
}

#[test]
fn no_inner_steps_leave_the_outer_loss_at_the_start() {
    let still = problem(WAVES, adam(), 0);
    let found = estimate(&still, EXACT);
    assert_eq!(numbers(found.gradient), gradient(&still, MetaGradient::Direct));
    assert!(found.adjoint_norms.is_empty());
}
