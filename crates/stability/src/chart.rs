use anyhow::anyhow;
use plotters::prelude::*;

use crate::{Outcome, Row};

/// Colours of the methods, the same in every chart; told apart also by those who see no red.
const COLOURS: [RGBColor; 6] = [
    RGBColor(31, 96, 168),
    RGBColor(86, 180, 233),
    RGBColor(0, 140, 100),
    RGBColor(204, 121, 167),
    RGBColor(196, 84, 24),
    RGBColor(40, 40, 40),
];
const GRID: RGBColor = RGBColor(225, 228, 232);
const SIZE: (u32, u32) = (860, 300);

/// The share of trials that reach the target over the levels of a case, one line for each method.
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

fn draw<DB: DrawingBackend>(
    root: &DrawingArea<DB, plotters::coord::Shift>,
    row: &Row,
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    root.fill(&WHITE)?;
    let levels: Vec<f64> = row.outcomes[0].levels.iter().filter_map(|level| level.at).collect();
    // Decades where the levels span them; otherwise the numbers themselves.
    let (least, most) = levels.iter().fold((f64::MAX, f64::MIN), |(a, b), &x| (a.min(x), b.max(x)));
    let decades = least > 0.0 && most > 20.0 * least;
    let place = move |x: f64| if decades { x.log10() } else { x };
    let margin = 0.02 * (place(most) - place(least));
    let mut chart = ChartBuilder::on(root)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(62)
        .right_y_label_area_size(100)
        .build_cartesian_2d(place(least) - margin..place(most) + margin, -0.03..1.03)?;
    chart
        .configure_mesh()
        .x_desc(row.perturbation)
        .y_desc("share")
        .y_labels(5)
        .x_label_formatter(&|x| label(*x, decades))
        .y_label_formatter(&|share| format!("{:.0} %", 100.0 * share))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 14))
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (k, (outcome, colour)) in row.outcomes.iter().zip(COLOURS).enumerate() {
        // Lines that coincide lie a hair apart.
        let shift = 0.008 * (k as f64 - 2.5);
        let at = |of: fn(&crate::LevelOutcome) -> f64| -> Vec<(f64, f64)> {
            let points = outcome.levels.iter().filter_map(|l| l.at.map(|x| (place(x), of(l))));
            points.collect()
        };
        let low = at(|level| level.ci95[0]);
        let high = at(|level| level.ci95[1]);
        let band: Vec<_> = high.iter().chain(low.iter().rev()).copied().collect();
        chart.draw_series([Polygon::new(band, colour.mix(0.05))])?;
        let shares = at(|level| level.reached as f64 / level.trials.max(1) as f64);
        let line: Vec<_> = shares.iter().map(|&(x, y)| (x, y + shift)).collect();
        chart
            .draw_series(LineSeries::new(line.clone(), colour.stroke_width(2)))?
            .label(outcome.method)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        chart.draw_series(line.into_iter().map(|at| Circle::new(at, 3, colour.filled())))?;
    }
    legend(root, &row.outcomes)
}

/// Names in the colours of their lines, to the right of the chart.
fn legend<DB: DrawingBackend>(
    root: &DrawingArea<DB, plotters::coord::Shift>,
    outcomes: &[Outcome],
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    for (k, (outcome, colour)) in outcomes.iter().zip(COLOURS).enumerate() {
        let (x, y) = (SIZE.0 as i32 - 96, 22 + 20 * k as i32);
        root.draw(&PathElement::new([(x, y + 7), (x + 18, y + 7)], colour.stroke_width(3)))?;
        let style = ("sans-serif", 14).into_font().color(&BLACK);
        root.draw(&Text::new(outcome.method, (x + 24, y), style))?;
    }
    Ok(())
}

fn label(x: f64, decades: bool) -> String {
    if decades {
        let value = 10f64.powf(x);
        return match value {
            0.01..1e4 => format!("{value:.2}").trim_end_matches('0').trim_end_matches('.').into(),
            _ => format!("{value:.0e}"),
        };
    }
    format!("{x:.2}").trim_end_matches('0').trim_end_matches('.').to_owned()
}
