use std::fmt::Write;

use super::frame::escape;
use crate::{against::Against, summary::short};

/// How the first method compares with the second.
pub(super) fn section(against: &Against) -> String {
    let [first, second] = [0, 1].map(|k| escape(&against.titles[k]));
    let mut text = format!(
        "<h2>Against <span class=\"second\">{second}</span></h2>
<p>On the same {} seeds, at the last step. A difference below 0 means that the first method
(<span class=\"first\">{first}</span>) has the smaller error.</p>
<table>
<thead><tr><th>Error</th><th class=\"number\">First</th><th class=\"number\">Second</th>
<th class=\"number\">Mean difference</th><th class=\"number\">95 % interval</th>
<th class=\"number\">First better</th><th class=\"number\">Second better</th><th>First is</th></tr></thead>
<tbody>
",
        against.runs
    );
    for (difference, error) in against.differences().zip(against.errors()) {
        let [low, high] = difference.ci95.map(short);
        // Writing to a string does not fail.
        let _ = write!(text, "<tr><td>{}</td>", escape(&error.title()));
        for number in [
            short(error.last + difference.mean),
            short(error.last),
            short(difference.mean),
            format!("{low} to {high}"),
            format!("{:.0} %", difference.first_better * 100.0),
            format!("{:.0} %", difference.second_better * 100.0),
        ] {
            let _ = write!(text, "<td class=\"number\">{number}</td>");
        }
        let _ = writeln!(text, "<td>{}</td></tr>", difference.verdict());
    }
    let settings: Vec<String> = against
        .settings
        .iter()
        .map(|(key, value)| escape(&format!("{} {value}", key.replace('_', " "))))
        .collect();
    let [low, high] = against.success_ci95.map(|rate| rate * 100.0);
    let _ = write!(
        text,
        "</tbody>\n</table>\n<p>Success of the second: {:.1} % of runs, 95 % interval {low:.1} to \
         {high:.1} %.</p>\n<p class=\"note\">Settings of the second: {}. Intervals are by the \
         bootstrap over the seeds.</p>\n",
        against.success_rate * 100.0,
        settings.join(", ")
    );
    text
}
