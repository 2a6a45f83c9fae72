//! Every order of `learn` from the same wrong start at the same budget of inner loops, with a grid search and a
//! line search beside them.
//!
//! ```text
//! cargo bench -p softrast-tests --bench orders                  # 400 inner loops each
//! cargo bench -p softrast-tests --bench orders -- 100           # fewer
//! ```
//!
//! Small instances of 2D SHAPE, once with the scale of a logistic to learn and once with the weights of the
//! network that is fitted to it. Writes `docs/orders-*.svg`, their points as CSV and `docs/estimators.md`.

mod learning;
#[path = "../../crates/raster/benches/machine.rs"]
mod machine;

use std::{fmt::Write, fs, time::Instant};

use burn::backend::NdArray;
use learning::{docs, plan, task};
use shape2d::{Shape2d, Shape2dLesson};
use softrast_meta::Tasks;
use softrast_method::{Class, Lesson, study};
use softrast_runner::{Curve, Figure, Order, Plan, Referee, mean};
use softrast_tests::vector;

type B = NdArray<f32>;

const SCENE: &str = "--size 64 --triangles 100 --steps 100 --schedule static";
/// Four times as wide as is best.
const START: f64 = 0.03;
/// What is learned, its flags, and the step of the outer Adam.
const SUBJECTS: [(&str, &str, f64); 2] =
    [("logistic", "--softness logistic", 0.1), ("network", "--softness mlp --init fitted", 0.03)];
/// Instances of an outer step, and of a validation.
const BATCH: usize = 8;
const VALIDATION: usize = 16;
/// Name, order, referee where need be, and the inner loops that an instance costs, roughly.
const ORDERS: [(&str, Order, Referee, f64); 5] = [
    ("unrolled", Order::Unrolled, Referee::Fixed, 2.5),
    ("truncated:10", Order::Truncated(10), Referee::Fixed, 1.15),
    ("direct (referee own)", Order::Direct, Referee::Own, 1.0),
    ("joint", Order::Joint, Referee::Fixed, 1.0),
    ("es:0.2", Order::Es(0.2), Referee::Fixed, 2.0),
];
/// Scales of the grid: from the first on, each so many times the one before.
const GRID: (f64, f64) = (0.002, 1.5);

/// Validation loss of the best softness so far, over seconds.
struct Found {
    name: &'static str,
    points: Vec<[f64; 2]>,
}

fn main() -> anyhow::Result<()> {
    // Cargo adds a flag of its own.
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let budget: usize = words.first().map_or(Ok(400), |word| word.parse())?;
    let mut page = format!("{budget} inner loops each, on {}.\n\n", machine::machine());
    for (subject, flags, rate) in SUBJECTS {
        let all = measured(flags, rate, budget)?;
        page += &table(subject, &all)?;
        let mut csv = String::from("series,seconds,validation_loss\n");
        for Found { name, points } in &all {
            points.iter().try_for_each(|[x, y]| writeln!(csv, "{name},{x},{y}"))?;
        }
        let figure = Figure {
            caption: String::new(),
            axes: ["seconds".into(), "lowest validation loss so far".into()],
            logarithmic: [true; 2],
            curves: all
                .into_iter()
                .map(|Found { name, points }| Curve { name: name.into(), points: stairs(points) })
                .collect(),
        };
        fs::write(docs(&format!("orders-{subject}.svg")), figure.svg()?)?;
        fs::write(docs(&format!("orders-{subject}.csv")), csv)?;
    }
    learning::write("estimators.md", "orders", &page)
}

fn measured(flags: &str, rate: f64, budget: usize) -> anyhow::Result<Vec<Found>> {
    let lesson = |scale: f64, plan: &Plan| {
        Shape2dLesson::new(task::<Shape2d>(&format!("{SCENE} {flags} --scale {scale}"))?, plan)
    };
    let mut all = Vec::new();
    for (name, order, referee, loops) in ORDERS {
        let outer = (budget as f64 / (loops * BATCH as f64)).round() as usize;
        let plan = Plan {
            outer,
            batch: BATCH,
            outer_rate: rate,
            validation_runs: VALIDATION,
            ..plan(order, referee)
        };
        let mut study = study(lesson(START, &plan)?, &plan)?;
        let (clock, mut points) = (Instant::now(), Vec::new());
        while let Some(step) = study.advance()? {
            if let Some(loss) = step.validation {
                points.push([clock.elapsed().as_secs_f64(), loss]);
            }
        }
        all.push(Found { name, points: lowest(points) });
        println!("{flags}: {name} {:?}", all.last().map(|found| &found.points));
    }
    let plan = plan(Order::Unrolled, Referee::Fixed);
    let loss = |scale: f64| -> anyhow::Result<f64> {
        let lesson = lesson(scale, &plan)?;
        let phi = vector::<B>(&lesson.start());
        let class = Class::new(lesson, &plan);
        let seeds = (0..VALIDATION as u64).map(|k| plan.validation_seed + k);
        Ok(mean(&seeds.map(|seed| class.judged(seed, &phi)).collect::<Vec<_>>()))
    };
    let trials = budget / VALIDATION;
    for (name, search) in [("grid search", false), ("line search", true)] {
        let (clock, mut points) = (Instant::now(), Vec::new());
        let mut tried = |scale: f64| -> anyhow::Result<f64> {
            let loss = loss(scale)?;
            points.push([clock.elapsed().as_secs_f64(), loss]);
            Ok(loss)
        };
        match search {
            true => line_search(&mut tried, trials)?,
            false => {
                let (mut scale, most) = (GRID.0, trials.min(12));
                for _ in 0..most {
                    tried(scale)?;
                    scale *= GRID.1;
                }
            }
        }
        all.push(Found { name, points: lowest(points) });
        println!("{flags}: {name} {:?}", all.last().map(|found| &found.points));
    }
    Ok(all)
}

/// From the start towards the better side in steps that double, then back in halves, on the logarithm.
fn line_search(
    tried: &mut impl FnMut(f64) -> anyhow::Result<f64>,
    trials: usize,
) -> anyhow::Result<()> {
    let (mut best, mut scale) = (tried(START)?, START.ln());
    let mut step = -0.2;
    let mut widening = true;
    for k in 1..trials {
        let loss = tried((scale + step).exp())?;
        if loss < best {
            (best, scale) = (loss, scale + step);
            step *= if widening { 2.0 } else { 0.5 };
        } else {
            // The first try may only have gone to the wrong side.
            widening &= k == 1;
            step *= if widening { -1.0 } else { -0.5 };
        }
        if step.abs() < 0.02 {
            break;
        }
    }
    Ok(())
}

fn lowest(points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let mut low = f64::INFINITY;
    let lower = |[x, y]: [f64; 2]| {
        low = low.min(y);
        [x, low]
    };
    points.into_iter().map(lower).collect()
}

/// What was found holds until something better is.
fn stairs(points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let before = points.windows(2).map(|pair| [pair[1][0], pair[0][1]]).collect::<Vec<_>>();
    let mut all: Vec<[f64; 2]> = points.first().copied().into_iter().collect();
    all.extend(before.into_iter().zip(points.into_iter().skip(1)).flat_map(|(a, b)| [a, b]));
    all
}

/// Who is within a tenth of the best when.
fn table(subject: &str, all: &[Found]) -> anyhow::Result<String> {
    let lowest = |found: &Found| found.points.last().map_or(f64::INFINITY, |point| point[1]);
    let best = all.iter().map(lowest).fold(f64::INFINITY, f64::min);
    let mut text = format!(
        "![{subject}](orders-{subject}.svg)\n\n| {subject} | lowest | within a tenth of the best of all after | all of it |\n|---|--:|--:|--:|\n"
    );
    for found in all {
        let near = found.points.iter().find(|point| point[1] <= 1.1 * best);
        let near = near.map_or("not".to_owned(), |[seconds, _]| format!("{seconds:.0} s"));
        let end = found.points.last().map_or(0.0, |point| point[0]);
        writeln!(text, "| {} | {:.4} | {near} | {end:.0} s |", found.name, lowest(found))?;
    }
    Ok(text + "\n")
}
