use anyhow::anyhow;
use plotters::prelude::*;

const SIZE: (u32, u32) = (860, 330);
const GRID: RGBColor = RGBColor(225, 228, 232);
/// Of the line that matters most, then of all others in turn.
const COLOURS: [RGBColor; 7] = [
    RGBColor(31, 96, 168),
    RGBColor(196, 84, 24),
    RGBColor(46, 139, 87),
    RGBColor(148, 82, 165),
    RGBColor(180, 140, 20),
    RGBColor(90, 90, 90),
    RGBColor(200, 70, 120),
];

/// A line of a chart: its name, its points, and whether it is one among many.
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
    pub(crate) thin: bool,
}

/// Lines over the epochs as SVG, with their names; the y axis begins at 0.
///
/// # Errors
///
/// If the chart cannot be drawn.
pub(crate) fn svg(title: &str, lines: &[Line]) -> anyhow::Result<String> {
    let mut text = String::new();
    draw(&mut text, title, lines).map_err(|e| anyhow!("cannot draw the chart: {e}"))?;
    Ok(text)
}

fn draw(
    text: &mut String,
    title: &str,
    lines: &[Line],
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let points = || lines.iter().flat_map(|line| &line.points);
    let last = points().map(|p| p.0).fold(1.0, f64::max);
    // The names stand to the right of all lines.
    let room = if lines.len() > 1 { 1.22 } else { 1.0 };
    let highest = points().map(|p| p.1).filter(|y| y.is_finite()).fold(1e-3, f64::max);
    let mut chart = ChartBuilder::on(&root)
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(70)
        .build_cartesian_2d(0.0..last * room, 0.0..highest * 1.05)?;
    chart
        .configure_mesh()
        .x_desc("epoch")
        .y_desc(title)
        .y_labels(6)
        .x_labels(8)
        .x_label_formatter(&|&epoch| {
            let whole = (epoch - epoch.round()).abs() < 1e-6 && epoch <= last;
            if whole { format!("{epoch:.0}") } else { String::new() }
        })
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 15))
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (k, line) in lines.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let style = colour.stroke_width(if line.thin { 1 } else { 3 });
        let points = line.points.iter().copied();
        let drawn = if line.thin {
            chart.draw_series(DashedLineSeries::new(points, 6, 3, style))?
        } else {
            chart.draw_series(LineSeries::new(points, style))?
        };
        drawn
            .label(&line.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
    }
    if lines.len() > 1 {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.85))
            .border_style(GRID)
            .label_font(("sans-serif", 13))
            .draw()?;
    }
    root.present()?;
    drop(chart);
    Ok(())
}
