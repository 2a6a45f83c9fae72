//! Pages of HTML that need no other file, and tables for them and for Markdown.

mod html;
mod table;

pub(crate) use self::html::{escape, image};
pub use self::table::Table;

/// Style and script of a page with a viewer.
pub(crate) const VIEWER: [&str; 2] = [include_str!("../viewer.css"), include_str!("../viewer.js")];

/// A picture, PNG or GIF, with a short label.
#[derive(Clone, Debug)]
pub struct Labelled {
    /// The file.
    pub picture: Vec<u8>,
    /// The text under it.
    pub label: String,
}

/// A file in the folder of a page.
#[derive(Clone, Debug)]
pub struct Beside {
    /// Its name.
    pub file: String,
    /// Its content, in a few words.
    pub holds: String,
}

impl Beside {
    /// A file name and its content.
    pub fn new(file: &str, holds: &str) -> Self {
        Self { file: file.into(), holds: holds.into() }
    }
}

/// A page that grows section by section.
#[derive(Clone, Debug)]
pub struct Report {
    title: String,
    about: String,
    body: String,
    pub(crate) has_viewer: bool,
}

impl Report {
    /// An empty page; `about` describes its subject, in a line without a full stop.
    pub fn new(title: &str, about: &str) -> Self {
        Self { title: escape(title), about: escape(about), body: String::new(), has_viewer: false }
    }

    /// The result in a sentence or two, at the top of the page.
    pub fn verdict(&mut self, text: &str) {
        self.add(format!("<p class=\"verdict\">{}</p>", escape(text)));
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

    /// A note on the progress of the work, if the user stopped it.
    pub fn stopped(&mut self, finished: Option<&str>) {
        let line =
            finished.map(|finished| format!("Stopped: {finished}; --resume goes on from them"));
        self.warnings(line.as_slice());
    }

    /// Warnings in highlighted boxes.
    pub fn warnings(&mut self, lines: &[String]) {
        for line in lines {
            self.add(format!("<p class=\"warning\">{}</p>", escape(line)));
        }
    }

    /// Text as on a terminal.
    pub fn code(&mut self, text: &str) {
        self.add(format!("<pre>{}</pre>", escape(text)));
    }

    /// A table.
    pub fn table(&mut self, table: &Table) {
        self.add(table.html());
    }

    /// A collapsed section, filled by `fill`.
    pub fn folded(&mut self, summary: &str, fill: impl FnOnce(&mut Self)) {
        self.add(format!("<details>\n<summary>{}</summary>", escape(summary)));
        fill(self);
        self.add("</details>".into());
    }

    /// Text to be copied: a click selects all of it.
    pub fn copyable(&mut self, label: &str, text: &str) {
        let [label, text] = [label, text].map(escape);
        self.add(format!("<p class=\"copied\">{label}</p>\n<pre class=\"copy\">{text}</pre>"));
    }

    /// Pictures side by side, each over its label.
    pub fn gallery(&mut self, pictures: &[Labelled], caption: &str) {
        let cells = pictures.iter().map(|Labelled { picture, label }| {
            format!("<div>{}<span>{}</span></div>\n", image(picture, label), escape(label))
        });
        let cells: String = cells.collect();
        self.figure(&format!("<div class=\"gallery\">\n{cells}</div>"), &escape(caption));
    }

    /// A chart with a caption.
    pub fn chart(&mut self, svg: &str, caption: &str) {
        self.figure(svg, &escape(caption));
    }

    /// A picture, PNG or GIF, with a caption.
    pub fn picture(&mut self, bytes: &[u8], caption: &str) {
        self.figure(&image(bytes, caption), &escape(caption));
    }

    /// `content` and `caption` are HTML.
    pub(crate) fn figure(&mut self, content: &str, caption: &str) {
        self.add(format!("<figure>\n{content}\n<figcaption>{caption}</figcaption>\n</figure>"));
    }

    /// The page. `command` reproduces it, `beside` are the files in the same folder.
    pub fn finish(self, command: &str, beside: &[Beside]) -> String {
        let Self { title, about, body, has_viewer } = self;
        let command = escape(command);
        let files = beside.iter().map(|Beside { file, holds }| {
            let [file, holds] = [file, holds].map(|text| escape(text));
            format!("<li><a href=\"{file}\">{file}</a>: {holds}</li>\n")
        });
        let files: String = files.collect();
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
{body}<h2>Files</h2>
<ul>
{files}</ul>
<h2>Run it again</h2>
<pre>{command}</pre>
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

const STYLE: &str = include_str!("page.css");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_escapes_what_it_is_given() {
        let mut report = Report::new("a & b", "x");
        report.picture(b"GIF89", "1 < 2");
        report.paragraph("<script>");
        report.gallery(&[Labelled { picture: b"PNG".into(), label: "1 > 2".into() }], "");
        report.folded("<more>", |report| report.copyable("a<b", "{\"c\": 1}"));
        let page = report.finish("run \"it\"", &[Beside::new("a.json", "<all>")]);
        assert!(page.contains("<img alt=\"1 &lt; 2\" src=\"data:image/gif;base64,"), "{page}");
        assert!(page.contains("<figcaption>1 &lt; 2</figcaption>") && !page.contains("<script>"));
        assert!(page.contains("<a href=\"a.json\">a.json</a>: &lt;all&gt;"), "{page}");
        assert!(page.contains("<span>1 &gt; 2</span>") && page.contains("alt=\"1 &gt; 2\""));
        assert!(page.contains("<summary>&lt;more&gt;</summary>") && page.contains("a&lt;b"));
        assert!(page.contains("<pre class=\"copy\">{&quot;c&quot;: 1}</pre>"));
        assert!(page.contains("<title>a &amp; b") && page.contains("run &quot;it&quot;"));
    }
}
