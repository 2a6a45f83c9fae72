use std::fmt::Write;

use serde_json::Value;

use super::frame::{escape, page, warnings};

/// The page of a learned softness: what `text` says, then the charts (SVG and caption).
pub(crate) fn of_learning(
    (title, about): (&str, &str),
    text: &[String],
    charts: &[(String, String)],
    result: &Value,
    command: &str,
) -> String {
    let partial: Vec<String> = result["partial"]
        .as_str()
        .map(|done| format!("Stopped: {done}; --resume goes on from them"))
        .into_iter()
        .collect();
    let says = text.iter().map(|line| escape(line)).collect::<Vec<_>>().join("<br>\n");
    let mut body = format!("{}<h2>Learning</h2>\n<p>{says}</p>\n", warnings(&partial));
    for (svg, caption) in charts {
        let _ = write!(
            body,
            "<figure>\n{svg}\n<figcaption>{}</figcaption>\n</figure>\n",
            escape(caption)
        );
    }
    let rows = ["plan", "settings"].iter().filter_map(|key| result[key].as_object()).flatten();
    body += "<h2>Settings</h2>\n<table>\n<tbody>\n";
    for (key, value) in rows {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let key = key.replace('_', " ");
        let _ = writeln!(body, "<tr><td>{}</td><td>{}</td></tr>", escape(&key), escape(&value));
    }
    body += "</tbody>\n</table>\n";
    let beside = "<code>learn.json</code> holds the result, <code>learn.jsonl</code> every outer step; \
                  <code>softness.json</code> is for <code>--softness</code> of any task";
    page(title, about, &body, command, beside)
}
