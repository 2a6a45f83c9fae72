use std::fmt::Write;

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::Value;

use crate::{
    Run,
    program::Encoded,
    summary::{ErrorSummary, Summary, short},
};

/// The results as one page that needs no other file.
pub(crate) fn html(
    about: &str,
    summary: &Summary,
    runs: &[Run],
    chart: &str,
    pictures: Option<&Encoded>,
    command: &str,
) -> String {
    let title = escape(summary.task);
    let figures = pictures.map(|pictures| figures(summary, pictures)).unwrap_or_default();
    let (about, head, command) = (escape(about), escape(&summary.head()), escape(command));
    let (warnings, settings) = (warnings(summary), settings(summary));
    let (results, each) = (results(summary), each_run(summary, runs));
    let chart_says = chart_caption(summary);
    format!(
        "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<title>{title}: softrast report</title>
<style>{STYLE}</style>
</head>
<body>
<h1>{title}</h1>
<p class=\"about\">{about}.</p>
<p>{head}.</p>
{warnings}<h2>Results</h2>
{results}{figures}<h2>Convergence</h2>
<figure>
{chart}
<figcaption>{chart_says}</figcaption>
</figure>
{each}<h2>Settings</h2>
{settings}<p class=\"note\">The softness is the smooth step that stands for the hard edge of a face, so
that the image changes smoothly with the scene; its scale is the width of that step.</p>
<h2>Run it again</h2>
<pre>{command}</pre>
<p class=\"note\">Beside this page: <code>result.json</code> holds all results, <code>curve.csv</code>
every error of every run after every step.</p>
</body>
</html>
"
    )
}

const STYLE: &str = "
body { max-width: 56rem; margin: 2rem auto 4rem; padding: 0 1rem; color: #1f2328;
  background: #fff; font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', sans-serif; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #d8dee4; }
.about { margin-top: 0; font-size: 1.15rem; color: #57606a; }
table { border-collapse: collapse; } th, td { padding: .3rem .9rem .3rem 0; text-align: left; }
tr { border-bottom: 1px solid #eaeef2; } thead th { color: #57606a; font-weight: 600; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
figure { margin: 1rem 0; } figure img, figure svg { max-width: 100%; height: auto; }
figcaption, .note { color: #57606a; font-size: .93rem; }
.warning { background: #fff8e5; border-left: 4px solid #d4a72c; padding: .5rem .9rem; }
pre { background: #f6f8fa; padding: .7rem .9rem; overflow-x: auto; }
summary { cursor: pointer; }
";

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
<figcaption>From left to right: the target, the image before the first step, the image after the
last step, and the difference of target and result: red where the target is brighter, blue where
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
    let errors = [&summary.image_error, &summary.parameter_error].map(|e| escape(e.name));
    let [image, parameter] = errors;
    let which = format!(
        "Above the error seen in the image ({image}), below the error of what is optimised \
         ({parameter}); both should fall to 0."
    );
    match summary.runs {
        1 => which,
        n => format!(
            "{which} The line is the median of {n} runs, the band holds the middle half of them \
             (25 % to 75 %)."
        ),
    }
}

fn warnings(summary: &Summary) -> String {
    let line = |warning: String| format!("<p class=\"warning\">{}</p>\n", escape(&warning));
    summary.first_warnings().into_iter().map(line).collect()
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
        "</tbody>\n</table>\n<p><strong>Success:</strong> {}.</p>\n<p class=\"note\">{}</p>\n",
        escape(&summary.success()),
        results_note(summary),
    );
    text
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

fn escape(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}
