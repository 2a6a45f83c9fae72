use std::fmt::Write;

use softrast_runner::{escape, page};

use crate::{LevelOutcome, Matrix, Outcome, Row, chart};

const ABOUT: &str = "Where each softness fails: every method on scenes that break rasterizers and \
                     optimisers";

/// The matrix and all its levels as one page that needs no other file.
///
/// # Errors
///
/// If a chart cannot be drawn.
pub(crate) fn html(matrix: &Matrix, command: &str) -> anyhow::Result<String> {
    let mut body = String::from(STYLE);
    let _ = writeln!(
        body,
        "<p>{} cases, {} methods, {} trials in {:.0} s. Trials with a number that is not finite: \
         {}. Faults of the program: {}.</p>",
        matrix.rows.len(),
        matrix.methods.len(),
        matrix.trials,
        matrix.seconds,
        matrix.non_finite,
        matrix.broken
    );
    for fault in matrix.faults() {
        let _ = writeln!(body, "<p class=\"warning\">{}</p>", escape(&fault));
    }
    body += "<h2>Matrix</h2>\n<p>Share of the trials that reach the target of the case, with the \
             first level at which fewer than half do. Cases marked <strong>!</strong> are promises of \
             this project, which every method must keep in every trial; the others show where a method \
             fails. <code>decay</code> is the logistic with a scale that falls over the steps; \
             <code>mlp</code> is a network of 56 weights. Move the pointer over a cell for its \
             interval.</p>\n";
    body += &table(matrix);
    body += "<h2>Cases</h2>\n";
    for row in &matrix.rows {
        body += &section(matrix, row)?;
    }
    let beside = "<code>stability.json</code> holds every level of every case";
    Ok(page("stability", ABOUT, &body, command, beside))
}

const STYLE: &str = "<style>
td.held { background: #e6f4ea; } td.part { background: #fff4d6; } td.none { background: #fde2d8; }
td.fault { background: #d1242f; color: #fff; font-weight: 700; }
td.cell { text-align: center; padding: .25rem .5rem; font-variant-numeric: tabular-nums; }
td.cell small { display: block; color: #57606a; font-size: .75rem; }
dl { margin: .3rem 0; } dt { float: left; clear: left; width: 8rem; color: #57606a; }
dd { margin-left: 8.5rem; }
</style>\n";

fn table(matrix: &Matrix) -> String {
    let mut text = String::from("<table>\n<thead><tr><th></th><th>Case</th>");
    for method in &matrix.methods {
        let _ = write!(text, "<th>{method}</th>");
    }
    text += "</tr></thead>\n<tbody>\n";
    for row in &matrix.rows {
        let mark = if row.guaranteed { " <strong>!</strong>" } else { "" };
        let (id, name) = (row.id, escape(row.name));
        let _ = write!(text, "<tr><td><a href=\"#{id}\">{id}</a>{mark}</td><td>{name}</td>");
        for outcome in &row.outcomes {
            text += &cell(row, outcome);
        }
        text += "</tr>\n";
    }
    text + "</tbody>\n</table>\n"
}

fn cell(row: &Row, outcome: &Outcome) -> String {
    let class = match (outcome.reached, outcome.trials) {
        _ if outcome.is_broken(row.promise()) => "fault",
        (reached, trials) if reached == trials => "held",
        (0, _) => "none",
        _ => "part",
    };
    let from = match outcome.fails_at() {
        Some(level) if !row.guaranteed => format!("<small>fails: {}</small>", escape(&level.label)),
        _ => String::new(),
    };
    let [low, high] = outcome.ci95.map(|share| 100.0 * share);
    let says = escape(&row.cell(outcome));
    format!(
        "<td class=\"cell {class}\" title=\"95 % interval {low:.0} to {high:.0} %\">{says}{from}</td>"
    )
}

fn section(matrix: &Matrix, row: &Row) -> anyhow::Result<String> {
    let mut text = format!("<h3 id=\"{}\">{}: {}</h3>\n<dl>", row.id, row.id, escape(row.name));
    for (name, value) in [
        ("Scene", row.scene),
        ("Levels", row.perturbation),
        ("Measure", row.measure),
        ("Target", row.target),
    ] {
        let _ = write!(text, "<dt>{name}</dt><dd>{}</dd>", escape(value));
    }
    text += "</dl>\n";
    if !row.guaranteed && row.outcomes.iter().all(has_axis) {
        let svg = chart::svg(row)?;
        let caption = match chart::shows_shares(row) {
            true => {
                "Share of trials that reach the target over the level, with its 95 % interval (Wilson)."
            }
            false => "What is measured over the level; one trial at each.",
        };
        let _ = writeln!(text, "<figure>\n{svg}\n<figcaption>{caption}</figcaption>\n</figure>");
    }
    let levels = row.outcomes.first().map_or(&[][..], |outcome| &outcome.levels);
    text += "<details>\n<summary>Measured numbers: median (worst), share</summary>\n<table>\n<thead><tr><th>Level</th>";
    for method in &matrix.methods {
        let _ = write!(text, "<th>{method}</th>");
    }
    text += "</tr></thead>\n<tbody>\n";
    for (k, level) in levels.iter().enumerate() {
        let _ = write!(text, "<tr><td>{}</td>", escape(&level.label));
        for outcome in &row.outcomes {
            let says = outcome.levels.get(k).map(numbers).unwrap_or_default();
            let _ = write!(text, "<td>{says}</td>");
        }
        text += "</tr>\n";
    }
    Ok(text + "</tbody>\n</table>\n</details>\n")
}

fn numbers(level: &LevelOutcome) -> String {
    let number = |x: Option<f64>| match x {
        None => "not finite".to_owned(),
        Some(0.0) => "0".to_owned(),
        Some(x) if (1e-3..1e4).contains(&x.abs()) => format!("{x:.3}"),
        Some(x) => format!("{x:.1e}"),
    };
    let (median, worst) = (number(level.median), number(level.worst));
    let both = if level.trials == 1 { worst } else { format!("{median} ({worst})") };
    format!("{both}, {}/{}", level.reached, level.trials)
}

/// Whether the levels are numbers.
fn has_axis(outcome: &Outcome) -> bool {
    outcome.levels.len() > 2 && outcome.levels.iter().all(|level| level.at.is_some())
}
