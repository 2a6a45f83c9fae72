use std::fmt::Write;

use crate::{
    quantile,
    search::{Cell, best},
    space::{Setting, exact},
    summary::short,
};

const CELL: [f64; 2] = [92.0, 24.0];
/// Room for the labels of rows and columns.
const LEFT: f64 = 170.0;
const TOP: f64 = 52.0;
/// Dark for low errors, light for high ones.
const COLOURS: [[f64; 3]; 2] = [[23.0, 78.0, 140.0], [238.0, 243.0, 249.0]];

/// Mean scores as SVG: a row for every scale or decay (and number of the task's own), a column for
/// every learning rate.
///
/// The colours go from the lowest mean to the upper quartile of all; worse is as light as that. The
/// best has a frame, and what was not tried stays white.
pub(crate) fn svg(cells: &[Cell]) -> String {
    let rows = sorted(
        cells,
        |s| (s.scale_end.is_some(), s.scale, s.scale_end, s.own.map(|(_, value)| value)),
        |a, b| {
            let scales = order(a.1, b.1).then(order(a.2, b.2));
            a.0.cmp(&b.0).then(scales).then(order(a.3, b.3))
        },
    );
    let columns = sorted(cells, |s| s.learning_rate, |a, b| order(*a, *b));
    let means: Vec<f64> = cells.iter().filter_map(|cell| cell.mean).collect();
    let (low, high) = (quantile(&means, 0.0), quantile(&means, 0.75));
    let (width, height) =
        (LEFT + CELL[0] * columns.len() as f64 + 8.0, TOP + CELL[1] * rows.len() as f64 + 8.0);
    let mut text = format!(
        "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         xmlns=\"http://www.w3.org/2000/svg\" font-family=\"sans-serif\" font-size=\"13\">\n"
    );
    let word = |x: f64, y: f64, anchor: &str, fill: &str, word: &str| {
        format!(
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\" fill=\"{fill}\">{word}</text>\n"
        )
    };
    let own = cells.first().and_then(|cell| cell.setting.own);
    let own = own.map(|(flag, _)| format!(", {}", flag.replace('-', " "))).unwrap_or_default();
    text += &word(LEFT - 10.0, TOP - 10.0, "end", "#57606a", &format!("scale{own}"));
    text += &word(LEFT + 4.0, TOP - 32.0, "start", "#57606a", "learning rate");
    for (k, rate) in columns.iter().enumerate() {
        let x = LEFT + CELL[0] * (k as f64 + 0.5);
        text += &word(x, TOP - 10.0, "middle", "#1f2328", &rate.map_or("own".into(), exact));
    }
    for (k, (_, scale, end, own)) in rows.iter().enumerate() {
        let y = TOP + CELL[1] * (k as f64 + 0.7);
        let end = end.map(|end| format!(" → {}", exact(end))).unwrap_or_default();
        let own = own.map(|own| format!(", {}", exact(own))).unwrap_or_default();
        let label = format!("{}{end}{own}", scale.map_or("own".into(), exact));
        text += &word(LEFT - 10.0, y, "end", "#1f2328", &label);
    }
    let best = best(cells).map(|cell| cell.setting);
    for cell in cells {
        let Setting { scale, scale_end, learning_rate, own } = cell.setting;
        let own = own.map(|(_, value)| value);
        let row = rows.iter().position(|row| (row.1, row.2, row.3) == (scale, scale_end, own));
        let column = columns.iter().position(|rate| *rate == learning_rate);
        let (Some(row), Some(column)) = (row, column) else { continue };
        let (x, y) = (LEFT + CELL[0] * column as f64, TOP + CELL[1] * row as f64);
        let part = cell.mean.map(|mean| ((mean - low) / (high - low).max(1e-300)).clamp(0.0, 1.0));
        let fill = part.map_or("#f2d7d5".into(), colour);
        let frame = if Some(cell.setting) == best { "#c45418" } else { "#ffffff" };
        let [w, h] = CELL.map(|side| side - 3.0);
        let _ = writeln!(
            text,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{w}\" height=\"{h}\" fill=\"{fill}\" \
             stroke=\"{frame}\" stroke-width=\"3\"/>",
            x + 1.5,
            y + 1.5
        );
        let ink = if part.is_some_and(|part| part < 0.5) { "#ffffff" } else { "#1f2328" };
        let failed = if cell.non_finite > 0 { " *" } else { "" };
        let label = format!("{}{failed}", cell.mean.map_or("none".into(), short));
        text += &word(x + CELL[0] / 2.0, y + CELL[1] * 0.7, "middle", ink, &label);
    }
    text + "</svg>\n"
}

fn colour(part: f64) -> String {
    let [low, high] = COLOURS;
    let [r, g, b] = [0, 1, 2].map(|k| (low[k] + (high[k] - low[k]) * part).round());
    format!("rgb({r},{g},{b})")
}

fn order(a: Option<f64>, b: Option<f64>) -> std::cmp::Ordering {
    a.partial_cmp(&b).unwrap_or(std::cmp::Ordering::Equal)
}

/// The different keys of the settings in order.
fn sorted<K: PartialEq>(
    cells: &[Cell],
    key: impl Fn(Setting) -> K,
    order: impl Fn(&K, &K) -> std::cmp::Ordering,
) -> Vec<K> {
    let mut keys: Vec<K> = cells.iter().map(|cell| key(cell.setting)).collect();
    keys.sort_by(order);
    keys.dedup();
    keys
}
