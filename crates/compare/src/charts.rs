//! Charts of speed against accuracy, for one task in one variant or over all of them.

use softrast_runner::{mean, median, method_colour, quantile};

use crate::{
    Measured, Purpose, functions,
    measured::{paired, short},
    plot::{Axis, Mark, Plot, Series},
};

/// A run is solved where its hard error has fallen to this share of what it began with. Fixed before
/// anything was measured (META 5.2).
pub(crate) const TARGET: f64 = 0.1;

/// A chart with its file name and what it shows.
pub(crate) struct Chart {
    pub(crate) name: String,
    pub(crate) caption: String,
    pub(crate) plot: Plot,
}

/// The charts of the cells of one task in one variant.
pub(crate) fn of_variant(cells: &[&Measured]) -> Vec<Chart> {
    let all = cells;
    let cells: Vec<&Measured> =
        all.iter().filter(|one| one.cell.purpose == Purpose::Compared).copied().collect();
    let Some(first) = cells.first() else { return Vec::new() };
    let stem = format!("{}-{}", first.cell.task.name(), first.cell.variant);
    let of = format!("{}, {}", first.cell.task.title(), first.cell.variant);
    let steps = |one: &Measured, k: usize| k as f64 * one.steps as f64 / last(one);
    let seconds = |one: &Measured, k: usize| k as f64 * one.seconds / last(one);
    let runs = first.cell.runs;
    vec![
        Chart {
            name: format!("{stem}-steps"),
            caption: format!(
                "{of}: {} over the steps, median of {runs} seeds and, shaded, the middle half of them.",
                first.hard.name
            ),
            plot: Plot {
                x: Axis::linear("step"),
                y: Axis::logarithmic(&first.hard.name),
                series: cells.iter().map(|one| over(one, Curve::Hard, steps)).collect(),
                front: Vec::new(),
            },
        },
        Chart {
            name: format!("{stem}-parameters"),
            caption: format!("{of}: {} over the steps, drawn likewise.", first.parameter.name),
            plot: Plot {
                x: Axis::linear("step"),
                y: Axis::logarithmic(&first.parameter.name),
                series: cells.iter().map(|one| over(one, Curve::Parameter, steps)).collect(),
                front: Vec::new(),
            },
        },
        Chart {
            name: format!("{stem}-anytime"),
            caption: format!(
                "{of}: the lowest {} that a run has reached by a time, median and middle half of \
                 {runs} seeds. The method that is lowest at a time is the one to stop there with.",
                first.hard.name
            ),
            plot: Plot {
                x: Axis::logarithmic("seconds of optimisation in a run"),
                y: Axis::logarithmic(&format!("lowest {} so far", first.hard.name)),
                series: cells.iter().map(|one| over(one, Curve::Lowest, seconds)).collect(),
                front: Vec::new(),
            },
        },
        pareto(all, &stem, &of),
    ]
    .into_iter()
    .chain(functions::chart(&cells))
    .collect()
}

/// Intervals between the points of a curve.
fn last(one: &Measured) -> f64 {
    let longest = one.traces.iter().map(|trace| trace.hard.len()).max().unwrap_or(0);
    longest.saturating_sub(1).max(1) as f64
}

#[derive(Clone, Copy)]
enum Curve {
    Hard,
    Parameter,
    Lowest,
}

fn named(one: &Measured) -> Series {
    let name = one.cell.method_name();
    let dashed = one.moves();
    Series { colour: method_colour(&name), name, dashed, ..Series::default() }
}

/// Median and quartiles over the runs at every point of their curves.
fn over(one: &Measured, curve: Curve, across: impl Fn(&Measured, usize) -> f64) -> Series {
    let curves: Vec<Vec<f64>> = one
        .traces
        .iter()
        .map(|trace| match curve {
            Curve::Hard => trace.hard.clone(),
            Curve::Parameter => trace.parameter.clone(),
            Curve::Lowest => trace.lowest().collect(),
        })
        .collect();
    let longest = curves.iter().map(Vec::len).max().unwrap_or(0);
    let mut series = named(one);
    for k in 0..longest {
        let now: Vec<f64> = curves.iter().filter_map(|curve| curve.get(k).copied()).collect();
        series.points.push([across(one, k), median(&now)]);
        series.band.push([quantile(&now, 0.25), quantile(&now, 0.75)]);
    }
    series
}

/// What a method costs and gives.
struct Price {
    /// Of a run.
    seconds: f64,
    /// Hard errors of what the runs return, in the order of the seeds.
    errors: Vec<f64>,
}

/// Seconds of one cell in two comparisons differ by such a share and more.
const SCATTER: f64 = 0.1;

impl Price {
    fn of(one: &&Measured) -> Self {
        Self { seconds: one.seconds, errors: one.returned() }
    }

    fn point(&self) -> [f64; 2] {
        [self.seconds, mean(&self.errors)]
    }

    /// Whether it is at least as good as the other and clearly better in one of the two: by [`SCATTER`] of the seconds, or
    /// in the error beyond the 95 % interval of the differences.
    fn beats(&self, other: &Self) -> bool {
        let ([seconds, error], [others, others_error]) = (self.point(), other.point());
        let faster = seconds <= (1.0 - SCATTER) * others;
        let no_worse = seconds <= others && error <= others_error;
        no_worse && (faster || paired(&self.errors, &other.errors).1[1] < 0.0)
    }
}

/// Places of the methods that no other one beats, the fastest first.
fn front(prices: &[Price]) -> Vec<usize> {
    let beaten = |one: &Price| prices.iter().any(|other| other.beats(one));
    let mut front: Vec<usize> = (0..prices.len()).filter(|&k| !beaten(&prices[k])).collect();
    front.sort_by(|&a, &b| prices[a].seconds.total_cmp(&prices[b].seconds));
    front
}

fn pareto(cells: &[&Measured], stem: &str, of: &str) -> Chart {
    let prices: Vec<Price> = cells.iter().map(Price::of).collect();
    let best = front(&prices);
    let series = cells.iter().zip(&prices).enumerate().map(|(k, (one, price))| Series {
        points: vec![price.point()],
        marked: best.contains(&k),
        boxed: is_default(one),
        mark: mark(one),
        ..named(one)
    });
    let names: Vec<String> = best.iter().map(|&k| cells[k].cell.method_name()).collect();
    let default = cells.iter().position(|one| is_default(one));
    let default = default.map(|k| match best.contains(&k) {
        true => " In the box: the default of the task, which is on the front.".to_owned(),
        false => format!(
            " In the box: the default of the task, which is not on the front. Before it, with the seconds as a share \
             of its own and what the error is higher by, seed by seed: {}.",
            beaten_by(cells, &prices, k)
        ),
    });
    let elsewhere = cells.iter().any(|one| mark(one) == Mark::Square);
    let squares = if elsewhere { ", squares on another backend" } else { "" };
    Chart {
        name: format!("{stem}-pareto"),
        caption: format!(
            "{of}: error of the step that a run returns against its seconds, means over the seeds; \
             filled marks are static, open ones move; triangles are methods on half the pixels a side, crosses at \
             another tolerance{}.{} On the front, ringed and joined, is what nothing beats, being no worse in both and \
             better in one by a tenth of the seconds or beyond the 95 % interval of the error's differences: {}.",
            squares,
            default.unwrap_or_default(),
            names.join(", ")
        ),
        plot: Plot {
            x: Axis::logarithmic("seconds of optimisation in a run"),
            y: Axis::logarithmic(&format!("lowest {}", cells[0].hard.name)),
            series: series.collect(),
            front: best.iter().map(|&k| prices[k].point()).collect(),
        },
    }
}

/// What beats a method, and by how much.
fn beaten_by(cells: &[&Measured], prices: &[Price], k: usize) -> String {
    let better = cells.iter().zip(prices).filter(|(_, other)| other.beats(&prices[k]));
    let by = better.map(|(one, Price { seconds, errors })| {
        let (mean, [low, high]) = paired(errors, &prices[k].errors);
        format!(
            "{} ({:.2}; {}, 95 % interval {} to {})",
            one.cell.method_name(),
            seconds / prices[k].seconds,
            short(mean),
            short(low),
            short(high)
        )
    });
    by.collect::<Vec<_>>().join(", ")
}

/// Variations are told from the method that they vary.
fn mark(one: &Measured) -> Mark {
    let flag = |name| one.cell.purpose == Purpose::Varied && one.cell.method.contains(name);
    match (flag("--resolution"), flag("--tolerance"), flag("--backend")) {
        (true, ..) => Mark::Triangle,
        (_, true, _) => Mark::Cross,
        (_, _, true) => Mark::Square,
        _ => Mark::Dot,
    }
}

/// Whether it is what the task's program does without flags.
fn is_default(one: &Measured) -> bool {
    one.cell.method == "learned"
}

/// The share of all problems, a problem being a seed of a task in a variant, that a method solves
/// within a factor of the time of the fastest one on that problem.
pub(crate) fn profile(groups: &[Vec<&Measured>]) -> Option<Chart> {
    let mut methods: Vec<String> = Vec::new();
    for one in groups.iter().flatten().filter(|one| one.cell.purpose == Purpose::Compared) {
        let name = one.cell.method_name();
        if !methods.contains(&name) {
            methods.push(name);
        }
    }
    // Of every method: its ratios, and the problems that it was given.
    let mut ratios = vec![Vec::new(); methods.len()];
    let mut problems = 0;
    for group in groups {
        let group = || group.iter().filter(|one| one.cell.purpose == Purpose::Compared);
        let seeds = group().map(|one| one.traces.len()).min().unwrap_or(0);
        for k in 0..seeds {
            let time = |one: &&Measured| {
                let trace = &one.traces[k];
                let share = trace.reaches(TARGET * trace.hard.first()?)?;
                // A target that holds from the start takes no time: the least that is told apart.
                Some(one.seconds * share.max(1.0 / last(one)))
            };
            let times: Vec<Option<f64>> = group().map(time).collect();
            let best = times.iter().flatten().copied().fold(f64::INFINITY, f64::min);
            problems += 1;
            for (one, time) in group().zip(times) {
                let method = methods.iter().position(|name| *name == one.cell.method_name())?;
                ratios[method].extend(time.map(|time| time / best));
            }
        }
    }
    if problems == 0 {
        return None;
    }
    let widest = ratios.iter().flatten().copied().fold(2.0, f64::max) * 1.2;
    let series = methods.iter().zip(&mut ratios).map(|(name, ratios)| {
        ratios.sort_by(f64::total_cmp);
        let share = |count: usize| count as f64 / problems as f64;
        let mut points = vec![[1.0, share(0)]];
        for (k, ratio) in ratios.iter().enumerate() {
            points.extend([[*ratio, share(k)], [*ratio, share(k + 1)]]);
        }
        points.push([widest, share(ratios.len())]);
        let (dashed, colour) = (name.contains(" decay"), method_colour(name));
        Series { name: name.clone(), dashed, colour, points, ..Series::default() }
    });
    Some(Chart {
        name: "profile".to_owned(),
        caption: format!(
            "Performance profile over {problems} problems (task, variant, seed): the share of them \
             whose hard error falls to {} % of what it began with, within a factor of the time that \
             the fastest method needs there. At the left, how often a method is the fastest; at the \
             right, how often it gets there at all.",
            100.0 * TARGET
        ),
        plot: Plot {
            x: Axis::logarithmic("time, in units of the fastest method's"),
            y: Axis::linear("share of problems"),
            series: series.collect(),
            front: Vec::new(),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::{Price, front};

    #[test]
    fn the_front_holds_what_nothing_clearly_beats() {
        let price = |seconds, mean: f64, spread: f64| Price {
            seconds,
            errors: [1.0, -1.0, 0.9, -0.9].map(|x| mean + spread * x).to_vec(),
        };
        let clear = [(1.0, 5.0), (2.0, 5.0), (3.0, 1.0), (0.5, 9.0), (3.0, 2.0)];
        let mut prices: Vec<Price> = clear.map(|(seconds, mean)| price(seconds, mean, 0.0)).into();
        assert_eq!(front(&prices), [3, 0, 2]);
        // A little slower than the first, and worse by less than it scatters.
        prices.push(price(1.05, 5.1, 1.0));
        assert_eq!(front(&prices), [3, 0, 5, 2]);
    }
}
