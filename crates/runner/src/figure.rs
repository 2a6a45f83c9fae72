use anyhow::anyhow;
use plotters::prelude::*;

use crate::{Figure, Ticks, chart::tick, study::Curve};

const SIZE: (u32, u32) = (860, 380);
const COLOURS: [RGBColor; 8] = [
    RGBColor(130, 138, 148),
    RGBColor(31, 96, 168),
    RGBColor(196, 84, 24),
    RGBColor(46, 139, 87),
    RGBColor(128, 62, 158),
    RGBColor(180, 140, 20),
    RGBColor(86, 180, 233),
    RGBColor(40, 40, 40),
];
const GRID: RGBColor = RGBColor(225, 228, 232);
const LIGHT: RGBColor = RGBColor(243, 244, 246);

impl Figure {
    /// The curves as SVG.
    ///
    /// # Errors
    ///
    /// If the chart cannot be drawn.
    pub fn svg(&self) -> anyhow::Result<String> {
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
            let drawn = root.fill(&WHITE).and_then(|()| draw(&root, self));
            let drawn = drawn.and_then(|()| root.present());
            drawn.map_err(|e| anyhow!("cannot draw the chart: {e}"))?;
        }
        Ok(text)
    }
}

fn draw<DB: DrawingBackend>(
    root: &DrawingArea<DB, plotters::coord::Shift>,
    figure: &Figure,
) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    let place = |axis: usize, z: f64| if figure.logarithmic[axis] { z.log10() } else { z };
    let value = |axis: usize, z: f64| if figure.logarithmic[axis] { 10f64.powf(z) } else { z };
    let points = |curve: &Curve| -> Vec<(f64, f64)> {
        let points = curve.points.iter().map(|&[x, y]| (place(0, x), place(1, y)));
        points.filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
    };
    let lines: Vec<_> = figure.curves.iter().map(|curve| (&curve.name, points(curve))).collect();
    let all = || lines.iter().flat_map(|(_, points)| points);
    let [across, up] = [extent(all().map(|p| p.0), 0.0), extent(all().map(|p| p.1), 0.06)];
    let [x, y] = [(across, 0, 10), (up, 1, 6)].map(|(ends, axis, most): (_, usize, _)| {
        let range = ends[0]..ends[1];
        Ticks::new(range.clone(), figure.logarithmic[axis], most).on(range)
    });
    let mut chart = ChartBuilder::on(root)
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(78)
        .build_cartesian_2d(x, y)?;
    chart
        .configure_mesh()
        .x_desc(&figure.axes[0])
        .y_desc(&figure.axes[1])
        .x_label_formatter(&|x| tick(value(0, *x)))
        .y_label_formatter(&|y| tick(value(1, *y)))
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 15))
        .bold_line_style(GRID)
        .light_line_style(LIGHT)
        .draw()?;
    let corner = corner(&lines, across, up);
    for ((name, points), colour) in lines.into_iter().zip(COLOURS) {
        // A single point would not be seen as a line.
        if let [point] = points[..] {
            chart.draw_series([Circle::new(point, 3, colour.filled())])?;
        }
        chart
            .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(3)));
    }
    chart
        .configure_series_labels()
        .position(corner)
        .label_font(("sans-serif", 14))
        .background_style(WHITE.mix(0.85))
        .border_style(GRID)
        .draw()
}

/// A corner on the right that the lines leave free.
fn corner(
    lines: &[(&String, Vec<(f64, f64)>)],
    across: [f64; 2],
    up: [f64; 2],
) -> SeriesLabelPosition {
    let right = across[0] + 0.7 * (across[1] - across[0]);
    let ends = lines.iter().flat_map(|(_, points)| points).filter(|(x, _)| *x > right);
    let [high, low] = ends.fold([0, 0], |[high, low], (_, y)| {
        if *y > 0.5 * (up[0] + up[1]) { [high + 1, low] } else { [high, low + 1] }
    });
    if high > low { SeriesLabelPosition::LowerRight } else { SeriesLabelPosition::UpperRight }
}

/// Least and largest number with some room around them; 0 to 1 for none.
fn extent(numbers: impl Iterator<Item = f64> + Clone, room: f64) -> [f64; 2] {
    let (low, high) = (numbers.clone().reduce(f64::min), numbers.reduce(f64::max));
    let (Some(low), Some(high)) = (low, high) else { return [0.0, 1.0] };
    let size = high - low;
    if size <= 0.0 {
        let around = 0.1 * low.abs().max(1e-9);
        return [low - around, high + around];
    }
    [low - room * size, high + room * size]
}
