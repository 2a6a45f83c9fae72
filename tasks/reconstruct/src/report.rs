use softrast_lab::{
    mean,
    plot::{Axis, Plot, Series},
    report::{Beside, Report, Table},
};
use softrast_softness::Softness;

use crate::{Epoch, Header, Time, score::with_mean};

/// The page of a training: figures, curves and contact sheets, in one self-contained file.
///
/// `sheets` are PNG files with their epochs; `sphere` is the voxel `IoU` of each class for the
/// undeformed sphere.
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
    let mut report =
        Report::new("reconstruct", "A network that learns shapes from their silhouettes");
    report.heading("Result");
    report.table(&scores(header, sphere));
    report.table(&Table::pairs(figures(header).map(|(name, value)| [name.to_owned(), value])));
    report.heading("Curves");
    for (note, plot) in curves(header, sphere) {
        report.chart(&plot.svg()?, note);
    }
    report.heading("Held-out shapes");
    for (epoch, png) in sheets {
        report.picture(
            png,
            &format!(
                "After epoch {epoch}. A row for each class ({}), two shapes in it. Of each shape: the \
                 picture that the network sees, its prediction from the same camera, then prediction \
                 and truth from a camera 105 degrees further, which it never sees.",
                header.classes.join(", ")
            ),
        );
    }
    let beside = [
        Beside::new("history.json", "scores and times of every epoch"),
        Beside::new("checkpoint.bin", "the network, to go on from with --resume"),
    ];
    Ok(report.finish(command, &beside))
}

fn scores(header: &Header, sphere: &[f64]) -> Table {
    let words = ["voxel IoU"].into_iter().chain(header.classes.iter().map(String::as_str));
    let mut table = Table::new(words.chain(["mean"]));
    let mut row = |name: String, values: &[f64]| {
        table.push([name].into_iter().chain(with_mean(values).map(|iou| format!("{iou:.3}"))));
    };
    row("sphere, not deformed".into(), sphere);
    if let Some(last) = header.epochs.last() {
        row(format!("after epoch {}", last.number), &last.voxel_iou);
    }
    table
}

fn figures(header: &Header) -> [(&'static str, String); 13] {
    let settings = &header.settings;
    let mut time = Time::default();
    header.epochs.iter().for_each(|epoch| time.add(&epoch.time));
    let part = |seconds: f64| 100.0 * seconds / time.all.max(1e-9);
    let squared =
        if settings.softness.scale_is_squared() { " of the squared distance" } else { "" };
    [
        ("shapes", settings.data.to_string()),
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
    ]
}

/// Charts, each with a note.
fn curves(header: &Header, sphere: &[f64]) -> [(&'static str, Plot); 3] {
    let over = |name: &str, dashed: bool, of: &dyn Fn(&Epoch) -> Option<f64>| {
        let points = header.epochs.iter().filter_map(|e| Some([e.number as f64, of(e)?]));
        Series { name: name.to_owned(), dashed, points: points.collect(), ..Series::default() }
    };
    let level = mean(sphere);
    let mut iou =
        vec![over("mean", false, &|e| Some(e.mean_iou())), over("sphere", true, &|_| Some(level))];
    for (k, class) in header.classes.iter().enumerate() {
        iou.push(over(class, true, &|e| e.voxel_iou.get(k).copied()));
    }
    let plot = |name: &str, series: Vec<Series>| Plot {
        series,
        from_zero: true,
        ..Plot::new(Axis::linear("epoch"), Axis::linear(name))
    };
    let loss = vec![over("loss", false, &|e| e.loss)];
    let soft = vec![over("IoU", false, &|e| e.silhouette_iou)];
    [
        ("Mean loss of the steps of an epoch.", plot("loss", loss)),
        ("Voxel IoU on held-out shapes: mean of the classes, and each.", plot("voxel IoU", iou)),
        ("Soft IoU of the silhouettes while learning.", plot("silhouette IoU", soft)),
    ]
}
