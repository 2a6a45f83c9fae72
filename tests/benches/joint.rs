//! A softness that adapts inside every run, against one that stays and the learned one.
//!
//! ```text
//! cargo bench -p softrast-tests --bench joint                # as many seeds as in docs/results.md
//! cargo bench -p softrast-tests --bench joint -- 2           # fewer: so many of each task
//! cargo bench -p softrast-tests --bench joint -- shape2d     # one task, printed and not written
//! ```
//!
//! The strongest baseline without learning: φ goes down the inner loss along with the scene, from the searched static
//! softness, at a rate that is chosen on training seeds of the original variant (META 3J). Judged by the hard image where
//! a run ends, on the seeds from 0 on. Writes `docs/learning.md`.

mod learning;
#[path = "../../crates/raster/benches/machine.rs"]
mod machine;

use std::fmt::Write;

use burn::backend::NdArray;
use learning::{plan, task};
use occlusion::{Occlusion, OcclusionLesson};
use pose::{Pose, PoseLesson};
use shape2d::{Shape2d, Shape2dLesson};
use shape3d::{Shape3d, Shape3dLesson};
use softrast_meta::{MetaGradient, Tasks};
use softrast_method::{Class, Lesson};
use softrast_runner::{Order, Plan, Referee, Task, bootstrap_mean_interval, mean};
use softrast_tests::vector;

type B = NdArray<f32>;

/// Rates of the Adam that moves φ.
const RATES: [f64; 4] = [0.001, 0.01, 0.03, 0.1];
/// First of the seeds that rates are chosen on, and how many.
const TRAINING: (u64, u64) = (1_000_000, 6);
/// What adapts.
const STARTS: [(&str, &str); 3] = [
    ("logistic", "--softness logistic --schedule static"),
    ("gauss", "--softness gauss --schedule static"),
    ("network, fitted", "--softness mlp --init fitted --schedule static"),
];
const VARIANTS: [&str; 2] = ["original", "transfer"];

fn main() -> anyhow::Result<()> {
    // Cargo adds a flag of its own.
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let fewer = words.iter().find_map(|word| word.parse::<u64>().ok());
    let seeds = |usual| fewer.unwrap_or(usual);
    let only: Vec<&String> = words.iter().filter(|word| word.parse::<u64>().is_err()).collect();
    let asked = |name: &str| only.is_empty() || only.iter().any(|word| *word == name);
    let mut page = format!("On {}.\n\n", machine::machine());
    page += "| task | softness | seeds | stays | adapts, at its rate | adapts less stays | `learned` | adapts less `learned` |\n";
    page += "|---|---|--:|--:|--:|--:|--:|--:|\n";
    if asked(Pose::NAME) {
        rows::<Pose, _>(&mut page, seeds(48), |task, plan| Ok(PoseLesson::new(task, plan)))?;
    }
    if asked(Occlusion::NAME) {
        rows::<Occlusion, _>(&mut page, seeds(50), |task, plan| {
            Ok(OcclusionLesson::new(task, plan))
        })?;
    }
    if asked(Shape3d::NAME) {
        rows::<Shape3d, _>(&mut page, seeds(12), |task, plan| Ok(Shape3dLesson::new(task, plan)))?;
    }
    if asked(Shape2d::NAME) {
        rows::<Shape2d, _>(&mut page, seeds(20), Shape2dLesson::new)?;
    }
    if only.is_empty() {
        learning::write("learning.md", "joint", &page)?;
    }
    Ok(())
}

/// Rows of a task: for each start, both variants.
fn rows<T: Task, L: Lesson>(
    page: &mut String,
    seeds: u64,
    lesson: impl Fn(T, &Plan) -> anyhow::Result<L>,
) -> anyhow::Result<()> {
    let plan = plan(Order::Joint, Referee::Hard);
    // A softness, and the vector that it starts from.
    let softness = |flags: &str| -> anyhow::Result<(Class<L, B>, Vec<f64>)> {
        let lesson = lesson(task::<T>(flags)?, &plan)?;
        let phi = lesson.start();
        Ok((Class::new(lesson, &plan), phi))
    };
    let adapted = |(class, phi): &(Class<L, B>, Vec<f64>), rate: f64, seed: u64| {
        let phi = vector::<B>(phi);
        let problem = class.problem(seed, &phi);
        MetaGradient::Joint { learning_rate: rate }.estimate(&problem, &phi, seed).loss
    };
    let stays = |(class, phi): &(Class<L, B>, Vec<f64>)| -> Vec<f64> {
        (0..seeds).map(|seed| class.loss(seed, &vector::<B>(phi))).collect()
    };
    let learned = VARIANTS
        .map(|variant| Ok(stays(&softness(&format!("--variant {variant} --softness learned"))?)));
    let learned: Vec<Vec<f64>> = learned.into_iter().collect::<anyhow::Result<_>>()?;
    for (name, flags) in STARTS {
        let start = softness(flags)?;
        let (first, count) = TRAINING;
        let tried = RATES.map(|rate| {
            let losses: Vec<f64> =
                (first..first + count.min(seeds)).map(|seed| adapted(&start, rate, seed)).collect();
            (rate, mean(&losses))
        });
        println!("{} {name}: {tried:?}", T::NAME);
        let best = tried.into_iter().filter(|(_, loss)| loss.is_finite());
        let Some((rate, _)) = best.min_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        for (variant, learned) in VARIANTS.into_iter().zip(&learned) {
            let start = softness(&format!("--variant {variant} {flags}"))?;
            let stays = stays(&start);
            let adapts: Vec<f64> = (0..seeds).map(|seed| adapted(&start, rate, seed)).collect();
            let row = format!(
                "| {}, {variant} | {name} | {seeds} | {} | {}, {rate} | {} | {} | {} |",
                T::NAME,
                short(mean(&stays)),
                short(mean(&adapts)),
                less(&adapts, &stays),
                short(mean(learned)),
                less(&adapts, learned),
            );
            println!("{row}");
            writeln!(page, "{row}")?;
        }
    }
    Ok(())
}

fn short(x: f64) -> String {
    if x.abs() < 0.01 { format!("{x:.5}") } else { format!("{x:.3}") }
}

/// The mean difference, seed by seed, and its interval: in bold where that leaves out 0.
fn less(a: &[f64], b: &[f64]) -> String {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    let [low, high] = bootstrap_mean_interval(&differences, 10_000, 0);
    let text = format!("{} ({} to {})", short(mean(&differences)), short(low), short(high));
    if low > 0.0 || high < 0.0 { format!("**{text}**") } else { text }
}
