//! Meta-gradients of the tasks themselves, through three steps on small instances.

use burn::{backend::NdArray, tensor::Tensor};
use clap::{Args, Parser};
use occlusion::{Occlusion, OcclusionLesson};
use pose::{Pose, PoseLesson};
use shape2d::{Shape2d, Shape2dLesson};
use shape3d::{Shape3d, Shape3dLesson};
use softrast_meta::{MetaGradient, Tasks};
use softrast_method::{Class, Lesson, numbers, tensor};
use softrast_runner::{Judged, Order, Plan, Referee, Settings, Task};

type B = NdArray<f64>;

/// Relative to central differences.
const BOUND: f64 = 1e-5;
/// Half the distance of a difference, as a share of the parameter's size; see `SHARES`.
const SHARES: [f64; 4] = [1e-6, 1e-5, 1e-7, 1e-4];
const SOFTNESSES: [&str; 3] = [
    "--softness logistic --schedule static",
    "--softness mlp --schedule static",
    "--softness logistic --schedule decay",
];

#[derive(Parser)]
struct Line<A: Args> {
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    args: A,
}

fn plan(referee: Referee) -> Plan {
    Plan {
        order: Order::Unrolled,
        outer: 1,
        batch: 1,
        outer_rate: 0.03,
        seed: 5,
        validation_seed: 6,
        validation_runs: 1,
        patience: None,
        referee,
        judged: Judged::End,
        knots: 3,
        floor_px: 0.03,
    }
}

fn prepared<T: Task>(line: &str) -> T {
    let words = ["task"].into_iter().chain(line.split_whitespace());
    let Line { settings, args } = Line::<T::Args>::parse_from(words);
    T::prepare(&settings, &args).expect("the task is sound")
}

/// Compares the meta-gradient of one instance with central differences, under both referees.
fn check<T: Task, L: Lesson>(line: &str, lesson: impl Fn(T, &Plan) -> L) {
    for softness in SOFTNESSES {
        for referee in [Referee::Fixed, Referee::Own] {
            let plan = plan(referee);
            let lesson = lesson(prepared::<T>(&format!("{line} --steps 3 {softness}")), &plan);
            let phi = lesson.start();
            let class = Class::new(lesson, &plan);
            let at = |phi: &[f64]| tensor::<B, 1>(phi.to_vec(), [phi.len()]);
            let problem = class.problem(plan.seed, &at(&phi));
            let exact = MetaGradient::Unrolled { clip: None }.estimate(&problem, &at(&phi), 0);
            let exact = numbers::<B, 1>(exact.gradient);
            let loss = |phi: Tensor<B, 1>| problem.loss(&phi);
            let errors = SHARES.map(|share| {
                let slope = |k: usize| {
                    let h = share * phi[k].abs().max(1e-2);
                    let [low, high] = [-h, h].map(|h| {
                        let mut moved = phi.clone();
                        moved[k] += h;
                        loss(at(&moved))
                    });
                    (high - low) / (2.0 * h)
                };
                let found: Vec<f64> = (0..phi.len()).map(slope).collect();
                super::relative_error(&found, &exact)
            });
            let least = errors.into_iter().fold(f64::INFINITY, f64::min);
            println!("{} {softness} {referee:?}: {least:.1e}", T::NAME);
            assert!(exact.iter().any(|&g| g != 0.0), "{softness} {referee:?}: no gradient");
            assert!(least <= BOUND, "{} {softness} {referee:?}: {errors:?}", T::NAME);
        }
    }
}

#[test]
fn pose() {
    check::<Pose, _>("--size 16", PoseLesson::new);
}

#[test]
fn occlusion() {
    check::<Occlusion, _>("--size 16", OcclusionLesson::new);
}

#[test]
fn shape2d() {
    let lesson = |task, plan: &_| Shape2dLesson::new(task, plan).expect("a logo can be drawn");
    check::<Shape2d, _>("--size 16 --triangles 12 --scale 0.05", lesson);
}

#[test]
fn shape3d() {
    check::<Shape3d, _>("--size 12 --scale 0.05", Shape3dLesson::new);
}
