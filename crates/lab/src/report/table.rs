use std::fmt::Write;

use super::html::escape;

/// Rows of text under a head. `**` at both ends of a cell means bold.
#[derive(Clone, Debug, Default)]
pub struct Table {
    head: Vec<String>,
    rows: Vec<Row>,
}

#[derive(Clone, Debug, Default)]
struct Row {
    cells: Vec<String>,
    chosen: bool,
    /// From 0, dark, to 1, light, by column.
    shades: Vec<Option<f64>>,
}

impl Table {
    /// An empty table.
    pub fn new<T: Into<String>>(head: impl IntoIterator<Item = T>) -> Self {
        Self { head: head.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// A table of names and values without a head.
    pub fn pairs<T: Into<String>>(pairs: impl IntoIterator<Item = [T; 2]>) -> Self {
        let mut table = Self::default();
        pairs.into_iter().for_each(|pair| table.push(pair));
        table
    }

    /// Adds a row.
    pub fn push<T: Into<String>>(&mut self, cells: impl IntoIterator<Item = T>) {
        let cells = cells.into_iter().map(Into::into).collect();
        self.rows.push(Row { cells, ..Row::default() });
    }

    /// Marks the last row.
    pub fn choose_last(&mut self) {
        self.rows.iter_mut().last().into_iter().for_each(|row| row.chosen = true);
    }

    /// Sets the backgrounds of the last row's cells: 0 is dark, 1 light, `None` white.
    pub fn shade_last(&mut self, shades: Vec<Option<f64>>) {
        self.rows.iter_mut().last().into_iter().for_each(|row| row.shades = shades.clone());
    }

    /// As Markdown, with an empty line before and after.
    pub fn markdown(&self) -> String {
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let rule = vec!["---".to_owned(); self.head.len()].join("|");
        let rows: String = self.rows.iter().map(|row| line(&row.cells)).collect();
        format!("\n{}|{rule}|\n{rows}\n", line(&self.head))
    }

    /// As lines of columns for a terminal.
    pub fn lines(&self) -> Vec<String> {
        let rows = || std::iter::once(&self.head).chain(self.rows.iter().map(|row| &row.cells));
        let columns = rows().map(Vec::len).max().unwrap_or(0);
        let width = |k: usize| rows().filter_map(|row| row.get(k)).map(|c| c.chars().count()).max();
        let widths: Vec<usize> = (0..columns).map(|k| width(k).unwrap_or(0)).collect();
        let line = |row: &Vec<String>| {
            let cells = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:<width$}"));
            format!("  {}", cells.collect::<Vec<_>>().join("  ").trim_end())
        };
        rows().filter(|row| !row.is_empty()).map(line).collect()
    }

    pub(super) fn html(&self) -> String {
        let mut text = String::from("<table>\n");
        if !self.head.is_empty() {
            let cells = self.head.iter().map(|cell| format!("<th>{}</th>", escape(cell)));
            // Writing to a string cannot fail.
            let _ = writeln!(text, "<tr>{}</tr>", cells.collect::<String>());
        }
        for Row { cells, chosen, shades } in &self.rows {
            let mark = if *chosen { " class=\"chosen\"" } else { "" };
            let shade = |k: usize| shades.get(k).copied().flatten();
            // Without a head, cells next to names are not aligned as a column.
            let in_column = !self.head.is_empty();
            let cells = cells.iter().enumerate();
            let cells = cells.map(|(k, cell)| cell_html(cell, shade(k), in_column));
            let _ = writeln!(text, "<tr{mark}>{}</tr>", cells.collect::<String>());
        }
        text + "</table>\n"
    }
}

fn cell_html(cell: &str, shade: Option<f64>, in_column: bool) -> String {
    let bold = cell.strip_prefix("**").and_then(|cell| cell.strip_suffix("**"));
    let shown = match bold {
        Some(cell) => format!("<strong>{}</strong>", escape(cell)),
        None => escape(cell),
    };
    let number = cell.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    let class = if number && in_column { " class=\"number\"" } else { "" };
    let style = shade.map(|shade| {
        const ENDS: [[f64; 3]; 2] = [[23.0, 78.0, 140.0], [238.0, 243.0, 249.0]];
        let mixed = |k: usize| (ENDS[0][k] + (ENDS[1][k] - ENDS[0][k]) * shade).round();
        let [r, g, b] = [0, 1, 2].map(mixed);
        let ink = if shade < 0.5 { "; color: #fff" } else { "" };
        format!(" style=\"background: rgb({r},{g},{b}){ink}\"")
    });
    format!("<td{class}{}>{shown}</td>", style.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new(["name", "value"]);
        table.push(["a<b", "**1**"]);
        table.push(["c", "0.5"]);
        table.choose_last();
        table.shade_last(vec![None, Some(0.0)]);
        table
    }

    #[test]
    fn a_table_is_markdown_columns_and_html() {
        assert_eq!(
            table().markdown(),
            "\n| name | value |\n|---|---|\n| a<b | **1** |\n| c | 0.5 |\n\n"
        );
        assert_eq!(table().lines(), ["  name  value", "  a<b   **1**", "  c     0.5"]);
        let html = table().html();
        assert!(html.contains("<td>a&lt;b</td><td><strong>1</strong></td>"), "{html}");
        assert!(
            html.contains("<tr class=\"chosen\">") && html.contains("rgb(23,78,140); color: #fff")
        );
        let pairs = Table::pairs([["a", "1"]]).html();
        assert!(!pairs.contains("<th>") && !pairs.contains("number"), "{pairs}");
        assert!(html.contains("<td class=\"number\" style="), "{html}");
    }
}
