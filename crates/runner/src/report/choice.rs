use super::frame::{escape, page};
use crate::choice::Choice;

/// The page of a choice: every method that was tried, and why the chosen one is.
pub(crate) fn of_choice(title: &str, head: &str, choice: &Choice, command: &str) -> String {
    let mut table = String::from("<table>\n");
    for (k, row) in choice.table().iter().enumerate() {
        let cell = if k == 0 { "th" } else { "td" };
        let cells: String =
            row.iter().map(|text| format!("<{cell}>{}</{cell}>", escape(text))).collect();
        let mark = if k == choice.chosen + 1 { " class=\"first\"" } else { "" };
        table += &format!("<tr{mark}>{cells}</tr>\n");
    }
    let (says, flags, price) = (escape(head), escape(&choice.flags()), escape(&choice.price()));
    let body = format!(
        "<p>{says}.</p>
<h2>Chosen</h2>
<pre>{flags}</pre>
<p>Its price: {price}.</p>
<h2>Reasons</h2>
{table}</table>
<p class=\"note\">From the least complex method to the most complex one. The first whose error is above
that of the best by no more than one standard error (se) of their difference, seed by seed, is
chosen.</p>
"
    );
    page(
        title,
        "Which softness is enough",
        &body,
        command,
        "<code>choose.json</code> holds all errors",
    )
}
