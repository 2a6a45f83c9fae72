//! Compares a softness that adapts within each run with a fixed one and with the preset.
//!
//! ```text
//! cargo run --release -p compare --features studies --example alternating              # as many seeds as in docs/results.md
//! cargo run --release -p compare --features studies --example alternating -- --quick   # two tiny seeds, to out/alternating.md
//! ```
//!
//! The strongest baseline without learning: φ descends the inner loss together with the scene, starting from the searched fixed width, at a
//! rate chosen on training seeds of the original variant. The error is that of the hard image at the last step, on the seeds from 0. Writes
//! `docs/studies/learning.md`.

mod common;

use clap::Parser;
use common::{Study, constant, setup};
use occlusion::Occlusion;
use pose::Pose;
use shape2d::Shape2d;
use shape3d::Shape3d;
use softrast_cli::{Common, Init, MethodArgs, SoftnessChoice, Task, Variant, usual_args};
use softrast_inverse::{Instances, LearnConfig, OuterLoss, SIGMA};
use softrast_lab::{machine, mean, paired_among, report::Table};
use softrast_meta::{MetaGradient, TaskDistribution};
use softrast_raster::HostBackend as B;
use softrast_softness::Family;
use softrast_tensor::vector;

/// Learning rates of Adam for φ.
const RATES: [f64; 4] = [0.001, 0.01, 0.03, 0.1];
/// Largest number of training seeds for choosing a rate.
const TRAINING: u64 = 6;

fn main() -> anyhow::Result<()> {
    let study = Study::parse();
    let head =
        ["task", "softness", "seeds", "fixed φ", "adapting, at its rate", "adapting − fixed"];
    let mut table = Table::new(head.into_iter().chain(["`preset`", "adapting − `preset`"]));
    rows::<Pose>(&mut table, 48, &study)?;
    rows::<Occlusion>(&mut table, 50, &study)?;
    rows::<Shape3d>(&mut table, 12, &study)?;
    rows::<Shape2d>(&mut table, 20, &study)?;
    study.page("learning.md", &format!("On {}.\n{}", machine(), table.markdown()))
}

/// Adds a task's rows: both variants of each adapting softness.
fn rows<T: Task>(table: &mut Table, seeds: u64, study: &Study) -> anyhow::Result<()> {
    let seeds = if study.quick { 2 } else { seeds };
    let of = |variant, method: &MethodArgs| -> anyhow::Result<Instances<T, B>> {
        let (size, steps) = (study.quick.then_some(32), study.quick.then_some(10));
        let common = Common { variant, size, steps, ..Common::default() };
        let (task, method, solve) = setup::<T>(&usual_args(), &common, method)?;
        // Nothing is learned; this estimator alone supports a hard image and a surrogate.
        let estimator = Some(MetaGradient::EvolutionStrategy { sigma: SIGMA, pairs: 1 });
        let outer_loss = Some(OuterLoss::Hard);
        let config = LearnConfig { estimator, outer_loss, ..LearnConfig::default() };
        Instances::new(task, &method, &solve, &config)
    };
    let softness = Some(SoftnessChoice::Preset);
    let preset = MethodArgs { softness, ..MethodArgs::default() };
    let preset = |variant| Ok(stays(&of(variant, &preset)?, seeds));
    let preset: Vec<Vec<f64>> =
        Variant::ALL.into_iter().map(preset).collect::<anyhow::Result<_>>()?;
    let network = MethodArgs { init: Some(Init::Fitted), ..constant(Family::Mlp) };
    for (name, method) in [
        ("logistic", constant(Family::Logistic)),
        ("gauss", constant(Family::Gauss)),
        ("network, fitted", network),
    ] {
        let original = of(Variant::Original, &method)?;
        let first = LearnConfig::default().seed;
        let training = first..first + TRAINING.min(seeds);
        let tried = RATES.map(|rate| (rate, mean(&adapts(&original, training.clone(), rate))));
        println!("{} {name}: {tried:?}", T::NAME);
        let finite = tried.into_iter().filter(|(_, loss)| loss.is_finite());
        let Some((rate, _)) = finite.min_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        for (variant, preset) in Variant::ALL.into_iter().zip(&preset) {
            let start = of(variant, &method)?;
            let (stays, adapts) = (stays(&start, seeds), adapts(&start, 0..seeds, rate));
            let row = [
                format!("{}, {}", T::NAME, variant.name()),
                name.to_owned(),
                seeds.to_string(),
                short(mean(&stays)),
                format!("{}, {rate}", short(mean(&adapts))),
                less(&adapts, &stays),
                short(mean(preset)),
                less(&adapts, preset),
            ];
            println!("  {}", row.join(" | "));
            table.push(row);
        }
    }
    Ok(())
}

/// Hard errors at the last step with fixed φ, one per seed.
fn stays<T: Task>(instances: &Instances<T, B>, seeds: u64) -> Vec<f64> {
    let phi = vector::<B>(&instances.start());
    (0..seeds).map(|seed| instances.loss(seed, &phi)).collect()
}

/// Hard errors at the last step with φ descending the inner loss at `learning_rate`, one per seed.
fn adapts<T: Task>(
    instances: &Instances<T, B>,
    seeds: impl Iterator<Item = u64>,
    learning_rate: f64,
) -> Vec<f64> {
    let phi = vector::<B>(&instances.start());
    let along = MetaGradient::AlternatingDescent { learning_rate };
    seeds.map(|seed| along.estimate_on(instances, seed, &phi).loss).collect()
}

fn short(x: f64) -> String {
    if x.abs() < 0.01 { format!("{x:.5}") } else { format!("{x:.3}") }
}

/// Mean paired difference and its interval; bold if the interval excludes 0.
fn less(a: &[f64], b: &[f64]) -> String {
    let (mean, [low, high]) = paired_among(1, a, b);
    let text = format!("{} ({} to {})", short(mean), short(low), short(high));
    if low > 0.0 || high < 0.0 { format!("**{text}**") } else { text }
}
