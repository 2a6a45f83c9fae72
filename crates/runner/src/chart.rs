use std::collections::BTreeMap;

use anyhow::anyhow;
use plotters::prelude::*;

use crate::{Description, Measure, Run, quantile, task::Point};

const SIZE: (u32, u32) = (860, 620);
const IMAGE_COLOUR: RGBColor = RGBColor(31, 96, 168);
const PARAMETER_COLOUR: RGBColor = RGBColor(196, 84, 24);
const GRID: RGBColor = RGBColor(225, 228, 232);

/// Both errors over the steps as SVG: the curve of one run, or the median of several with a band
/// that holds the middle half of them.
pub(crate) fn svg(description: &Description, runs: &[Run]) -> anyhow::Result<String> {
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&WHITE).map_err(|e| anyhow!("cannot draw the chart: {e}"))?;
        let panels = root.split_evenly((2, 1));
        let measures = [
            (description.image_error, IMAGE_COLOUR, (|p| p.image_error) as fn(&Point) -> f64),
            (description.parameter_error, PARAMETER_COLOUR, |p| p.parameter_error),
        ];
        for (panel, (measure, colour, of)) in panels.iter().zip(measures) {
            draw(panel, measure, colour, &bands(runs, of))
                .map_err(|e| anyhow!("cannot draw the chart: {e}"))?;
        }
        root.present().map_err(|e| anyhow!("cannot draw the chart: {e}"))?;
    }
    Ok(text)
}

/// Lower quartile, median and upper quartile over the runs after one step.
struct Band {
    step: f64,
    low: f64,
    median: f64,
    high: f64,
}

fn bands(runs: &[Run], of: fn(&Point) -> f64) -> Vec<Band> {
    let mut steps = BTreeMap::<usize, Vec<f64>>::new();
    for point in runs.iter().flat_map(|run| &run.curve) {
        steps.entry(point.step).or_default().push(of(point));
    }
    let band = |(step, values): (usize, Vec<f64>)| Band {
        step: step as f64,
        low: quantile(&values, 0.25),
        median: quantile(&values, 0.5),
        high: quantile(&values, 0.75),
    };
    steps.into_iter().map(band).collect()
}

fn draw<DB: DrawingBackend>(
    panel: &DrawingArea<DB, plotters::coord::Shift>,
    measure: Measure,
    colour: RGBColor,
    bands: &[Band],
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    let last_step = bands.last().map_or(0.0, |band| band.step).max(1.0);
    let highest = bands.iter().map(|band| band.high).fold(0.0, f64::max);
    let lowest = bands.iter().map(|band| band.low).fold(0.0, f64::min);
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
    let above = bands.iter().map(|band| (band.step, band.high));
    let below = bands.iter().rev().map(|band| (band.step, band.low));
    chart.draw_series([Polygon::new(above.chain(below).collect::<Vec<_>>(), colour.mix(0.18))])?;
    let median = bands.iter().map(|band| (band.step, band.median));
    chart.draw_series(LineSeries::new(median, colour.stroke_width(2)))?;
    Ok(())
}

/// A number on an axis, without zeros that say nothing.
fn tick(value: f64) -> String {
    let rounded = format!("{value:.4}");
    let short = rounded.trim_end_matches('0').trim_end_matches('.');
    if value != 0.0 && (value.abs() < 1e-3 || value.abs() >= 1e5) {
        return format!("{value:.1e}");
    }
    short.to_owned()
}
