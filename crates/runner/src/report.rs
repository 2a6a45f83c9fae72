mod against;
mod choice;
mod frame;
mod learn;
mod search;

use std::fmt::Write;

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::Value;

use crate::{
    Run,
    encoded::Encoded,
    error_summary::ErrorSummary,
    summary::{Summary, short},
};

pub(crate) use choice::of_choice;
pub use frame::{escape, page};
pub(crate) use learn::of_learning;
pub(crate) use search::of_search;

/// The results as one page that needs no other file.
pub(crate) fn html(
    about: &str,
    summary: &Summary,
    runs: &[Run],
    chart: &str,
    pictures: Option<&Encoded>,
    command: &str,
) -> String {
    let figures = pictures.map(|pictures| figures(summary, pictures)).unwrap_or_default();
    let head = escape(&summary.head());
    let partial = summary
        .partial
        .map(|partial| format!("Stopped: {}; --resume goes on from them", partial.says("runs")));
    let mut notes: Vec<String> = partial.into_iter().collect();
    notes.extend(summary.first_warnings());
    let warnings = frame::warnings(&notes);
    let searched = summary.search.as_ref().map(search::section).unwrap_or_default();
    let against = summary.against.as_ref();
    let against = against.map(against::section);
    let against = against.unwrap_or_default();
    let (results, each, settings) = (results(summary), each_run(summary, runs), settings(summary));
    let chart_says = chart_caption(summary);
    let body = format!(
        "<p>{head}.</p>
{warnings}{searched}<h2>Results</h2>
{results}{against}{figures}<h2>Convergence</h2>
<figure>
{chart}
<figcaption>{chart_says}</figcaption>
</figure>
{each}<h2>Settings</h2>
{settings}<p class=\"note\">The softness is the smooth step that stands for the hard edge of a face, so
that the image changes smoothly with the scene; its scale is the width of that step.</p>
"
    );
    page(summary.task, about, &body, command, &beside(summary))
}

/// What the other files hold.
fn beside(summary: &Summary) -> String {
    let mut text =
        "<code>result.json</code> holds all results, <code>curve.csv</code> every error of \
                    every run after every step"
            .to_owned();
    if summary.success_ci95.is_some() {
        text += ", <code>convergence.csv</code> the means over the runs and their intervals";
    }
    if summary.against.is_some() {
        text += ", <code>against_curve.csv</code> the runs of the second method";
    }
    if summary.search.is_some() {
        text += ", <code>search.json</code> and <code>search.csv</code> every setting tried";
    }
    text
}

fn figures(summary: &Summary, pictures: &Encoded) -> String {
    let which = match summary.runs {
        1 => String::new(),
        n => format!(" Shown is seed {}, the first of {n} runs.", summary.seed),
    };
    let (row, gif) = (&pictures.before_after, &pictures.animation);
    let (row, gif) = (STANDARD.encode(row), STANDARD.encode(gif));
    format!(
        "<h2>Pictures</h2>
<figure>
<img alt=\"Target, start, result and their difference\" src=\"data:image/png;base64,{row}\">
<figcaption>From left to right: the target, the image before the first step, the image of the
step that is returned, and the difference of target and result: red where the target is brighter, blue where
the result is brighter, white where they agree.{which}</figcaption>
</figure>
<figure>
<img alt=\"The image during the optimisation\" src=\"data:image/gif;base64,{gif}\">
<figcaption>The image during the optimisation (right) beside its target
(left).</figcaption>
</figure>
"
    )
}

fn chart_caption(summary: &Summary) -> String {
    let mut text = "All errors should fall to 0.".to_owned();
    if summary.runs > 1 {
        text += &format!(
            " A line is the mean of {} runs, the band around it the 95 % interval of the mean, by the \
             bootstrap.",
            summary.runs
        );
    }
    if let Some(other) = &summary.against {
        let [first, second] = [&other.titles[0], &other.titles[1]].map(|name| escape(name));
        text += &format!(
            " <span class=\"first\">Blue is the first method ({first})</span>, <span \
             class=\"second\">orange the second ({second})</span>."
        );
    }
    text
}

fn results(summary: &Summary) -> String {
    let many = summary.success_ci95.is_some();
    let mut text = String::from("<table>\n<thead><tr><th>Error</th>");
    let interval = if many { &["95 % interval of the end"][..] } else { &[] };
    for name in ["Start", "End", "Lowest"].iter().chain(interval) {
        text += &format!("<th class=\"number\">{name}</th>");
    }
    text += "</tr></thead>\n<tbody>\n";
    for error in summary.errors() {
        let _ = write!(text, "<tr><td>{}</td>", escape(&error.title()));
        for number in [error.initial, error.last, error.best] {
            let _ = write!(text, "<td class=\"number\">{}</td>", short(number));
        }
        if let Some([low, high]) = error.ci95 {
            let _ = write!(text, "<td class=\"number\">{} to {}</td>", short(low), short(high));
        }
        text += "</tr>\n";
    }
    let _ = write!(
        text,
        "</tbody>\n</table>\n{}<p><strong>Success:</strong> {}.</p>\n<p class=\"note\">{}</p>\n",
        returned(summary),
        escape(&summary.success()),
        results_note(summary),
    );
    text
}

/// Which step the result is.
fn returned(summary: &Summary) -> String {
    let says = |says: String| format!("<p><strong>Returned:</strong> {}.</p>\n", escape(&says));
    summary.returned.as_ref().map(|returned| says(returned.says())).unwrap_or_default()
}

fn results_note(summary: &Summary) -> String {
    let means = if summary.runs > 1 { " All are means over the runs." } else { "" };
    let memory = summary.peak_memory_mib.map(|mib| format!(", peak memory {mib:.0} MiB"));
    format!(
        "The lower the better; \"lowest\" is over all steps, for each error by itself.{means} \
         {:.1} s in all, {} ms per step{}.",
        summary.seconds.total,
        short(summary.seconds.step_median * 1e3),
        memory.unwrap_or_default()
    )
}

/// How every run ended, folded away; nothing for a single run.
fn each_run(summary: &Summary, runs: &[Run]) -> String {
    let errors: Vec<&ErrorSummary> = summary.errors().collect();
    if errors.iter().any(|error| error.per_run.is_none()) {
        return String::new();
    }
    let mut text =
        String::from("<details>\n<summary>Every run at its end</summary>\n<table>\n<thead><tr>");
    text += "<th class=\"number\">Seed</th>";
    for error in &errors {
        let _ = write!(text, "<th class=\"number\">{}</th>", escape(&error.title()));
    }
    text += "<th>Success</th></tr></thead>\n<tbody>\n";
    for (k, run) in runs.iter().enumerate() {
        let _ = write!(text, "<tr><td class=\"number\">{}</td>", run.seed);
        for value in errors.iter().filter_map(|error| error.per_run.as_ref()) {
            let _ = write!(text, "<td class=\"number\">{}</td>", short(value[k]));
        }
        let _ = writeln!(text, "<td>{}</td></tr>", if run.success { "yes" } else { "no" });
    }
    text + "</tbody>\n</table>\n</details>\n"
}

fn settings(summary: &Summary) -> String {
    let mut rows = vec![
        ("variant".to_owned(), summary.variant.to_owned()),
        ("softness".into(), summary.softness.clone()),
        ("softness parameters".into(), summary.parameters.to_string()),
        ("steps".into(), summary.steps.to_string()),
        ("image size".into(), format!("{0} x {0} pixels", summary.size)),
        ("faces".into(), summary.faces.to_string()),
        ("backend".into(), summary.backend.clone()),
    ];
    for (key, value) in &summary.settings {
        let value = match value {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        rows.push((key.replace('_', " "), value));
    }
    let row = |(name, value): &(String, String)| {
        format!("<tr><td>{}</td><td>{}</td></tr>\n", escape(name), escape(value))
    };
    let rows: String = rows.iter().map(row).collect();
    format!("<table>\n<tbody>\n{rows}</tbody>\n</table>\n")
}
