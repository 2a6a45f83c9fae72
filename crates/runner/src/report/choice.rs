use super::frame::{escape, page};
use crate::{Choice, Stage};

/// The page of a choice: everything that was tried, and why the chosen is.
pub(crate) fn of_choice(title: &str, head: &str, choice: &Choice, command: &str) -> String {
    let tables: String = choice.stages.iter().map(table).collect();
    let (says, flags, price) = (escape(head), escape(&choice.flags()), escape(&choice.price()));
    let body = format!(
        "<p>{says}.</p>
<h2>Chosen</h2>
<pre>{flags}</pre>
<p>Its price: {price}.</p>
<h2>Reasons</h2>
{tables}<p class=\"note\">Each table starts from what the one before chose, and goes from the cheapest to the
costliest. The first whose error is above that of the best by no more than one standard error (se) of
their difference, seed by seed, is chosen. Seconds are those of the optimisation steps.</p>
"
    );
    page(title, "What is enough", &body, command, "<code>choose.json</code> holds all errors")
}

fn table(stage: &Stage) -> String {
    let mut table = String::from("<table>\n");
    for (k, row) in stage.table().iter().enumerate() {
        let cell = if k == 0 { "th" } else { "td" };
        let cells: String =
            row.iter().map(|text| format!("<{cell}>{}</{cell}>", escape(text))).collect();
        let mark = if k == stage.chosen + 1 { " class=\"first\"" } else { "" };
        table += &format!("<tr{mark}>{cells}</tr>\n");
    }
    table + "</table>\n"
}
