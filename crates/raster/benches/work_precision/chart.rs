//! Panels with logarithmic axes, side by side.

use std::{error::Error, fs, path::Path};

use plotters::prelude::*;

const PANEL: (u32, u32) = (560, 430);
const TITLE_HEIGHT: u32 = 44;
const LEGEND_LINE: u32 = 26;
const GRID: RGBColor = RGBColor(225, 228, 232);
const INK: RGBColor = RGBColor(60, 64, 70);
const COLOURS: [RGBColor; 4] =
    [RGBColor(31, 96, 168), RGBColor(34, 139, 84), RGBColor(196, 84, 24), RGBColor(128, 84, 160)];

/// One pair of axes.
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) x: String,
    pub(crate) y: String,
    pub(crate) series: Vec<Series>,
}

/// Points of one method; the n-th series has the same colour in every panel.
pub(crate) struct Series {
    name: String,
    points: Vec<(f64, f64)>,
    guide: bool,
}

impl Series {
    /// Measured points with lines between them.
    pub(crate) fn new(name: &str, points: &[(f64, f64)]) -> Self {
        Self { name: name.to_owned(), points: points.to_vec(), guide: false }
    }

    /// A thin gray line to compare with.
    pub(crate) fn line(name: &str, points: &[(f64, f64)]) -> Self {
        Self { guide: true, ..Self::new(name, points) }
    }

    fn colour(&self, index: usize) -> RGBColor {
        if self.guide { RGBColor(150, 150, 150) } else { COLOURS[index] }
    }
}

/// Draws the panels in rows of `columns`, under a title and above one legend for all.
pub(crate) fn write(
    path: &Path,
    title: &str,
    panels: &[Panel],
    columns: usize,
) -> Result<(), Box<dyn Error>> {
    let rows = panels.len().div_ceil(columns);
    let legend = LEGEND_LINE * panels[0].series.len() as u32 + 16;
    let size = (PANEL.0 * columns as u32, TITLE_HEIGHT + PANEL.1 * rows as u32 + legend);
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE)?;
        let style = ("sans-serif", 20).into_font().color(&INK);
        root.draw(&Text::new(title.to_owned(), (24, 16), style))?;
        let (_, rest) = root.split_vertically(TITLE_HEIGHT);
        let (areas, below) = rest.split_vertically(PANEL.1 * rows as u32);
        for (area, panel) in areas.split_evenly((rows, columns)).iter().zip(panels) {
            draw(area, panel)?;
        }
        for (k, series) in panels[0].series.iter().enumerate() {
            let (y, colour) = ((LEGEND_LINE * k as u32 + 14) as i32, series.colour(k));
            below.draw(&PathElement::new(vec![(84, y), (120, y)], colour.stroke_width(2)))?;
            if !series.guide {
                below.draw(&Circle::new((102, y), 4, colour.filled()))?;
            }
            let style = ("sans-serif", 15).into_font().color(&INK);
            below.draw(&Text::new(series.name.clone(), (132, y - 8), style))?;
        }
        root.present()?;
    }
    Ok(fs::write(path, text)?)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

fn draw(area: &Area, panel: &Panel) -> Result<(), Box<dyn Error>> {
    let measured = || panel.series.iter().flat_map(|series| &series.points);
    let x = range(measured().map(|p| p.0));
    let y = range(measured().map(|p| p.1));
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, ("sans-serif", 17).into_font().color(&INK))
        .margin(14)
        .x_label_area_size(50)
        .y_label_area_size(70)
        .build_cartesian_2d((x.0..x.1).log_scale(), (y.0..y.1).log_scale())?;
    chart
        .configure_mesh()
        .x_desc(&panel.x)
        .y_desc(&panel.y)
        .x_labels(8)
        .y_labels(8)
        .x_label_formatter(&|x| tick(*x))
        .y_label_formatter(&|y| tick(*y))
        .label_style(("sans-serif", 14).into_font().color(&INK))
        .axis_desc_style(("sans-serif", 15).into_font().color(&INK))
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (k, series) in panel.series.iter().enumerate() {
        let colour = series.colour(k);
        let width = if series.guide { 1 } else { 2 };
        let line = LineSeries::new(series.points.iter().copied(), colour.stroke_width(width));
        chart.draw_series(line)?;
        if !series.guide {
            let dots = series.points.iter().map(|&p| Circle::new(p, 4, colour.filled()));
            chart.draw_series(dots)?;
        }
    }
    Ok(())
}

/// The whole decades that hold all numbers.
fn range(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    let start = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = numbers.fold(start, |(low, high), x| (low.min(x), high.max(x)));
    (10f64.powf(low.log10().floor()), 10f64.powf(high.log10().ceil()))
}

/// A number on an axis, without zeros that nobody counts.
fn tick(value: f64) -> String {
    // Powers of ten are a little off.
    let value = format!("{value:.6e}").parse().unwrap_or(value);
    if (0.01..20_000.0).contains(&value) { format!("{value}") } else { format!("{value:.0e}") }
}
