use anyhow::anyhow;
use plotters::prelude::*;

use crate::{
    Description, Measure,
    convergence::{Convergence, Spread},
    quantity::Quantity,
};

const WIDTH: u32 = 860;
const PANEL_HEIGHT: u32 = 310;
/// Of the first method and of the one it is compared with.
const COLOURS: [RGBColor; 2] = [RGBColor(31, 96, 168), RGBColor(196, 84, 24)];
const GRID: RGBColor = RGBColor(225, 228, 232);

/// The quantities over the steps as SVG, one panel each: for every method a line, and around the
/// mean of several runs a band that is its interval.
///
/// # Errors
///
/// If the chart cannot be drawn.
pub(crate) fn svg(
    description: &Description,
    quantities: &[Quantity],
    methods: &[Convergence],
) -> anyhow::Result<String> {
    let mut text = String::new();
    let all = Quantity::all(description);
    {
        let size = (WIDTH, PANEL_HEIGHT * quantities.len() as u32);
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE).map_err(|e| anyhow!("cannot draw the chart: {e}"))?;
        let panels = root.split_evenly((quantities.len(), 1));
        for (panel, quantity) in panels.iter().zip(quantities) {
            let place = all.iter().position(|other| other == quantity).unwrap_or_default();
            let lines: Vec<Line> = methods.iter().map(|method| line(method, place)).collect();
            draw(panel, quantity.measure(description), &lines)
                .map_err(|e| anyhow!("cannot draw the chart: {e}"))?;
        }
        root.present().map_err(|e| anyhow!("cannot draw the chart: {e}"))?;
    }
    Ok(text)
}

/// Steps, and mean and interval after each.
type Line = Vec<(f64, Spread)>;

fn line(method: &Convergence, place: usize) -> Line {
    method.rows.iter().map(|row| (row.step as f64, row.spreads[place])).collect()
}

fn draw<DB: DrawingBackend>(
    panel: &DrawingArea<DB, plotters::coord::Shift>,
    measure: Measure,
    lines: &[Line],
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    let points = || lines.iter().flatten();
    let last_step = points().map(|(step, _)| *step).fold(1.0, f64::max);
    let highest = points().map(|(_, spread)| spread.high).fold(0.0, f64::max);
    let lowest = points().map(|(_, spread)| spread.low).fold(0.0, f64::min);
    let room = if highest > lowest { (highest - lowest) * 0.06 } else { 1.0 };
    let mut chart = ChartBuilder::on(panel)
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(78)
        .build_cartesian_2d(0.0..last_step, lowest..highest + room)?;
    chart
        .configure_mesh()
        .x_desc("step")
        .y_desc(measure.title())
        .y_labels(6)
        .x_label_formatter(&|step| format!("{step:.0}"))
        .y_label_formatter(&|value| tick(*value))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 15))
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (line, colour) in lines.iter().zip(COLOURS) {
        let above = line.iter().map(|(step, spread)| (*step, spread.high));
        let below = line.iter().rev().map(|(step, spread)| (*step, spread.low));
        let band: Vec<_> = above.chain(below).collect();
        chart.draw_series([Polygon::new(band, colour.mix(0.18))])?;
        let mean = line.iter().map(|(step, spread)| (*step, spread.mean));
        chart.draw_series(LineSeries::new(mean, colour.stroke_width(2)))?;
    }
    Ok(())
}

/// A number on an axis, without zeros that say nothing.
pub(crate) fn tick(value: f64) -> String {
    let rounded = format!("{value:.4}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if value != 0.0 && (value.abs() < 1e-3 || value.abs() >= 1e5) {
        return format!("{value:.1e}");
    }
    short.to_owned()
}
