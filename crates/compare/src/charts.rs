//! Charts of speed against accuracy, per task and variant and over all of them.

use softrast_cli::{Variant, method_colour};
use softrast_lab::{
    Run, mean, median, paired,
    plot::{Axis, Mark, Plot, Series},
    quantile,
};
use softrast_raster::HostBackend;
use softrast_softness::Softness;
use softrast_tensor::{numbers, tensor, vector};

use crate::{Measured, Purpose, Variation, groups::grouped, measured::short};

/// A run is solved once its hard error has fallen to this share of its initial value. Chosen before any measurement.
const TARGET: f64 = 0.1;
/// Relative difference of a cell's seconds between two comparisons; it may be larger.
const SCATTER: f64 = 0.1;
/// Largest distance from the edge in the charts of soft steps, in pixels, and number of points on either side.
const REACH_PX: f64 = 1.0;
const HALF: i32 = 120;

/// A chart with its file name and caption.
pub(crate) struct Chart {
    pub(crate) name: String,
    pub(crate) caption: String,
    pub(crate) plot: Plot,
}

/// All charts of a comparison.
pub(crate) struct Charts {
    /// Charts per task and variant, in the order of [`by_variant`].
    pub(crate) of_variants: Vec<Vec<Chart>>,
    /// Performance profile over all tasks and variants.
    pub(crate) profile: Option<Chart>,
}

impl Charts {
    pub(crate) fn new(groups: &[Vec<&Measured>]) -> Self {
        let of_variants = groups.iter().map(|group| of_variant(group)).collect();
        Self { of_variants, profile: profile(groups) }
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Chart> {
        self.of_variants.iter().flatten().chain(&self.profile)
    }
}

/// Cells per task and variant, in the order of the tables, without those only in Table 6.
pub(crate) fn by_variant(measured: &[Measured]) -> Vec<Vec<&Measured>> {
    grouped(measured, |one| {
        let shown = !matches!(one.cell.purpose, Purpose::Crossed(_));
        shown.then_some((one.cell.task.name(), one.cell.variant == Variant::Original))
    })
}

fn named(one: &Measured) -> Series {
    let (name, colour) = (one.cell.name.clone(), method_colour(&one.cell.name));
    Series { name, colour, dashed: one.moves(), ..Series::default() }
}

/// The charts of the cells of one task in one variant.
fn of_variant(all: &[&Measured]) -> Vec<Chart> {
    let cells: Vec<&Measured> =
        all.iter().filter(|one| one.cell.purpose == Purpose::Compared).copied().collect();
    let Some(first) = cells.first() else { return Vec::new() };
    let variant = first.cell.variant.name();
    let stem = format!("{}-{variant}", first.cell.task.name());
    let of = format!("{}, {variant}", first.cell.task.title());
    let (hard, runs) = (first.hard_place(), first.cell.runs);
    let (hard_title, parameter) = (first.title(hard), place_of(first, "parameter_error"));
    let over_steps = |place: usize, name: &str, caption: String| Chart {
        name: format!("{stem}-{name}"),
        caption,
        plot: Plot {
            series: cells.iter().map(|one| over(one, place, false)).collect(),
            ..Plot::new(Axis::linear("step"), Axis::logarithmic(&first.title(place)))
        },
    };
    let quartiles = format!("median of {runs} seeds and, shaded, the middle half of them");
    let anytime = Plot::new(
        Axis::logarithmic("seconds of optimisation in a run"),
        Axis::logarithmic(&format!("lowest {hard_title} so far")),
    );
    let mut charts = vec![
        over_steps(hard, "steps", format!("{of}: {hard_title} over the steps, {quartiles}.")),
        over_steps(
            parameter,
            "parameters",
            format!("{of}: {} over the steps, drawn likewise.", first.title(parameter)),
        ),
        Chart {
            name: format!("{stem}-anytime"),
            caption: format!(
                "{of}: the lowest {hard_title} that a run has reached by a time, {quartiles}. The method that is lowest at a time is \
                 the one to stop there with."
            ),
            plot: Plot {
                series: cells.iter().map(|one| over(one, hard, true)).collect(),
                ..anytime
            },
        },
        pareto(all, &stem, &of),
    ];
    // Edges that do not move are so sharp that all curves would be one step.
    charts.extend(first.cell.task.moves_edges().then(|| functions(&cells, &stem, &of)));
    charts
}

fn place_of(one: &Measured, key: &str) -> usize {
    one.metrics().iter().position(|metric| metric.key == key).unwrap_or(one.hard_place())
}

/// Intervals between the points of a curve.
fn intervals(one: &Measured) -> f64 {
    let longest = one.runs.iter().map(|run| run.curve.len()).max().unwrap_or(0);
    longest.saturating_sub(1).max(1) as f64
}

/// A metric of a run over its steps; with `lowest` the lowest so far.
fn trace(run: &Run, place: usize, lowest: bool) -> Vec<f64> {
    let mut least = f64::INFINITY;
    let value = |point: &softrast_lab::Point| {
        least = least.min(point.values[place]);
        if lowest { least } else { point.values[place] }
    };
    run.curve.iter().map(value).collect()
}

/// Median and quartiles over the runs at every point of their curves: of the metric over the steps, or of its lowest value over seconds.
fn over(one: &Measured, place: usize, anytime: bool) -> Series {
    let curves: Vec<Vec<f64>> = one.runs.iter().map(|run| trace(run, place, anytime)).collect();
    let whole = if anytime { one.seconds } else { one.entry.solve.steps as f64 };
    let mut series = named(one);
    for k in 0..curves.iter().map(Vec::len).max().unwrap_or(0) {
        let now: Vec<f64> = curves.iter().filter_map(|curve| curve.get(k).copied()).collect();
        series.points.push([k as f64 * whole / intervals(one), median(&now)]);
        series.band.push([quantile(&now, 0.25), quantile(&now, 0.75)]);
    }
    series
}

/// Cost and errors of a method.
struct Price {
    /// Seconds per run.
    seconds: f64,
    /// Hard errors of the returned steps, in the order of the seeds.
    errors: Vec<f64>,
}

impl Price {
    fn point(&self) -> [f64; 2] {
        [self.seconds, mean(&self.errors)]
    }

    /// Whether this method is no worse in seconds and error, and significantly better in one: by [`SCATTER`] of the seconds, or beyond the
    /// 95 % interval of the error differences.
    fn beats(&self, other: &Self) -> bool {
        let ([seconds, error], [others, others_error]) = (self.point(), other.point());
        let faster = seconds <= (1.0 - SCATTER) * others;
        let no_worse = seconds <= others && error <= others_error;
        no_worse && (faster || paired(&self.errors, &other.errors).1[1] < 0.0)
    }
}

/// Indices of the methods that no other one beats, fastest first.
fn front(prices: &[Price]) -> Vec<usize> {
    let beaten = |one: &Price| prices.iter().any(|other| other.beats(one));
    let mut front: Vec<usize> = (0..prices.len()).filter(|&k| !beaten(&prices[k])).collect();
    front.sort_by(|&a, &b| prices[a].seconds.total_cmp(&prices[b].seconds));
    front
}

fn pareto(cells: &[&Measured], stem: &str, of: &str) -> Chart {
    let price = |one: &&Measured| Price { seconds: one.seconds, errors: one.returned() };
    let prices: Vec<Price> = cells.iter().map(price).collect();
    let best = front(&prices);
    let series = cells.iter().zip(&prices).enumerate().map(|(k, (one, price))| Series {
        points: vec![price.point()],
        marked: best.contains(&k),
        boxed: one.cell.is_default(),
        mark: mark(one),
        ..named(one)
    });
    let names: Vec<&str> = best.iter().map(|&k| cells[k].cell.name.as_str()).collect();
    let default = cells.iter().position(|one| one.cell.is_default());
    let default = default.map(|k| match best.contains(&k) {
        true => " In the box: the default of the task, which is on the front.".to_owned(),
        false => format!(
            " In the box: the default of the task, which is not on the front. Before it, with the seconds as a share of its own and \
             what the error is higher by, seed by seed: {}.",
            beaten_by(cells, &prices, k)
        ),
    });
    let elsewhere = cells.iter().any(|one| mark(one) == Mark::Square);
    let squares = if elsewhere { ", squares on another backend" } else { "" };
    let first = cells[0];
    let axes = Plot::new(
        Axis::logarithmic("seconds of optimisation in a run"),
        Axis::logarithmic(&format!("lowest {}", first.title(first.hard_place()))),
    );
    Chart {
        name: format!("{stem}-pareto"),
        caption: format!(
            "{of}: error of the step that a run returns against its seconds, means over the seeds; filled marks are static, open ones \
             move; triangles are methods on half the pixels a side, crosses at another tolerance{squares}.{} On the front, ringed and \
             joined, is what nothing beats, being no worse in both and better in one by a tenth of the seconds or beyond the 95 % \
             interval of the error's differences: {}.",
            default.unwrap_or_default(),
            names.join(", ")
        ),
        plot: Plot {
            series: series.collect(),
            front: best.iter().map(|&k| prices[k].point()).collect(),
            ..axes
        },
    }
}

/// The methods that beat method `k`, and by how much.
fn beaten_by(cells: &[&Measured], prices: &[Price], k: usize) -> String {
    let better = cells.iter().zip(prices).filter(|(_, other)| other.beats(&prices[k]));
    let by = better.map(|(one, Price { seconds, errors })| {
        let (mean, [low, high]) = paired(errors, &prices[k].errors);
        let [mean, low, high] = [mean, low, high].map(short);
        let share = seconds / prices[k].seconds;
        format!("{} ({share:.2}; {mean}, 95 % interval {low} to {high})", one.cell.name)
    });
    by.collect::<Vec<_>>().join(", ")
}

/// The mark of a method; it distinguishes variations from the method that they vary.
fn mark(one: &Measured) -> Mark {
    match one.cell.purpose {
        Purpose::Varied(Variation::Resolution) => Mark::Triangle,
        Purpose::Varied(Variation::Tolerance) => Mark::Cross,
        Purpose::Varied(Variation::Backend) => Mark::Square,
        Purpose::Compared | Purpose::Crossed(_) => Mark::Dot,
    }
}

/// The soft step of each method at an edge, at the last step of a run (Fig. 3 of the paper).
fn functions(cells: &[&Measured], stem: &str, of: &str) -> Chart {
    let series = cells.iter().map(|one| {
        let (method, size) = (&one.entry.method.softness, one.entry.solve.size);
        let offset = |k: i32| REACH_PX * f64::from(k) / f64::from(HALF);
        let offsets: Vec<f64> = (-HALF..=HALF).map(offset).collect();
        let distances: Vec<f64> = offsets.iter().map(|offset| offset * 2.0 / size as f64).collect();
        let count = distances.len();
        let phi = vector::<HostBackend>(&method.phi_at(1.0, size));
        let covered = numbers(method.softness.value(phi, tensor(distances, [count])));
        let points = offsets.into_iter().zip(covered).map(|(x, y)| [x, y]).collect();
        Series { points, ..named(one) }
    });
    let axes = Plot::new(Axis::linear("signed distance (pixels)"), Axis::linear("coverage"));
    Chart {
        name: format!("{stem}-functions"),
        caption: format!(
            "{of}: how much a face covers a pixel by its distance from the nearest edge, inside being positive, with the parameters of \
             the last step. What was searched for and what was learned are drawn alike."
        ),
        plot: Plot { series: series.collect(), ..axes },
    }
}

/// Performance profile: the share of problems (task, variant, seed) that a method solves within a factor of the fastest method's time
/// there.
fn profile(groups: &[Vec<&Measured>]) -> Option<Chart> {
    let compared = |group: &'_ [&'_ Measured]| -> Vec<usize> {
        let kept = |k: &usize| group[*k].cell.purpose == Purpose::Compared;
        (0..group.len()).filter(kept).collect()
    };
    let mut methods: Vec<Series> = Vec::new();
    // Time ratios per method.
    let mut ratios: Vec<Vec<f64>> = Vec::new();
    let mut problems = 0;
    for group in groups {
        let cells: Vec<&Measured> = compared(group).into_iter().map(|k| group[k]).collect();
        let seeds = cells.iter().map(|one| one.runs.len()).min().unwrap_or(0);
        problems += seeds;
        let times: Vec<Vec<Option<f64>>> = (0..seeds)
            .map(|k| cells.iter().map(|one| seconds_to_target(one, k)).collect())
            .collect();
        for (place, one) in cells.iter().enumerate() {
            let method = methods.iter().position(|series| series.name == one.cell.name);
            let method = method.unwrap_or_else(|| {
                methods.push(named(one));
                ratios.push(Vec::new());
                methods.len() - 1
            });
            for times in &times {
                let best = times.iter().flatten().copied().fold(f64::INFINITY, f64::min);
                ratios[method].extend(times[place].map(|time| time / best));
            }
        }
    }
    let widest = ratios.iter().flatten().copied().fold(2.0, f64::max) * 1.2;
    let share = |count: usize| count as f64 / problems as f64;
    for (series, ratios) in methods.iter_mut().zip(&mut ratios) {
        ratios.sort_by(f64::total_cmp);
        series.points.push([1.0, share(0)]);
        for (k, ratio) in ratios.iter().enumerate() {
            series.points.extend([[*ratio, share(k)], [*ratio, share(k + 1)]]);
        }
        series.points.push([widest, share(ratios.len())]);
    }
    let axes = Plot::new(
        Axis::logarithmic("time, in units of the fastest method's"),
        Axis::linear("share of problems"),
    );
    (problems > 0).then(|| Chart {
        name: "profile".to_owned(),
        caption: format!(
            "Performance profile over {problems} problems (task, variant, seed): the share of them whose hard error falls to {} % of \
             what it began with, within a factor of the time that the fastest method needs there. At the left, how often a method is \
             the fastest; at the right, how often it gets there at all.",
            100.0 * TARGET
        ),
        plot: Plot { series: methods, ..axes },
    })
}

/// Seconds until a run's hard error has fallen to the target; none if it never does.
fn seconds_to_target(one: &Measured, run: usize) -> Option<f64> {
    let hard = trace(&one.runs[run], one.hard_place(), false);
    let target = TARGET * hard.first()?;
    let step = hard.iter().position(|error| *error <= target)?;
    // A target that holds from the start counts as one interval, the shortest resolvable time.
    Some(one.seconds * (step.max(1) as f64 / intervals(one)))
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
        // A little slower than the first, and worse by less than its noise.
        prices.push(price(1.05, 5.1, 1.0));
        assert_eq!(front(&prices), [3, 0, 5, 2]);
    }
}
