//! Compares the estimators of `learn`, all from the same wrong start, with a grid search and a line search at the same budget of inner
//! loops.
//!
//! ```text
//! cargo run --release -p compare --features studies --example orders              # 400 inner loops each
//! cargo run --release -p compare --features studies --example orders -- --quick   # 40 on tiny instances, to out/orders.md
//! ```
//!
//! Learns the scale of a logistic, and the weights of a network fitted to it, on small instances of 2D SHAPE. Writes
//! `docs/studies/orders-*.svg`, their points as CSV and `docs/studies/estimators.md`.

mod common;

use std::time::Instant;

use clap::Parser;
use common::{Study, constant, setup};
use shape2d::{Args, Shape2d};
use softrast_cli::{Common, Init, MethodArgs, usual_args};
use softrast_inverse::{Instances, LearnConfig, Learning, OuterLoss};
use softrast_lab::{
    machine, mean,
    plot::{Axis, Plot, Series},
    report::Table,
};
use softrast_meta::{MetaGradient, TaskDistribution};
use softrast_raster::HostBackend as B;
use softrast_softness::{Family, Softness};
use softrast_tensor::vector;

/// Initial scale, four times the best.
const START: f64 = 0.03;
/// Instances per update, and per validation.
const BATCH: usize = 8;
const VALIDATION: usize = 16;
/// Grid of scales: the first, the ratio of successive ones, and the largest number of them.
const GRID: (f64, f64, usize) = (0.002, 1.5, 12);

/// The size of the study.
struct Work {
    /// Inner loops for each estimator.
    budget: usize,
    args: Args,
    common: Common,
}

/// A method to learn.
struct Subject {
    method: MethodArgs,
    /// Learning rate of the updates.
    rate: f64,
}

/// Name, estimator and approximate cost of an instance in inner loops.
fn estimators(rate: f64) -> [(&'static str, MetaGradient, f64); 5] {
    let es = MetaGradient::EvolutionStrategy { sigma: 0.2, pairs: 1 };
    [
        ("unrolled", MetaGradient::default(), 2.5),
        ("truncated:10", MetaGradient::Truncated { steps: 10, clip: Some(1.0) }, 1.15),
        ("direct (own outer loss)", MetaGradient::Direct, 1.0),
        ("alternating", MetaGradient::AlternatingDescent { learning_rate: rate }, 1.0),
        ("es:0.2", es, 2.0),
    ]
}

fn main() -> anyhow::Result<()> {
    let study = Study::parse();
    let (budget, size, triangles, steps) =
        if study.quick { (40, 32, 24, 20) } else { (400, 64, 100, 100) };
    let args = Args { triangles: Some(triangles), ..usual_args() };
    let common = Common { size: Some(size), steps: Some(steps), ..Common::default() };
    let work = Work { budget, args, common };
    let network = MethodArgs { init: Some(Init::Fitted), ..constant(Family::Mlp) };
    let subjects = [
        ("logistic", Subject { method: constant(Family::Logistic), rate: 0.1 }),
        ("network", Subject { method: network, rate: 0.03 }),
    ];
    let mut page = format!("{budget} inner loops each, on {}.\n", machine());
    for (name, subject) in subjects {
        let found = [subject.learned(&work)?, subject.searched(&work)?].concat();
        page += &format!("\n![{name}](orders-{name}.svg)\n{}", table(name, &found).markdown());
        let axes = ["seconds", "lowest validation loss so far"].map(Axis::logarithmic);
        let [x, y] = axes;
        let plot = Plot { series: found.into_iter().map(stairs).collect(), ..Plot::new(x, y) };
        study.file(&format!("orders-{name}.svg"), plot.svg()?.as_bytes())?;
        study.file(&format!("orders-{name}.csv"), plot.csv().as_bytes())?;
    }
    study.page("estimators.md", &(page + "\n"))
}

impl Subject {
    fn at(&self, scale: f64) -> MethodArgs {
        MethodArgs { scale: Some(scale), ..self.method.clone() }
    }

    /// Lowest validation loss so far over seconds, per estimator.
    fn learned(&self, work: &Work) -> anyhow::Result<Vec<Series>> {
        let learned = |(name, estimator, loops): (&str, _, f64)| {
            let (task, method, solve) =
                setup::<Shape2d>(&work.args, &work.common, &self.at(START))?;
            let config = LearnConfig {
                estimator: Some(estimator),
                updates: (work.budget as f64 / (loops * BATCH as f64)).round() as usize,
                batch: BATCH,
                outer_rate: self.rate,
                validation_runs: VALIDATION,
                ..LearnConfig::default()
            };
            let mut learning = Learning::<_, B>::new(task, &method, &solve, &config)?;
            let (clock, mut points) = (Instant::now(), Vec::new());
            while let Some(record) = learning.step()? {
                let seconds = clock.elapsed().as_secs_f64();
                points.extend(record.validation_loss.map(|loss| [seconds, loss]));
            }
            Ok(lowest(name, points))
        };
        estimators(self.rate).into_iter().map(learned).collect()
    }

    /// Lowest validation loss so far over seconds, for a grid search and a line search of the scale.
    fn searched(&self, work: &Work) -> anyhow::Result<Vec<Series>> {
        let (task, method, solve) = setup::<Shape2d>(&work.args, &work.common, &self.at(START))?;
        let config = LearnConfig { outer_loss: Some(OuterLoss::Fixed), ..LearnConfig::default() };
        let instances = Instances::<_, B>::new(task, &method, &solve, &config)?;
        let loss = |scale: f64| {
            let phi = instances.start();
            let phi = method.softness.softness.with_scale_values(&phi, scale / START);
            let seeds = (0..VALIDATION as u64).map(|k| config.validation_seed + k);
            let losses = seeds.map(|seed| instances.validation_loss(seed, &vector::<B>(&phi)));
            mean(&losses.collect::<Vec<f64>>())
        };
        let trials = work.budget / VALIDATION;
        let timed = |name, search: fn(&mut dyn FnMut(f64) -> f64, usize)| {
            let (clock, mut points) = (Instant::now(), Vec::new());
            let mut tried = |scale| {
                let loss = loss(scale);
                points.push([clock.elapsed().as_secs_f64(), loss]);
                loss
            };
            search(&mut tried, trials);
            lowest(name, points)
        };
        Ok(vec![timed("grid search", grid_search), timed("line search", line_search)])
    }
}

fn grid_search(tried: &mut dyn FnMut(f64) -> f64, trials: usize) {
    let (first, ratio, most) = GRID;
    for k in 0..trials.min(most) {
        tried(first * ratio.powi(k as i32));
    }
}

/// Searches the logarithm of the scale from the start towards the better side: steps double first, then halve and turn back.
fn line_search(tried: &mut dyn FnMut(f64) -> f64, trials: usize) {
    let (mut best, mut scale) = (tried(START), START.ln());
    let (mut step, mut widening) = (-0.2_f64, true);
    for k in 1..trials {
        let loss = tried((scale + step).exp());
        if loss < best {
            (best, scale) = (loss, scale + step);
            step *= if widening { 2.0 } else { 0.5 };
        } else {
            // The first trial may have gone to the wrong side.
            widening &= k == 1;
            step *= if widening { -1.0 } else { -0.5 };
        }
        if step.abs() < 0.02 {
            break;
        }
    }
}

/// Replaces each loss by the lowest so far.
fn lowest(name: &str, mut points: Vec<[f64; 2]>) -> Series {
    for k in 1..points.len() {
        points[k][1] = points[k][1].min(points[k - 1][1]);
    }
    println!("{name}: {points:?}");
    Series { name: name.to_owned(), points, ..Series::default() }
}

/// Turns points into stairs: a loss holds until a lower one is found.
fn stairs(mut series: Series) -> Series {
    let steps = series.points.windows(2).flat_map(|pair| [[pair[1][0], pair[0][1]], pair[1]]);
    series.points = series.points.first().copied().into_iter().chain(steps).collect();
    series
}

/// Time until each method is within a tenth of the best loss.
fn table(subject: &str, all: &[Series]) -> Table {
    let end = |series: &Series| series.points.last().copied().unwrap_or([0.0, f64::INFINITY]);
    let best = all.iter().map(|series| end(series)[1]).fold(f64::INFINITY, f64::min);
    let head = [subject, "lowest", "within a tenth of the best of all after", "all of it"];
    let mut table = Table::new(head);
    for series in all {
        let near = series.points.iter().find(|point| point[1] <= 1.1 * best);
        let near = near.map_or("not".to_owned(), |[seconds, _]| format!("{seconds:.0} s"));
        let [seconds, loss] = end(series);
        let (loss, seconds) = (format!("{loss:.4}"), format!("{seconds:.0} s"));
        table.push([series.name.clone(), loss, near, seconds]);
    }
    table
}
