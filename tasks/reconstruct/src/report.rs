use std::fmt::Write;

use base64::{Engine, engine::general_purpose::STANDARD};

use crate::{
    chart::{Line, svg},
    checkpoint::Header,
    settings::Data,
};

/// The page of a training: figures, curves and contact sheets, in one file that needs no other.
///
/// `sheets` are PNG files with the epochs they show; `sphere` is the voxel `IoU` of each class of the
/// sphere that nothing has deformed.
///
/// # Errors
///
/// If a chart cannot be drawn.
pub(crate) fn html(
    header: &Header,
    sphere: &[f64],
    sheets: &[(usize, Vec<u8>)],
    command: &str,
) -> anyhow::Result<String> {
    let mut body = figures(header, sphere);
    body += "<h2>Curves</h2>\n";
    for (note, chart) in curves(header, sphere)? {
        let _ = writeln!(body, "<figure>{chart}<figcaption>{note}</figcaption></figure>");
    }
    body += "<h2>Held-out shapes</h2>\n";
    for (epoch, png) in sheets {
        let _ = writeln!(
            body,
            "<figure><img alt=\"shapes after epoch {epoch}\" \
             src=\"data:image/png;base64,{}\"><figcaption>After epoch {epoch}. A row for each class \
             ({}), two shapes in it. Of each shape: the picture that the network sees, its prediction \
             from the same camera, then prediction and truth from a camera 105 degrees further, which \
             it never sees.</figcaption></figure>",
            STANDARD.encode(png),
            escape(&header.classes.join(", ")),
        );
    }
    let _ = writeln!(body, "<h2>Run it again</h2>\n<pre>{}</pre>", escape(command));
    Ok(page(&body))
}

fn figures(header: &Header, sphere: &[f64]) -> String {
    let settings = &header.settings;
    let mut body = String::from("<h2>Result</h2>\n<table>\n<thead><tr><th>voxel IoU</th>");
    for class in &header.classes {
        let _ = write!(body, "<th class=\"number\">{}</th>", escape(class));
    }
    body += "<th class=\"number\">mean</th></tr></thead>\n";
    let mut row = |name: &str, values: &[f64]| {
        let _ = write!(body, "<tr><td>{name}</td>");
        for value in values.iter().chain([&crate::score::mean(values)]) {
            let _ = write!(body, "<td class=\"number\">{value:.3}</td>");
        }
        body += "</tr>\n";
    };
    row("sphere, not deformed", sphere);
    if let Some(last) = header.epochs.last() {
        row(&format!("after epoch {}", last.number), &last.voxel_iou);
    }
    body += "</table>\n<table>\n";
    let mut time = crate::epoch::Time::default();
    header.epochs.iter().for_each(|epoch| time.add(&epoch.time));
    let part = |seconds: f64| 100.0 * seconds / time.all.max(1e-9);
    let data = match &settings.data {
        Data::Procedural(count) => format!("procedural, {count} shapes of a class to learn from"),
        Data::Files(folder) => folder.display().to_string(),
    };
    let squared = if settings.softness.squared { " of the squared distance" } else { "" };
    let rows = [
        ("shapes", data),
        ("network", format!("{} widths", settings.width.name())),
        ("softness", format!("{}{squared}", settings.softness.family)),
        ("T-conorm", settings.t_conorm.clone()),
        ("steps", {
            let epochs = header.epochs.len() - 1;
            let [steps, pairs] = [settings.steps, settings.pairs];
            format!("{epochs} epochs of {steps}, {pairs} pairs of pictures each")
        }),
        ("learning rates", {
            format!("{} network, {} softness", settings.learning_rate, settings.softness_rate)
        }),
        ("time of the steps", format!("{:.1} min", time.all / 60.0)),
        ("pictures a second", format!("{:.1}", time.rate())),
        ("share of the network", format!("{:.0} %", part(time.network))),
        ("share of the rasterizer", format!("{:.0} %", part(time.rasterizer))),
        ("share of the smoothness", format!("{:.0} %", part(time.smoothness))),
        ("share of the optimisers", format!("{:.0} %", part(time.optimizer))),
        ("share of the pictures", format!("{:.0} %", part(time.data))),
    ];
    for (name, value) in rows {
        let _ = writeln!(body, "<tr><td>{name}</td><td>{}</td></tr>", escape(&value));
    }
    body + "</table>\n"
}

/// Charts, each with a note.
fn curves(header: &Header, sphere: &[f64]) -> anyhow::Result<Vec<(&'static str, String)>> {
    let over = |name: &str, thin: bool, of: &dyn Fn(&crate::Epoch) -> Option<f64>| {
        let points = header.epochs.iter().filter_map(|e| Some((e.number as f64, of(e)?)));
        Line { name: name.to_owned(), points: points.collect(), thin }
    };
    let loss = [over("loss", false, &|e| e.loss)];
    let last = header.epochs.last().map_or(0.0, |e| e.number as f64);
    let level = crate::score::mean(sphere);
    let mut iou = vec![
        over("mean", false, &|e| Some(e.mean_iou())),
        Line { name: "sphere".into(), points: vec![(0.0, level), (last, level)], thin: true },
    ];
    for (k, class) in header.classes.iter().enumerate() {
        iou.push(over(class, true, &|e| e.voxel_iou.get(k).copied()));
    }
    let soft = [over("IoU", false, &|e| e.silhouette_iou)];
    Ok(vec![
        ("Mean loss of the steps of an epoch.", svg("loss", &loss)?),
        ("Voxel IoU on held-out shapes: mean of the classes, and each.", svg("voxel IoU", &iou)?),
        ("Soft IoU of the silhouettes while learning.", svg("silhouette IoU", &soft)?),
    ])
}

fn page(body: &str) -> String {
    format!(
        "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<title>reconstruct: softrast report</title>
<style>{STYLE}</style>
</head>
<body>
<h1>reconstruct</h1>
<p class=\"about\">A network that learns shapes from their silhouettes.</p>
{body}</body>
</html>
"
    )
}

const STYLE: &str = "
body { max-width: 66rem; margin: 2rem auto 4rem; padding: 0 1rem; color: #1f2328;
  background: #fff; font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', sans-serif; }
h1 { margin-bottom: 0; } h2 { margin-top: 2.2rem; border-bottom: 1px solid #d8dee4; }
.about { margin-top: 0; font-size: 1.15rem; color: #57606a; }
table { border-collapse: collapse; margin-bottom: 1.2rem; }
th, td { padding: .3rem .9rem .3rem 0; text-align: left; }
tr { border-bottom: 1px solid #eaeef2; } thead th { color: #57606a; font-weight: 600; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
figure { margin: 1rem 0; } figure img, figure svg { max-width: 100%; height: auto; }
figcaption { color: #57606a; font-size: .93rem; }
pre { background: #f6f8fa; padding: .7rem .9rem; overflow-x: auto; }
";

/// Text as HTML.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
