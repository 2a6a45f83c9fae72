//! A POSE run that stalls under the best decay, the same pair under an adaptive schedule, and the error of each method over time.
//!
//! ```text
//! cargo run --release -p compare --features studies --example adaptive              # 100 pairs
//! cargo run --release -p compare --features studies --example adaptive -- --quick   # 4 small pairs, to out/
//! ```
//!
//! Writes `docs/studies/adaptive-*.svg` and their points as CSV.

#[allow(dead_code, reason = "not every study uses all of it")]
mod common;

use std::path::Path;

use clap::Parser;
use common::{Study, setup};
use pose::Pose;
use softrast_cli::{Common, MethodArgs, usual_args};
use softrast_inverse::{InverseProblem, Minimization};
use softrast_lab::{
    mean,
    plot::{Axis, Plot, Series},
};
use softrast_raster::HostBackend as B;

/// A run fails if its returned error is above this, and finds its pose if the error is below a third of this.
const FAILED: f64 = 0.05;
/// Number of times in the chart over seconds.
const TIMES: usize = 60;

/// A method and its runs.
struct Method {
    name: &'static str,
    runs: Vec<Vec<Seen>>,
}

/// State of a run at a step.
#[derive(Clone, Copy)]
struct Seen {
    scale: f64,
    hard_loss: f64,
    restarts: usize,
    /// Time of the steps so far.
    seconds: f64,
}

fn main() -> anyhow::Result<()> {
    let study = Study::parse();
    let pairs = if study.quick { 4 } else { 100 };
    let rule = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/studies/pose-restarts.json");
    let methods = [
        ("preset", "preset".to_owned()),
        ("three starts", rule.display().to_string()),
        ("decay", "logistic --schedule decay".to_owned()),
    ];
    let methods =
        methods.map(|(name, method)| Ok(Method { name, runs: runs(&study, &method, pairs)? }));
    let methods = methods.into_iter().collect::<anyhow::Result<Vec<_>>>()?;
    let [preset, _, decay] = methods.as_slice() else { unreachable!("three methods") };
    let stalled = (0..pairs)
        .find(|&k| least(&decay.runs[k]) > FAILED && least(&preset.runs[k]) < FAILED / 3.0);
    match stalled {
        Some(seed) => {
            println!("seed {seed} stalls under the decay");
            let chart = |name: &str, y: &str, of: fn(&Seen) -> f64| {
                let line = |method: &Method| {
                    let points = method.runs[seed].iter().enumerate();
                    let points = points.map(|(step, seen)| [step as f64, of(seen).max(1e-4)]);
                    Series {
                        name: method.name.into(),
                        points: points.collect(),
                        ..Series::default()
                    }
                };
                let series = vec![line(preset), line(decay)];
                let plot = Plot::new(Axis::linear("step"), Axis::logarithmic(y));
                save(&study, name, &Plot { series, ..plot })
            };
            chart("adaptive-scale", "scale, NDC", |seen| seen.scale)?;
            chart("adaptive-error", "hard IoU loss", |seen| seen.hard_loss)?;
            let again = preset.runs[seed].last().map_or(0, |seen| seen.restarts);
            println!("the preset restarts {again} times");
        }
        None => println!("no pair stalls under the decay and found by the preset"),
    }
    let all = methods.iter().flat_map(|method| &method.runs).filter_map(|run| run.last());
    let longest = all.map(|seen| seen.seconds).fold(0.0, f64::max);
    let line = |method: &Method| {
        let points = (1..=TIMES).map(|k| {
            let time = longest * k as f64 / TIMES as f64;
            let reached = |run: &Vec<Seen>| least_by(run, time);
            [time, mean(&method.runs.iter().map(reached).collect::<Vec<_>>())]
        });
        Series { name: method.name.into(), points: points.collect(), ..Series::default() }
    };
    let series = methods.iter().map(line).collect();
    let plot = Plot::new(
        Axis::linear("seconds of the steps"),
        Axis::logarithmic("least hard IoU loss so far, mean"),
    );
    save(&study, "adaptive-seconds", &Plot { series, ..plot })
}

fn save(study: &Study, name: &str, plot: &Plot) -> anyhow::Result<()> {
    study.file(&format!("{name}.svg"), plot.svg()?.as_bytes())?;
    study.file(&format!("{name}.csv"), plot.csv().as_bytes())
}

/// The runs of a method on the first held-out pairs.
fn runs(study: &Study, method: &str, pairs: usize) -> anyhow::Result<Vec<Vec<Seen>>> {
    let method = MethodArgs::parse(method).map_err(anyhow::Error::msg)?;
    let (size, steps) = (study.quick.then_some(16), study.quick.then_some(30));
    let common = Common { size, steps, ..Common::default() };
    let (task, method, solve) = setup::<Pose>(&usual_args(), &common, &method)?;
    let run = |seed: u64| -> anyhow::Result<Vec<Seen>> {
        let instances = vec![task.instance(seed)?];
        let mut seconds = 0.0;
        let seen = Minimization::<Pose, B, &Pose>::new(&task, instances, &method, &solve)?;
        let seen = seen.map(|iterate| {
            let iterate = iterate?;
            seconds += iterate.seconds.unwrap_or(0.0);
            let (hard_loss, restarts) = (iterate.hard_loss[0], iterate.restarts);
            Ok(Seen { scale: iterate.scale, hard_loss, restarts, seconds })
        });
        seen.collect()
    };
    (0..pairs as u64).map(run).collect()
}

/// Hard error of the returned step.
fn least(run: &[Seen]) -> f64 {
    least_by(run, f64::INFINITY)
}

/// Lowest hard error up to `time`, in seconds.
fn least_by(run: &[Seen], time: f64) -> f64 {
    let seen = run.iter().take_while(|seen| seen.seconds <= time);
    seen.map(|seen| seen.hard_loss).fold(f64::INFINITY, f64::min)
}
