//! How well each order of `learn` estimates the slope of the outer loss, and what it costs.
//!
//! ```text
//! cargo bench -p softrast-tests --bench estimators                  # 16 scenes; 10, 30 and 100 steps
//! cargo bench -p softrast-tests --bench estimators -- 4 10,30       # fewer
//! ```
//!
//! Small instances of 2D SHAPE and POSE under a static logistic, so that φ is one number, the logarithm
//! of its scale. The truth is the slope of the outer loss, averaged over the scenes, by central differences
//! of a tenth of a decade on either side; all estimators see the same scenes. Writes
//! `docs/estimators.md`.

mod learning;
#[path = "../../crates/raster/benches/machine.rs"]
mod machine;

use std::{fmt::Write, time::Instant};

use burn::backend::NdArray;
use learning::{plan, task};
use pose::{Pose, PoseLesson};
use shape2d::{Shape2d, Shape2dLesson};
use softrast_meta::{MetaGradient, Tasks};
use softrast_method::{Class, Lesson, meta_gradient};
use softrast_runner::{Order, Plan, Referee, Task};
use softrast_tests::{numbers, vector};

type B = NdArray<f32>;

/// Half the distance of the differences, in the natural logarithm: a tenth of a decade.
const HALF: f64 = 0.1 * std::f64::consts::LN_10;
/// First of the seeds, which are those that `learn` trains on.
const SEED: u64 = 1_000_000;
const SHAPE2D: &str = "--size 32 --triangles 24 --learning-rate 0.03";
const POSE: &str = "--size 32 --learning-rate 0.1";
/// Scales in NDC, where a pixel is 0.0625. POSE takes no wider ones: every one of its 2,856 faces would reach every
/// pixel.
const SHAPE2D_SCALES: [f64; 5] = [0.005, 0.015, 0.04, 0.1, 0.25];
const POSE_SCALES: [f64; 4] = [0.002, 0.005, 0.015, 0.04];

/// Name, order, whether the adjoint is left to grow, and the referee that sees the softness where need be.
const ORDERS: [(&str, Order, bool, Referee); 5] = [
    ("unrolled, no clip", Order::Unrolled, true, Referee::Fixed),
    ("unrolled, adjoint clip", Order::Unrolled, false, Referee::Fixed),
    ("truncated:10", Order::Truncated(10), false, Referee::Fixed),
    ("direct (referee own)", Order::Direct, false, Referee::Own),
    ("es", Order::Es(0.05), false, Referee::Fixed),
];

/// What was found at one number of steps and one scale.
struct Setting {
    steps: usize,
    /// Over the scenes.
    slope: Mean,
    /// For each order its gradient over the scenes, and its time in inner loops.
    orders: Vec<(Mean, f64)>,
}

/// A mean and its standard error.
struct Mean {
    mean: f64,
    error: f64,
}

fn main() -> anyhow::Result<()> {
    // Cargo adds a flag of its own.
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let scenes: u64 = words.first().map_or(Ok(16), |word| word.parse())?;
    let steps = words.get(1).map_or("10,30,100", String::as_str);
    let steps = steps.split(',').map(str::parse).collect::<Result<Vec<usize>, _>>()?;

    let clock = Instant::now();
    let mut page = String::new();
    let shape2d =
        measured::<Shape2d, _>((SHAPE2D, &SHAPE2D_SCALES), &steps, scenes, Shape2dLesson::new)?;
    add_table::<Shape2d>(&mut page, (SHAPE2D, &SHAPE2D_SCALES), &steps, &shape2d)?;
    let pose = |task, plan: &Plan| Ok(PoseLesson::new(task, plan));
    let pose = measured::<Pose, _>((POSE, &POSE_SCALES), &steps, scenes, pose)?;
    add_table::<Pose>(&mut page, (POSE, &POSE_SCALES), &steps, &pose)?;
    let head = format!(
        "{scenes} scenes, f32, {} s on {}.\n\n",
        clock.elapsed().as_secs(),
        machine::machine()
    );
    learning::write("estimators.md", "estimators", &(head + &page))
}

/// All settings of a task, in the order of steps, then scales.
fn measured<T: Task, L: Lesson>(
    (flags, scales): (&str, &[f64]),
    steps: &[usize],
    scenes: u64,
    lesson: impl Fn(T, &Plan) -> anyhow::Result<L>,
) -> anyhow::Result<Vec<Setting>> {
    let mut settings = Vec::new();
    for &steps in steps {
        for &scale in scales {
            let softness = format!("--softness logistic --schedule static --scale {scale}");
            let class = |referee| -> anyhow::Result<Class<L, B>> {
                let plan = plan(Order::Unrolled, referee);
                let task = task::<T>(&format!("{flags} {softness} --steps {steps}"))?;
                Ok(Class::new(lesson(task, &plan)?, &plan))
            };
            let classes = [class(Referee::Fixed)?, class(Referee::Own)?];
            let setting = setting(&classes, scale.ln(), steps, scenes);
            let Mean { mean, error } = setting.slope;
            println!("{} {steps} steps, scale {scale}: {mean:.4} ± {error:.4}", T::NAME);
            for ((name, ..), (Mean { mean, error }, cost)) in ORDERS.iter().zip(&setting.orders) {
                println!("  {name}: {mean:.4} ± {error:.4}, {cost:.1} loops");
            }
            settings.push(setting);
        }
    }
    Ok(settings)
}

fn setting<L: Lesson>(
    [fixed, own]: &[Class<L, B>; 2],
    phi: f64,
    steps: usize,
    scenes: u64,
) -> Setting {
    let (mut loops, mut seconds) = (0, 0.0);
    let mut loss = |seed: u64, phi: f64| {
        let phi = vector::<B>(&[phi]);
        let problem = fixed.problem(seed, &phi);
        let clock = Instant::now();
        let loss = problem.loss(&phi);
        seconds += clock.elapsed().as_secs_f64();
        loops += 1;
        loss
    };
    let seeds = SEED..SEED + scenes;
    // One side after the other, so that supports and knots are chosen once for each.
    let [low, high] = [-HALF, HALF]
        .map(|h| -> Vec<f64> { seeds.clone().map(|seed| loss(seed, phi + h)).collect() });
    let slopes = low.iter().zip(&high).map(|(low, high)| (high - low) / (2.0 * HALF)).collect();
    let one_loop = seconds / f64::from(loops);
    let orders = ORDERS.iter().map(|&(_, order, free, referee)| {
        let class = if referee == Referee::Own { own } else { fixed };
        let mode = match free {
            true => MetaGradient::Unrolled { clip: None },
            false => meta_gradient(&plan(order, referee)),
        };
        let (phi, mut seconds) = (vector::<B>(&[phi]), 0.0);
        let gradients = seeds.clone().map(|seed| {
            let problem = class.problem(seed, &phi);
            let clock = Instant::now();
            let estimate = mode.estimate(&problem, &phi, seed);
            seconds += clock.elapsed().as_secs_f64();
            numbers(estimate.gradient)[0]
        });
        let gradients = gradients.collect();
        (Mean::of(gradients), seconds / scenes as f64 / one_loop)
    });
    Setting { steps, slope: Mean::of(slopes), orders: orders.collect() }
}

impl Mean {
    /// Of the finite ones, as a learner leaves out the others.
    fn of(values: Vec<f64>) -> Self {
        let values: Vec<f64> = values.into_iter().filter(|x| x.is_finite()).collect();
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        Self { mean, error: (squares / (n - 1.0) / n).sqrt() }
    }

    /// |mean| over its standard error; 0 where nothing was finite or nothing depends on φ.
    fn over_error(&self) -> f64 {
        let ratio = self.mean.abs() / self.error;
        if ratio.is_finite() { ratio } else { 0.0 }
    }
}

/// For each order and number of steps: at how many scales the sign of the mean is right, how far the
/// mean is above its error, and the cost.
fn add_table<T: Task>(
    page: &mut String,
    (flags, scales): (&str, &[f64]),
    steps: &[usize],
    settings: &[Setting],
) -> std::fmt::Result {
    let head =
        |what: &str| steps.iter().map(|n| format!(" {what}, {n} steps |")).collect::<String>();
    writeln!(page, "`{} {flags}`, scales {scales:?}:\n", T::NAME)?;
    write!(page, "| order |{}{}{}\n|---|", head("sign"), head("mean / error"), head("loops"))?;
    writeln!(page, "{}", "---|".repeat(3 * steps.len()))?;
    let at = |steps: usize| settings.iter().filter(move |setting| setting.steps == steps);
    for (k, (name, ..)) in ORDERS.iter().enumerate() {
        let sign = |n: usize| {
            let right = |s: &&Setting| s.orders[k].0.mean * s.slope.mean > 0.0;
            format!(" {}/{} |", at(n).filter(right).count(), at(n).count())
        };
        let ratio = |n: usize| spread(at(n).map(|setting| setting.orders[k].0.over_error()));
        let loops = |n: usize| spread(at(n).map(|setting| setting.orders[k].1));
        let row: [String; 3] = [
            steps.iter().map(|&n| sign(n)).collect(),
            steps.iter().map(|&n| ratio(n)).collect(),
            steps.iter().map(|&n| loops(n)).collect(),
        ];
        writeln!(page, "| {name} |{}", row.concat())?;
    }
    let ratio = |n: &usize| spread(at(*n).map(|setting| setting.slope.over_error()));
    let truth: String = steps.iter().map(ratio).collect();
    let none = " |".repeat(steps.len());
    writeln!(page, "| the slope itself |{none}{truth}{none}\n")?;
    for &n in steps {
        let slopes = at(n).map(|s| format!("{:.1e} ± {:.0e}", s.slope.mean, s.slope.error));
        writeln!(page, "- slopes at {n} steps: {}", slopes.collect::<Vec<_>>().join(", "))?;
    }
    writeln!(page)
}

/// A cell with the least and the largest value.
fn spread(values: impl Iterator<Item = f64>) -> String {
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    values.for_each(|x| (low, high) = (low.min(x), high.max(x)));
    format!(" {low:.1}-{high:.1} |")
}
