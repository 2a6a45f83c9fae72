use std::fmt::Write;

use softrast_runner::escape;

/// Rows of text under a head, for Markdown and for HTML.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    pub(crate) head: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new<const N: usize>(head: [&str; N]) -> Self {
        Self { head: head.map(str::to_owned).to_vec(), rows: Vec::new() }
    }

    /// With an empty line before and after. In a cell, `**` at both ends means bold.
    pub(crate) fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = vec!["---".to_owned(); self.head.len()].join("|");
        let rows: String = self.rows.iter().map(|row| line(row)).collect();
        format!("\n{}|{rule}|\n{rows}\n", line(&self.head))
    }

    pub(crate) fn html(&self) -> String {
        let mut text = String::from("<table>\n<tr>");
        // Writing to a string does not fail.
        for cell in &self.head {
            let _ = write!(text, "<th>{}</th>", escape(cell));
        }
        text += "</tr>\n";
        for row in &self.rows {
            text += "<tr>";
            for cell in row {
                let bold = cell.strip_prefix("**").and_then(|cell| cell.strip_suffix("**"));
                let shown = match bold {
                    Some(cell) => format!("<strong>{}</strong>", escape(cell)),
                    None => escape(cell),
                };
                let _ = write!(text, "<td>{shown}</td>");
            }
            text += "</tr>\n";
        }
        text + "</table>\n"
    }
}
