//! A chart as SVG: lines with bands, dashes and dots over axes that may be logarithmic.

use std::fmt::Write;

use anyhow::anyhow;
use plotters::{coord::Shift, prelude::*};

pub use crate::axis::Axis;
use crate::axis::MarkedAxis;

const WIDTH: u32 = 900;
const HEIGHT: u32 = 380;
/// Width for the names of the methods, right of the axes.
const LEGEND: u32 = 230;
const ROW: i32 = 19;
const GRID: RGBColor = RGBColor(225, 228, 232);
const LIGHT: RGBColor = RGBColor(243, 244, 246);
const BEHIND: RGBColor = RGBColor(150, 150, 150);

/// Default colours of series, distinguishable also without seeing red.
const PALETTE: [[u8; 3]; 8] = [
    [31, 96, 168],
    [196, 84, 24],
    [0, 140, 100],
    [204, 121, 167],
    [86, 180, 233],
    [180, 140, 20],
    [110, 80, 190],
    [90, 90, 90],
];

/// A chart: a pair of axes and the series drawn over them.
#[derive(Clone, Debug)]
pub struct Plot {
    /// Horizontal axis, to the right.
    pub x: Axis,
    /// Vertical axis, upwards.
    pub y: Axis,
    /// The series; those with a name are in the legend.
    pub series: Vec<Series>,
    /// Points joined by a line below the series.
    pub front: Vec<[f64; 2]>,
    /// Whether a linear y axis begins at 0.
    pub from_zero: bool,
}

/// A line or a mark.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Red, green and blue; black is replaced by a separate colour among the series.
    pub colour: [u8; 3],
    /// Whether the line is dashed, or the mark open.
    pub dashed: bool,
    /// Points of a line; a single one is drawn as a mark.
    pub points: Vec<[f64; 2]>,
    /// Lower and upper end at every point, or nothing.
    pub band: Vec<[f64; 2]>,
    /// Whether its dots are ringed.
    pub marked: bool,
    /// Whether its dots are boxed.
    pub boxed: bool,
}

impl Series {
    fn rgb(&self) -> RGBColor {
        let [r, g, b] = self.colour;
        RGBColor(r, g, b)
    }

    /// Its mark at a position in pixels: filled, or open if the series is dashed.
    fn mark_at<DB: DrawingBackend>(&self, at: (i32, i32)) -> DynElement<'static, DB, (i32, i32)> {
        let colour = self.rgb();
        let style = if self.dashed { colour.stroke_width(2) } else { colour.filled() };
        Circle::new(at, 5, style).into_dyn()
    }
}

impl Plot {
    /// A chart without series.
    pub fn new(x: Axis, y: Axis) -> Self {
        Self { x, y, series: Vec::new(), front: Vec::new(), from_zero: false }
    }

    /// The chart as SVG. Values that an axis cannot show are omitted.
    ///
    /// # Errors
    ///
    /// If it cannot be drawn.
    pub fn svg(&self) -> anyhow::Result<String> {
        let mut text = String::new();
        {
            let mut coloured = self.clone();
            for (series, colour) in coloured.series.iter_mut().zip(PALETTE.iter().cycle()) {
                if series.colour == [0; 3] {
                    series.colour = *colour;
                }
            }
            let size = (WIDTH, self.height());
            let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
            let drawn = root.fill(&WHITE).and_then(|()| coloured.draw(&root));
            drawn.and_then(|()| root.present()).map_err(|e| anyhow!("cannot draw a chart: {e}"))?;
        }
        Ok(text)
    }

    /// The points of the chart as CSV, one per line.
    pub fn csv(&self) -> String {
        let mut text = String::from("series,x,y,low,high\n");
        for Series { name, points, band, .. } in &self.series {
            for (k, [x, y]) in points.iter().enumerate() {
                let ends = band.get(k).map(|[low, high]| format!("{low},{high}"));
                // Writing to a string does not fail.
                let _ = writeln!(text, "{name},{x},{y},{}", ends.unwrap_or(",".to_owned()));
            }
        }
        text
    }

    fn draw<DB: DrawingBackend>(
        &self,
        root: &DrawingArea<DB, Shift>,
    ) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
        let named = self.series.iter().any(|series| !series.name.is_empty());
        let (panel, legend) = root.split_horizontally(WIDTH - if named { LEGEND } else { 0 });
        let points = || self.series.iter().flat_map(|series| &series.points);
        let bands = self.series.iter().flat_map(|series| series.band.iter().flatten());
        let zero = (self.from_zero && !self.y.logarithmic).then_some(0.0);
        let heights = points().map(|point| point[1]).chain(bands.copied()).chain(zero);
        let (across, up) = (self.x.range(points().map(|point| point[0])), self.y.range(heights));
        let mut chart = ChartBuilder::on(&panel)
            .margin(14)
            .x_label_area_size(46)
            .y_label_area_size(78)
            .build_cartesian_2d(self.x.over(across, 7), self.y.over(up, 6))?;
        chart
            .configure_mesh()
            .x_desc(&self.x.name)
            .y_desc(&self.y.name)
            .x_label_formatter(&|place| self.x.label(*place))
            .y_label_formatter(&|place| self.y.label(*place))
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 15))
            .bold_line_style(GRID)
            .light_line_style(LIGHT)
            .draw()?;
        let front = self.front.iter().map(|[x, y]| (self.x.place(*x), self.y.place(*y)));
        let shown = front.filter(|(x, y)| x.is_finite() && y.is_finite());
        chart.draw_series(LineSeries::new(shown, BEHIND.stroke_width(1)))?;
        for series in &self.series {
            self.draw_series(series, &mut chart)?;
        }
        self.legend(&legend)
    }

    fn draw_series<DB: DrawingBackend>(
        &self,
        series: &Series,
        chart: &mut ChartContext<DB, Cartesian2d<MarkedAxis, MarkedAxis>>,
    ) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
        let place = |[x, y]: [f64; 2]| (self.x.place(x), self.y.place(y));
        let shown = |(x, y): &(f64, f64)| x.is_finite() && y.is_finite();
        let colour = series.rgb();
        let end = |k: usize| {
            let pairs = series.points.iter().zip(&series.band);
            pairs.map(move |(point, band)| place([point[0], band[k]])).filter(shown)
        };
        let band: Vec<_> = end(0).chain(end(1).collect::<Vec<_>>().into_iter().rev()).collect();
        if band.len() > 2 {
            chart.draw_series([Polygon::new(band, colour.mix(0.12))])?;
        }
        let points: Vec<_> = series.points.iter().map(|p| place(*p)).filter(shown).collect();
        if let [point] = points[..] {
            let mark = EmptyElement::at(point) + series.mark_at((0, 0));
            chart.draw_series([mark])?;
            if series.marked {
                chart.draw_series([Circle::new(point, 10, colour.stroke_width(1))])?;
            }
            if series.boxed {
                let corners = [(-14, -14), (14, 14)];
                let frame = Rectangle::new(corners, BLACK.stroke_width(1));
                chart.draw_series([EmptyElement::at(point) + frame])?;
            }
        } else if series.dashed {
            let line = DashedLineSeries::new(points, 7, 4, colour.stroke_width(2));
            chart.draw_series(line)?;
        } else {
            chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
        }
        Ok(())
    }

    /// Height of the chart, enough for all names.
    fn height(&self) -> u32 {
        HEIGHT.max((ROW as u32) * (self.series.len() as u32 + 3))
    }

    fn legend<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, Shift>,
    ) -> Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
        let named = self.series.iter().filter(|series| !series.name.is_empty());
        for (row, series) in named.enumerate() {
            let (style, y) = (series.rgb().stroke_width(3), 26 + ROW * row as i32);
            // The sample of a dashed line has two dashes.
            let dashes = if series.dashed { vec![(0, 8), (13, 21)] } else { vec![(0, 21)] };
            match series.points.len() {
                1 => area.draw(&series.mark_at((10, y)))?,
                _ => {
                    for (from, to) in dashes {
                        area.draw(&PathElement::new([(from, y), (to, y)], style))?;
                    }
                }
            }
            let text = ("sans-serif", 14).into_font().color(&BLACK);
            area.draw(&Text::new(series.name.clone(), (28, y - 7), text))?;
        }
        Ok(())
    }
}
