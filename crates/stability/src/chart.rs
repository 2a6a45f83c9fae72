use anyhow::anyhow;
use plotters::prelude::*;
use softrast_runner::method_colour;

use crate::{LevelOutcome, Outcome, Row};

const GRID: RGBColor = RGBColor(225, 228, 232);
const SIZE: (u32, u32) = (860, 300);
/// Room for the names of the methods.
const LEGEND: i32 = 110;
/// Smaller measured numbers are drawn as this one.
const LEAST: f64 = 1e-9;

/// Whether a chart of this case shows shares; with one trial at a level it shows the measured numbers.
pub(crate) fn shows_shares(row: &Row) -> bool {
    row.outcomes.iter().flat_map(|outcome| &outcome.levels).any(|level| level.trials > 1)
}

/// What happens over the levels of a case, one line for each method: the share of trials that reach
/// the target with its interval, or the number that is measured.
///
/// # Errors
///
/// If it cannot be drawn.
pub(crate) fn svg(row: &Row) -> anyhow::Result<String> {
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        draw(&root, row).map_err(|e| anyhow!("cannot draw the chart of {}: {e}", row.id))?;
        root.present().map_err(|e| anyhow!("cannot draw the chart of {}: {e}", row.id))?;
    }
    Ok(text)
}

/// An axis, in decades where its numbers span some.
#[derive(Clone, Copy)]
struct Axis {
    decades: bool,
    range: [f64; 2],
}

impl Axis {
    fn of(numbers: impl Iterator<Item = f64> + Clone) -> Self {
        let least = numbers.clone().fold(f64::INFINITY, f64::min);
        let most = numbers.fold(f64::NEG_INFINITY, f64::max);
        let decades = least > 0.0 && most > 20.0 * least;
        let place = |x: f64| if decades { x.log10() } else { x };
        let margin = (0.04 * (place(most) - place(least))).max(1e-3);
        Self { decades, range: [place(least) - margin, place(most) + margin] }
    }

    fn place(self, x: f64) -> f64 {
        if self.decades { x.log10() } else { x }
    }

    fn label(self, place: f64) -> String {
        let value = if self.decades { 10f64.powf(place) } else { place };
        match value.abs() {
            0.01..1e4 => format!("{value:.2}").trim_end_matches('0').trim_end_matches('.').into(),
            0.0 => "0".into(),
            _ => format!("{value:.0e}"),
        }
    }
}

/// Level, share or number, and the ends of its interval.
type Line = Vec<[f64; 4]>;

fn line(outcome: &Outcome, shares: bool) -> Line {
    let point = |level: &LevelOutcome| {
        let at = level.at?;
        if shares {
            let [low, high] = level.ci95;
            return Some([at, level.reached as f64 / level.trials.max(1) as f64, low, high]);
        }
        let value = level.worst?.max(LEAST);
        Some([at, value, value, value])
    };
    outcome.levels.iter().filter_map(point).collect()
}

fn draw<DB: DrawingBackend>(
    root: &DrawingArea<DB, plotters::coord::Shift>,
    row: &Row,
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    root.fill(&WHITE)?;
    let shares = shows_shares(row);
    let lines: Vec<Line> = row.outcomes.iter().map(|outcome| line(outcome, shares)).collect();
    let points = || lines.iter().flatten();
    let across = Axis::of(points().map(|point| point[0]));
    let up = match shares {
        true => Axis { decades: false, range: [-0.04, 1.04] },
        false => Axis::of(points().map(|point| point[1])),
    };
    let [left, right] = across.range;
    let [bottom, top] = up.range;
    let mut chart = ChartBuilder::on(root)
        .margin(12)
        .margin_right(LEGEND)
        .x_label_area_size(44)
        .y_label_area_size(70)
        .build_cartesian_2d(left..right, bottom..top)?;
    chart
        .configure_mesh()
        .x_desc(row.perturbation)
        .y_desc(if shares { "share of trials" } else { "measured" })
        .y_labels(5)
        .x_label_formatter(&|x| across.label(*x))
        .y_label_formatter(&|y| match shares {
            true => format!("{:.0} %", 100.0 * y),
            false => up.label(*y),
        })
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 14))
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (k, (outcome, line)) in row.outcomes.iter().zip(&lines).enumerate() {
        let colour = colour(outcome.method);
        // Shares that coincide lie a hair apart.
        let shift = if shares { 0.008 * (k as f64 - 2.5) } else { 0.0 };
        let place = |x: f64, y: f64| (across.place(x), up.place(y));
        let high = line.iter().map(|&[x, _, _, high]| place(x, high));
        let low = line.iter().rev().map(|&[x, _, low, _]| place(x, low));
        chart.draw_series([Polygon::new(high.chain(low).collect::<Vec<_>>(), colour.mix(0.05))])?;
        let middle: Vec<_> =
            line.iter().map(|&[x, y, ..]| place(x, y)).map(|(x, y)| (x, y + shift)).collect();
        chart.draw_series(LineSeries::new(middle.clone(), colour.stroke_width(2)))?;
        chart.draw_series(middle.into_iter().map(|at| Circle::new(at, 3, colour.filled())))?;
        let (x, y) = (SIZE.0 as i32 - LEGEND + 10, 16 + 20 * k as i32);
        root.draw(&PathElement::new([(x, y + 7), (x + 18, y + 7)], colour.stroke_width(3)))?;
        let style = ("sans-serif", 14).into_font().color(&BLACK);
        root.draw(&Text::new(outcome.method, (x + 24, y), style))?;
    }
    Ok(())
}

fn colour(method: &str) -> RGBColor {
    let [r, g, b] = method_colour(method);
    RGBColor(r, g, b)
}
