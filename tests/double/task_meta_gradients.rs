//! Meta-gradients of the tasks themselves, through three steps on small instances.

use std::fs;

use burn::backend::NdArray;
use clap::{Args, Parser};
use occlusion::{Occlusion, OcclusionLesson};
use pose::{Pose, PoseLesson};
use shape2d::{Shape2d, Shape2dLesson};
use shape3d::{Shape3d, Shape3dLesson};
use softrast_meta::{MetaGradient, Tasks};
use softrast_method::{Class, Lesson};
use softrast_runner::{Input, Judged, Order, Plan, Referee, Settings, Task, Variant};
use softrast_tests::{numbers, vector};

use crate::differences::relative_error;

type B = NdArray<f64>;
/// What `learn` computes on.
type Single = NdArray<f32>;

/// Relative to central differences.
const BOUND: f64 = 1e-5;
/// The same gradient in floats of 32 bits, relative to it: Adam's first steps turn on the sign of coordinates whose
/// gradient is nearly rounding.
const SINGLE_BOUND: f64 = 2e-2;
/// Half the distance of a difference, as a share of the parameter's size; see the tests of the 2-D problem.
const SHARES: [f64; 6] = [1e-6, 3e-6, 3e-7, 1e-5, 1e-7, 1e-4];
const SOFTNESSES: [&str; 3] = [
    "--softness logistic --schedule static",
    "--softness mlp --schedule static",
    "--softness logistic --schedule decay",
];
/// Its own loss has another derivative than the one that is gone down.
const SURROGATE: &str = "--softness logistic --schedule decay --surrogate-scale 0.2";

#[derive(Parser)]
struct Line<A: Args> {
    #[command(flatten)]
    settings: Settings,
    #[command(flatten)]
    args: A,
}

fn plan(referee: Referee) -> Plan {
    Plan {
        variant: Variant::Original,
        order: Order::Unrolled,
        outer: 1,
        batch: 1,
        outer_rate: 0.03,
        learn_rate: false,
        seed: 5,
        validation_seed: 6,
        validation_runs: 1,
        patience: None,
        referee,
        judged: Judged::End,
        knots: 3,
        input: Input::Ndc,
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
    let felt = (T::NAME != Occlusion::NAME).then_some((SURROGATE, &[Referee::Fixed][..]));
    let plain = SOFTNESSES.map(|softness| (softness, &[Referee::Fixed, Referee::Own][..]));
    for (softness, referees) in plain.into_iter().chain(felt) {
        for &referee in referees {
            let plan = plan(referee);
            let made = || lesson(prepared::<T>(&format!("{line} --steps 3 {softness}")), &plan);
            let phi = made().start();
            let class = Class::new(made(), &plan);
            let at = vector::<B>;
            let problem = class.problem(plan.seed, &at(&phi));
            let exact = MetaGradient::Unrolled { clip: None }.estimate(&problem, &at(&phi), 0);
            let exact = numbers(exact.gradient);
            let error = |share: f64| {
                let slope = |k: usize| {
                    let h = share * phi[k].abs().max(1e-2);
                    let [low, high] = [-h, h].map(|h| {
                        let mut moved = phi.clone();
                        moved[k] += h;
                        problem.loss(&at(&moved))
                    });
                    (high - low) / (2.0 * h)
                };
                let found: Vec<f64> = (0..phi.len()).map(slope).collect();
                let error = relative_error(&found, &exact);
                println!("{} {softness} {referee:?}, h = {share:e}: {error:.1e}", T::NAME);
                error
            };
            assert!(exact.iter().any(|&g| g != 0.0), "{softness} {referee:?}: no gradient");
            let in_single = Class::<_, Single>::new(made(), &plan);
            let problem = in_single.problem(plan.seed, &vector(&phi));
            let found = MetaGradient::Unrolled { clip: None }.estimate(&problem, &vector(&phi), 0);
            let off = relative_error(&numbers(found.gradient), &exact);
            println!("{} {softness} {referee:?}, in single precision: {off:.1e}", T::NAME);
            assert!(off <= SINGLE_BOUND, "{} {softness} {referee:?}: {off:e}", T::NAME);
            let agrees = SHARES.into_iter().any(|share| error(share) <= BOUND);
            assert!(agrees, "{} {softness} {referee:?}", T::NAME);
        }
    }
}

/// Five vertices without symmetry, all octants' signs among them.
const BODY: &str = "v 0.4 0.3 0.2\nv -0.5 0.2 0.3\nv 0.1 -0.5 0.3\nv 0.2 0.3 -0.5\nv -0.3 -0.2 -0.4\n\
                    f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 5 3\nf 2 4 5\nf 3 5 4\n";

#[test]
fn pose() {
    let folder = tempfile::tempdir().expect("a folder");
    let mesh = folder.path().join("body.obj");
    fs::write(&mesh, BODY).expect("a file");
    let line = format!("--size 16 --scale 0.05 --mesh {}", mesh.display());
    check::<Pose, _>(&line, PoseLesson::new);
}

#[test]
fn occlusion() {
    check::<Occlusion, _>("--size 12", OcclusionLesson::new);
}

#[test]
fn shape2d() {
    let lesson = |task, plan: &_| Shape2dLesson::new(task, plan).expect("a logo can be drawn");
    check::<Shape2d, _>("--size 12 --triangles 8 --scale 0.1", lesson);
}

#[test]
fn shape3d() {
    let folder = tempfile::tempdir().expect("a folder");
    let template = folder.path().join("body.obj");
    fs::write(&template, BODY).expect("a file");
    let line = format!("--size 12 --scale 0.05 --template {}", template.display());
    check::<Shape3d, _>(&line, Shape3dLesson::new);
}
