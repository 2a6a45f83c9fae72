/// A page of HTML that needs no other file, in the style of all reports.
///
/// `body` and `beside`, which says what lies beside the page, are HTML; the rest is plain text.
pub fn page(title: &str, about: &str, body: &str, command: &str, beside: &str) -> String {
    let [title, about, command] = [title, about, command].map(escape);
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
{body}<h2>Run it again</h2>
<pre>{command}</pre>
<p class=\"note\">Beside this page: {beside}.</p>
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
.first { color: #1f60a8; font-weight: 600; } .second { color: #c45418; font-weight: 600; }
pre { background: #f6f8fa; padding: .7rem .9rem; overflow-x: auto; }
summary { cursor: pointer; }
";

/// Text as HTML.
pub fn escape(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('>', "&gt;").replace('"', "&quot;")
}

/// Lines in boxes that catch the eye.
pub(super) fn warnings(lines: &[String]) -> String {
    let line = |text: &String| format!("<p class=\"warning\">{}</p>\n", escape(text));
    lines.iter().map(line).collect()
}
