//! Pages of HTML that need no other file, and tables for them and for Markdown.

use std::fmt::Write;

use base64::{Engine, engine::general_purpose::STANDARD};

/// What a page with a viewer needs.
pub(crate) const VIEWER: [&str; 2] = [include_str!("viewer.css"), include_str!("viewer.js")];

/// A page that grows section by section.
#[derive(Clone, Debug)]
pub struct Report {
    title: String,
    about: String,
    body: String,
    pub(crate) has_viewer: bool,
}

impl Report {
    /// An empty page; `about` is what it is about, in a line without a full stop.
    pub fn new(title: &str, about: &str) -> Self {
        Self { title: escape(title), about: escape(about), body: String::new(), has_viewer: false }
    }

    /// A heading.
    pub fn heading(&mut self, text: &str) {
        self.add(format!("<h2>{}</h2>", escape(text)));
    }

    /// A paragraph.
    pub fn paragraph(&mut self, text: &str) {
        self.add(format!("<p>{}</p>", escape(text)));
    }

    /// A paragraph that begins with a word in bold.
    pub fn labelled(&mut self, label: &str, text: &str) {
        self.add(format!("<p><strong>{}:</strong> {}.</p>", escape(label), escape(text)));
    }

    /// A paragraph of lesser weight.
    pub fn note(&mut self, text: &str) {
        self.add(format!("<p class=\"note\">{}</p>", escape(text)));
    }

    /// How far the work came, if the user stopped it.
    pub fn stopped(&mut self, finished: Option<&str>) {
        let line =
            finished.map(|finished| format!("Stopped: {finished}; --resume goes on from them"));
        self.warnings(line.as_slice());
    }

    /// Lines in boxes that catch the eye.
    pub fn warnings(&mut self, lines: &[String]) {
        for line in lines {
            self.add(format!("<p class=\"warning\">{}</p>", escape(line)));
        }
    }

    /// Text as it would stand on a terminal.
    pub fn code(&mut self, text: &str) {
        self.add(format!("<pre>{}</pre>", escape(text)));
    }

    /// A table.
    pub fn table(&mut self, table: &Table) {
        self.add(table.html());
    }

    /// A table that is folded away.
    pub fn details(&mut self, summary: &str, table: &Table) {
        let summary = escape(summary);
        self.add(format!("<details>\n<summary>{summary}</summary>\n{}</details>", table.html()));
    }

    /// A chart with what is to be seen in it.
    pub fn chart(&mut self, svg: &str, caption: &str) {
        self.figure(svg, &escape(caption));
    }

    /// A picture, PNG or GIF, with what is to be seen in it.
    pub fn picture(&mut self, bytes: &[u8], caption: &str) {
        self.figure(&image(bytes, caption), &escape(caption));
    }

    /// `content` and `caption` are HTML.
    pub(crate) fn figure(&mut self, content: &str, caption: &str) {
        self.add(format!("<figure>\n{content}\n<figcaption>{caption}</figcaption>\n</figure>"));
    }

    /// The page. `command` makes it again, `beside` says what lies beside it.
    pub fn finish(self, command: &str, beside: &str) -> String {
        let Self { title, about, body, has_viewer } = self;
        let [command, beside] = [command, beside].map(escape);
        let viewer_style = if has_viewer { VIEWER[0] } else { "" };
        let script = format!("<script>\n{}</script>\n", VIEWER[1]);
        let script = if has_viewer { &script } else { "" };
        format!(
            "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<title>{title}: softrast report</title>
<style>{STYLE}{viewer_style}</style>
</head>
<body>
<h1>{title}</h1>
<p class=\"about\">{about}.</p>
{body}<h2>Run it again</h2>
<pre>{command}</pre>
<p class=\"note\">Beside this page: {beside}.</p>
{script}</body>
</html>
"
        )
    }

    fn add(&mut self, html: String) {
        self.body += &html;
        self.body.push('\n');
    }
}

const STYLE: &str = "
body { overflow-wrap: anywhere; max-width: 56rem; margin: 2rem auto 4rem; padding: 0 1rem; color: #1f2328;
  background: #fff; font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', sans-serif; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #d8dee4; }
.about { margin-top: 0; font-size: 1.15rem; color: #57606a; }
table { border-collapse: collapse; display: block; overflow-x: auto; } th, td { overflow-wrap: normal; padding: .3rem .9rem .3rem 0; text-align: left; }
tr { border-bottom: 1px solid #eaeef2; } th { color: #57606a; font-weight: 600; }
td.number { text-align: right; font-variant-numeric: tabular-nums; }
td[style] { padding: .3rem .6rem; }
figure { margin: 1rem 0; overflow-x: auto; } figure img, figure svg { max-width: 100%; height: auto; }
figcaption, .note { color: #57606a; font-size: .93rem; }
.warning { background: #fff8e5; border-left: 4px solid #d4a72c; padding: .5rem .9rem; }
tr.chosen { background: #eaf2fb; }
pre { background: #f6f8fa; padding: .7rem .9rem; overflow-x: auto; }
summary { cursor: pointer; }
";

/// A picture, PNG or GIF, as an element. The caption stands for it to those who cannot see it.
pub(crate) fn image(bytes: &[u8], caption: &str) -> String {
    let kind = if bytes.starts_with(b"GIF") { "gif" } else { "png" };
    let (data, caption) = (STANDARD.encode(bytes), escape(caption));
    format!("<img alt=\"{caption}\" src=\"data:image/{kind};base64,{data}\">")
}

/// Text as HTML.
pub(crate) fn escape(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

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

    /// Gives the cells of the last row a background: 0 is dark, 1 light, none is white.
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

    fn html(&self) -> String {
        let mut text = String::from("<table>\n");
        if !self.head.is_empty() {
            let cells = self.head.iter().map(|cell| format!("<th>{}</th>", escape(cell)));
            // Writing to a string does not fail.
            let _ = writeln!(text, "<tr>{}</tr>", cells.collect::<String>());
        }
        for Row { cells, chosen, shades } in &self.rows {
            let mark = if *chosen { " class=\"chosen\"" } else { "" };
            let shade = |k: usize| shades.get(k).copied().flatten();
            let cells = cells.iter().enumerate().map(|(k, cell)| cell_html(cell, shade(k)));
            let _ = writeln!(text, "<tr{mark}>{}</tr>", cells.collect::<String>());
        }
        text + "</table>\n"
    }
}

fn cell_html(cell: &str, shade: Option<f64>) -> String {
    let bold = cell.strip_prefix("**").and_then(|cell| cell.strip_suffix("**"));
    let shown = match bold {
        Some(cell) => format!("<strong>{}</strong>", escape(cell)),
        None => escape(cell),
    };
    let number = cell.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    let class = if number { " class=\"number\"" } else { "" };
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
        assert!(!Table::pairs([["a", "b"]]).html().contains("<th>"));
    }

    #[test]
    fn a_page_escapes_what_it_is_given() {
        let mut report = Report::new("a & b", "x");
        report.picture(b"GIF89", "1 < 2");
        report.paragraph("<script>");
        let page = report.finish("run \"it\"", "nothing");
        assert!(page.contains("<img alt=\"1 &lt; 2\" src=\"data:image/gif;base64,"), "{page}");
        assert!(page.contains("<figcaption>1 &lt; 2</figcaption>") && !page.contains("<script>"));
        assert!(page.contains("<title>a &amp; b") && page.contains("run &quot;it&quot;"));
    }
}
