//! Accuracy and cost of each estimator of `learn` for the slope of the outer loss.
//!
//! ```text
//! cargo run --release -p compare --features studies --example estimators              # 16 scenes; 10, 30 and 100 steps
//! cargo run --release -p compare --features studies --example estimators -- --quick   # 2 scenes; 10 steps, to out/estimators.md
//! ```
//!
//! The instances are small scenes of 2D SHAPE and POSE under a logistic of fixed width, for which φ is one number, the logarithm of its
//! scale. The reference is the slope of the outer loss, averaged over the scenes, by central differences of a tenth of a decade to either
//! side. All estimators use the same scenes. Writes `docs/studies/estimators.md`.

mod common;

use std::{fmt::Write, time::Instant};

use clap::Parser;
use common::{Study, constant, setup};
use pose::Pose;
use shape2d::Shape2d;
use softrast_cli::{Common, MethodArgs, Task, usual_args};
use softrast_inverse::{Instances, LearnConfig, OuterLoss};
use softrast_lab::{machine, mean, report::Table};
use softrast_meta::{MetaGradient, TaskDistribution};
use softrast_raster::HostBackend as B;
use softrast_softness::Family;
use softrast_tensor::{numbers, vector};

/// Half-width of the central differences, in natural logarithm: a tenth of a decade.
const HALF: f64 = 0.1 * std::f64::consts::LN_10;
/// Scales in NDC (a pixel is 0.0625). POSE has no wider ones, because each of its 2,856 faces would reach every pixel.
const SHAPE2D_SCALES: [f64; 5] = [0.005, 0.015, 0.04, 0.1, 0.25];
const POSE_SCALES: [f64; 4] = [0.002, 0.005, 0.015, 0.04];

/// Name, estimator and outer loss, which is the inner loss where the estimator supports no other.
const ESTIMATORS: [(&str, MetaGradient, OuterLoss); 5] = [
    ("unrolled, no clip", MetaGradient::Unrolled { clip: None }, OuterLoss::Fixed),
    ("unrolled, adjoint clip", MetaGradient::Unrolled { clip: Some(1.0) }, OuterLoss::Fixed),
    ("truncated:10", MetaGradient::Truncated { steps: 10, clip: Some(1.0) }, OuterLoss::Fixed),
    ("direct (own outer loss)", MetaGradient::Direct, OuterLoss::Own),
    ("es:0.05", MetaGradient::EvolutionStrategy { sigma: 0.05, pairs: 1 }, OuterLoss::Fixed),
];

/// Measurements at one number of steps and one scale.
struct Setting {
    /// Slope over the scenes.
    slope: Mean,
    /// Gradient over the scenes and time in inner loops, per estimator.
    estimates: Vec<(Mean, f64)>,
}

/// A mean and its standard error.
struct Mean {
    mean: f64,
    error: f64,
}

fn main() -> anyhow::Result<()> {
    let study = Study::parse();
    let (scenes, steps): (u64, &[usize]) =
        if study.quick { (2, &[10]) } else { (16, &[10, 30, 100]) };
    let clock = Instant::now();
    let args = shape2d::Args { triangles: Some(24), ..usual_args() };
    let title = "shape2d --size 32 --triangles 24 --learning-rate 0.03";
    let shape2d = section::<Shape2d>(title, &args, 0.03, &SHAPE2D_SCALES, steps, scenes)?;
    let title = "pose --size 32 --learning-rate 0.1";
    let pose = section::<Pose>(title, &usual_args(), 0.1, &POSE_SCALES, steps, scenes)?;
    let seconds = clock.elapsed().as_secs();
    let head = format!("{scenes} scenes, f32, {seconds} s on {}.\n\n", machine());
    study.page("estimators.md", &(head + &shape2d + &pose))
}

/// Title, table and slopes of a task.
fn section<T: Task>(
    title: &str,
    args: &T::Args,
    learning_rate: f64,
    scales: &[f64],
    steps: &[usize],
    scenes: u64,
) -> anyhow::Result<String> {
    let at = |steps: usize, scale: f64| {
        let common = Common { size: Some(32), steps: Some(steps), ..Common::default() };
        let method = MethodArgs {
            scale: Some(scale),
            learning_rate: Some(learning_rate),
            ..constant(Family::Logistic)
        };
        let of = |outer_loss| {
            let (estimator, outer_loss) = (Some(MetaGradient::default()), Some(outer_loss));
            let config = LearnConfig { estimator, outer_loss, ..LearnConfig::default() };
            let (task, method, solve) = setup::<T>(args, &common, &method)?;
            Instances::<T, B>::new(task, &method, &solve, &config)
        };
        let setting = Setting::measured(&of(OuterLoss::Fixed)?, &of(OuterLoss::Own)?, scenes);
        let slope = &setting.slope;
        println!("{title}, {steps} steps, scale {scale}: {:.4} ± {:.4}", slope.mean, slope.error);
        Ok(setting)
    };
    let all: Vec<Vec<Setting>> = steps
        .iter()
        .map(|&steps| scales.iter().map(|&scale| at(steps, scale)).collect())
        .collect::<anyhow::Result<_>>()?;
    let mut text = format!("`{title}`, scales {scales:?}:\n{}", table(steps, &all).markdown());
    for (steps, settings) in steps.iter().zip(&all) {
        let slope =
            |Setting { slope, .. }: &Setting| format!("{:.1e} ± {:.0e}", slope.mean, slope.error);
        let slopes: Vec<String> = settings.iter().map(slope).collect();
        writeln!(text, "- slopes at {steps} steps: {}", slopes.join(", "))?;
    }
    Ok(text + "\n")
}

/// Number of scales with the correct sign of the mean, mean over its error, and cost, per estimator and number of steps.
fn table(steps: &[usize], all: &[Vec<Setting>]) -> Table {
    let columns = ["sign", "mean / error", "loops"];
    let columns =
        columns.iter().flat_map(|what| steps.iter().map(move |n| format!("{what}, {n} steps")));
    let mut table = Table::new(["estimator".to_owned()].into_iter().chain(columns));
    for (k, (name, ..)) in ESTIMATORS.iter().enumerate() {
        let sign = |settings: &Vec<Setting>| {
            let right = |s: &&Setting| s.estimates[k].0.mean * s.slope.mean > 0.0;
            format!("{}/{}", settings.iter().filter(right).count(), settings.len())
        };
        let signs = all.iter().map(sign);
        let ratios = all.iter().map(|s| spread(s.iter().map(|s| s.estimates[k].0.over_error())));
        let loops = all.iter().map(|s| spread(s.iter().map(|s| s.estimates[k].1)));
        table.push([(*name).to_owned()].into_iter().chain(signs).chain(ratios).chain(loops));
    }
    let none = || steps.iter().map(|_| String::new());
    let ratios = all.iter().map(|s| spread(s.iter().map(|s| s.slope.over_error())));
    table.push(
        ["the slope itself".to_owned()].into_iter().chain(none()).chain(ratios).chain(none()),
    );
    table
}

impl Setting {
    fn measured<T: Task>(fixed: &Instances<T, B>, own: &Instances<T, B>, scenes: u64) -> Self {
        let first = LearnConfig::default().seed;
        let seeds = first..first + scenes;
        let phi = |shift: f64| vector::<B>(&fixed.start()).add_scalar(shift);
        let mut seconds = 0.0;
        // One side after the other, so that supports and knots are chosen once per side.
        let [low, high] = [-HALF, HALF].map(|shift| -> Vec<f64> {
            let phi = phi(shift);
            let loss = |seed| timed(&mut seconds, || fixed.loss(seed, &phi));
            seeds.clone().map(loss).collect()
        });
        let one_loop = seconds / (2 * scenes) as f64;
        let slopes = low.iter().zip(&high).map(|(low, high)| (high - low) / (2.0 * HALF));
        let estimates = ESTIMATORS.iter().map(|(_, estimator, outer_loss)| {
            let instances = if *outer_loss == OuterLoss::Own { own } else { fixed };
            let (phi, mut seconds) = (phi(0.0), 0.0);
            let gradients = seeds.clone().map(|seed| {
                let estimate = || estimator.estimate_on(instances, seed, &phi).gradient;
                numbers(timed(&mut seconds, estimate))[0]
            });
            let gradient = Mean::of(gradients);
            (gradient, seconds / scenes as f64 / one_loop)
        });
        Self { slope: Mean::of(slopes), estimates: estimates.collect() }
    }
}

/// Returns the result of `work` and adds its time to `seconds`.
fn timed<R>(seconds: &mut f64, work: impl FnOnce() -> R) -> R {
    let clock = Instant::now();
    let result = work();
    *seconds += clock.elapsed().as_secs_f64();
    result
}

impl Mean {
    /// The mean of the finite values; a learner omits the others too.
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.filter(|x| x.is_finite()).collect();
        let (n, mean) = (values.len() as f64, mean(&values));
        let squares = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        Self { mean, error: (squares / (n - 1.0) / n).sqrt() }
    }

    /// |mean| over its standard error; 0 if no value is finite or nothing depends on φ.
    fn over_error(&self) -> f64 {
        let ratio = self.mean.abs() / self.error;
        if ratio.is_finite() { ratio } else { 0.0 }
    }
}

/// The least and the largest value.
fn spread(values: impl Iterator<Item = f64>) -> String {
    let ends = |(low, high): (f64, f64), x: f64| (low.min(x), high.max(x));
    let (low, high) = values.fold((f64::INFINITY, 0.0), ends);
    format!("{low:.1}-{high:.1}")
}
