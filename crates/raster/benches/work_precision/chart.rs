//! Charts with logarithmic axes in one SVG, one below the other.

use softrast_lab::plot::{Axis, Plot, Series};

const TITLE_HEIGHT: u32 = 44;
const PANEL: (u32, u32) = (900, 380);

/// A chart with a title.
pub(crate) struct Panel {
    pub(crate) title: String,
    pub(crate) plot: Plot,
}

impl Panel {
    /// Lines through measured points.
    pub(crate) fn new<'a>(
        title: &str,
        x: &str,
        lines: impl IntoIterator<Item = (&'a str, Vec<[f64; 2]>)>,
    ) -> Self {
        let series = |(name, points): (&str, _)| Series {
            name: name.to_owned(),
            points,
            ..Series::default()
        };
        let axes = [x, "time of image and gradient [ms]"].map(Axis::logarithmic);
        let [x, y] = axes;
        let series = lines.into_iter().map(series).collect();
        Self { title: title.to_owned(), plot: Plot { series, ..Plot::new(x, y) } }
    }
}

/// All panels as SVG, below a title.
pub(crate) fn svg(title: &str, panels: &[Panel]) -> anyhow::Result<String> {
    let (width, height) = (PANEL.0, TITLE_HEIGHT + PANEL.1);
    let all = TITLE_HEIGHT + height * panels.len() as u32;
    let text = |y: u32, size: u32, text: &str| {
        format!(
            "<text x=\"24\" y=\"{y}\" font-family=\"sans-serif\" font-size=\"{size}\">{text}</text>\n"
        )
    };
    let mut page = format!(
        "<svg width=\"{width}\" height=\"{all}\" viewBox=\"0 0 {width} {all}\" xmlns=\"http://www.w3.org/2000/svg\">\n\
         <rect width=\"{width}\" height=\"{all}\" fill=\"#FFFFFF\"/>\n"
    );
    page += &text(30, 20, title);
    for (k, panel) in panels.iter().enumerate() {
        let top = TITLE_HEIGHT + height * k as u32;
        page += &text(top + 30, 17, &panel.title);
        let below = format!("<svg y=\"{}\" ", top + TITLE_HEIGHT);
        page += &panel.plot.svg()?.replacen("<svg ", &below, 1);
    }
    Ok(page + "</svg>\n")
}
