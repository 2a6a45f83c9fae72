//! The tables of the paper as Markdown, and as one HTML page.

use std::{fmt::Write, fs, path::Path};

use base64::{Engine, engine::general_purpose::STANDARD};
use softrast_method::Searched;
use softrast_runner::{Schedule, escape, mean, page};

use crate::{
    Cell, Error, Measured, Printed, Purpose, TaskName,
    charts::{self, Chart},
    crossed::{CROSSED, crossed},
    machine::machine,
    measured::{paired, short},
    table::Table,
};

/// The tables of the paper with our figures, as Markdown. `command` made them; `pictures` is where
/// the charts are, seen from the file, if they are to be shown.
pub fn markdown(measured: &[Measured], command: &str, pictures: Option<&str>) -> String {
    let mut text = format!(
        "{HEAD}\n```\n{command}\n```\n\non {}.\n\n{READING}\n## Table 2: tasks\n",
        machine()
    );
    text += &tasks(measured).markdown();
    text += "## Table 3: errors\n";
    for group in by_variant(measured) {
        let Cell { task, variant, runs, .. } = &group[0].cell;
        if *variant == "original" {
            // Writing to a string does not fail.
            let _ = write!(text, "\n### {}\n\n{}\n", task.title(), note(*task));
        }
        let _ = write!(text, "\n**{variant}**, seeds: {runs}\n");
        text += &errors(&group).markdown();
        for chart in pictures.map(|_| charts::of_variant(&group)).unwrap_or_default() {
            text += &shown(&chart, pictures);
        }
    }
    let _ = write!(text, "\n## Table 5: seconds\n\n{SECONDS}\n{}", seconds(measured).markdown());
    if let Some(table) = crossed(measured) {
        let _ = write!(text, "\n## Table 6: cross evaluation\n\n{CROSSED}\n{}", table.markdown());
    }
    if let Some(chart) = charts::profile(&by_variant(measured)) {
        text += "\n## Who is fast how often\n";
        text += &shown(&chart, pictures);
    }
    text
}

fn shown(chart: &Chart, pictures: Option<&str>) -> String {
    let Some(folder) = pictures else { return String::new() };
    format!("\n![{}]({folder}/{}.svg)\n\n{}\n", chart.name, chart.name, chart.caption)
}

/// The same as one HTML page, with the pictures of the first seed that every cell has left in its
/// folder in `out`.
pub(crate) fn html(measured: &[Measured], command: &str, out: &Path) -> anyhow::Result<String> {
    let paragraph = |text: &str| format!("<p>{}</p>\n", escape(&text.replace("**", "")));
    let mut body = paragraph(&format!("On {}. {READING}", machine()));
    body += "<h2>Tasks</h2>\n";
    body += &tasks(measured).html();
    for group in by_variant(measured) {
        let Cell { task, variant, runs, .. } = &group[0].cell;
        let _ = write!(body, "<h2>{}, {variant}</h2>\n{}", task.title(), paragraph(note(*task)));
        let _ = writeln!(body, "<p>Seeds: {runs}</p>\n{}", errors(&group).html());
        for chart in charts::of_variant(&group) {
            let _ = write!(body, "<figure>\n{}\n<figcaption>", chart.plot.svg()?);
            let _ = writeln!(body, "{}</figcaption>\n</figure>", escape(&chart.caption));
        }
        body += &pictures(&group, out);
    }
    let _ = write!(body, "<h2>Seconds</h2>\n{}{}", paragraph(SECONDS), seconds(measured).html());
    if let Some(table) = crossed(measured) {
        let _ = write!(body, "<h2>Cross evaluation</h2>\n{}{}", paragraph(CROSSED), table.html());
    }
    if let Some(chart) = charts::profile(&by_variant(measured)) {
        let _ = write!(body, "<h2>Who is fast how often</h2>\n<figure>\n{}\n", chart.plot.svg()?);
        let _ = writeln!(body, "<figcaption>{}</figcaption>\n</figure>", escape(&chart.caption));
    }
    let beside = "a folder for every cell with its own <code>report.html</code>, \
                  <code>cells.csv</code> and <code>cells.json</code> with the numbers behind the \
                  tables, <code>charts</code> with the charts as SVG and their points as CSV";
    Ok(page("compare", "All methods on all tasks", &body, command, beside))
}

/// What the first seed looks like: before, after, target and difference, method by method.
fn pictures(group: &[&Measured], out: &Path) -> String {
    let mut text = String::new();
    for one in group {
        let file = one.cell.folder(out).join("before_after.png");
        if let Ok(bytes) = fs::read(file) {
            let (name, image) = (escape(&one.cell.method_name()), STANDARD.encode(bytes));
            let _ = writeln!(
                text,
                "<figure>\n<img alt=\"{name}\" src=\"data:image/png;base64,{image}\">\n\
                 <figcaption>{name}, first seed</figcaption>\n</figure>"
            );
        }
    }
    text
}

/// The cells of each task in each variant, in the order of the tables, without those of Table 6 alone.
pub(crate) fn by_variant(measured: &[Measured]) -> Vec<Vec<&Measured>> {
    let places = TaskName::ALL.iter().flat_map(|task| ["original", "transfer"].map(|v| (*task, v)));
    let group = |(task, variant)| {
        let of = |one: &&Measured| one.cell.task == task && one.cell.variant == variant;
        let crossed = |one: &&Measured| one.cell.purpose == Purpose::Crossed;
        measured.iter().filter(of).filter(|one| !crossed(one)).collect::<Vec<_>>()
    };
    places.map(group).filter(|group| !group.is_empty()).collect()
}

const HEAD: &str = "# Results\n\nTables 2, 3, 5 and 6 of the paper (Wu et al. 2024) with our figures, made \
                    by\n";

const READING: &str = "\
Errors are means over runs at the last step, in brackets the 95 % interval of the mean (bootstrap). All methods start from the
same seeds, 0 and those that follow, which no setting was chosen on, and share everything but softness, scale, learning rate and what
goes with the scale: a pixel may be off by 1e-5 where it stays, by 1e-2 where it moves.
What `search` found for a family on training seeds of the original variant stands in `crates/method/searched.json`, with the command; the
transfer keeps it (POSE and OCCLUSION have a learning rate of their own there). OCCLUSION's original, which most settings solve without an error,
tells nothing, so families were searched on the transfer there, as `learned` was learned on it. Settings with a * were not searched for: they are the
task's own. `learned` is what comes with the programs and is their default, `learned-mlp` the network beside it
(`crates/softness/learned`, where a note in each file says how it was learned), `learned-surrogate` a sharp image with a learned wider gradient, which
OCCLUSION, whose edges stay, has no use for; their seeds were others too. On 3D SHAPE `learned` and `learned-mlp` have a surrogate as well, one that
narrows with the image, and the families have none. `mlp` is the network before it has
learned anything, with `init fitted` after a fit to the searched logistic. Rows with a resolution, a tolerance or a backend optimise on that many pixels a
side, let a pixel be off by that much, or compute there; they are on the charts of error against seconds alone. Methods are compared by the error of the **hard** image, because a method's own
soft error falls with its scale. \"Less NAME\" is the mean of the
differences in that error to the first method, seed by seed: below 0 is better, and in bold where its interval leaves out 0. Under
\"best step\" stands the mean over the runs of the lowest that each has reached, which is what a run returns, and behind it the difference of that. Under
\"in the paper's unit\" stand image and parameter error as the paper has them, as far as its definitions are known, and beside them
what it prints. The paper's meshes and pictures are others, so its figures tell the order of size and no more.
";

const SECONDS: &str = "\
Wall time of the optimisation steps of a run, its share of a batch where runs are solved together, without the errors that are
measured beside; a step draws once and takes one gradient. The paper's figures are from a V100: 3.24 to 4.36 seconds to evaluate 3D SHAPE and
0.053 to 0.088 to draw once. How long learning took stands in the note of each file in `crates/softness/learned`.
";

fn note(task: TaskName) -> &'static str {
    match task {
        TaskName::Shape2d => {
            "Paper's unit: the hard mean squared error; there is no parameter error, and our hard \
             error stands in for it.\nThe paper prints 0.0038 for its MLP in both variants; the \
             released run of the transfer ends at 0.0101."
        }
        TaskName::Shape3d => {
            "Paper's unit: 100 times the hard IoU loss in the original, 1000 times in the transfer, \
             as its figures suggest.\nIts Chamfer distance has neither definition nor scale; ours is \
             the mean squared distance to the nearest of 10,000\npoints spread by area, both \
             directions averaged, times 1000."
        }
        TaskName::Pose => {
            "Paper's unit: the sum over 24 pairs of the method's own soft IoU loss, and a third of the \
             sum of squared distances\nof unit directions. Its starts are 15 to 35 degrees away, ours \
             35 to 55. Its baselines end a decay at 1e-7, where\nthey have long lost the pose \
             (README, POSE); ours stop where the hard image is best. Its camera keeps a wrong\nfield \
             of view, ours a known one."
        }
        TaskName::Occlusion => {
            "Paper's unit: the mean squared error of the soft image, and, as we guess, the number of \
             pairs in the wrong order.\nThe released blending depends on the order of faces; ours is \
             Eq. 4 with exact derivatives. Of the transfer only the\nfront quad is asked for. The \
             paper's rows Exp and Gamma are identical: their weights are 1 at every depth."
        }
    }
}

/// Table 2: what each task is.
fn tasks(measured: &[Measured]) -> Table {
    let mut table = Table::new([
        "task",
        "variant",
        "faces",
        "image",
        "steps",
        "image error",
        "parameter error",
        "degrees of freedom, paper",
    ]);
    for group in by_variant(measured) {
        let Measured { cell, hard, parameter, steps, size, faces, .. } = group[0];
        let paper = match (cell.task, cell.variant) {
            (TaskName::Shape2d, "original") => "800 (triangles)",
            (TaskName::Shape2d, _) => "4000 (triangles)",
            (TaskName::Shape3d, _) => "3840; 1926 coordinates and a centre here",
            (TaskName::Pose, _) => "4; 3 here, the field of view being known",
            (TaskName::Occlusion, "original") => "3",
            (TaskName::Occlusion, _) => "8",
        };
        table.rows.push(vec![
            cell.task.title().to_owned(),
            cell.variant.to_owned(),
            faces.to_string(),
            format!("{size} × {size}"),
            steps.to_string(),
            hard.name.clone(),
            parameter.name.clone(),
            paper.to_owned(),
        ]);
    }
    table
}

/// The rows of one task in one variant.
fn errors(group: &[&Measured]) -> Table {
    let first = group[0];
    let reference = first.cell.method_name();
    let less = format!("less {reference}");
    let mut table = Table::new([
        "method",
        "setting",
        &first.hard.name,
        &less,
        "best step",
        &less,
        &first.parameter.name,
        "success",
        "in the paper's unit",
        "paper",
    ]);
    for one in group {
        let name = one.cell.method_name();
        let less = |errors: &[f64], of_first: &[f64]| match name == reference {
            true => String::new(),
            false => difference(errors, of_first),
        };
        let (returned, of_first) = (one.returned(), first.returned());
        let (last, best) =
            (less(&one.hard.per_run, &first.hard.per_run), less(&returned, &of_first));
        let printed = Printed::of(one.cell.task, one.cell.variant, one.cell.softness_name());
        let printed = printed.map(|printed| pair(printed.image, printed.parameter));
        let (image, parameter) = in_papers_unit(one);
        let star = if chosen(&one.cell) { "" } else { " *" };
        table.rows.push(vec![
            name,
            format!("{}{star}", one.settings),
            with_interval(&one.hard),
            last,
            short(mean(&returned)),
            best,
            with_interval(&one.parameter),
            format!("{:.0} %", 100.0 * one.success_rate),
            pair(image, parameter),
            printed.unwrap_or_default(),
        ]);
    }
    table
}

/// Table 5: what a run costs.
fn seconds(measured: &[Measured]) -> Table {
    let mut table = Table::new(["task", "variant", "method", "seconds a run", "ms a step"]);
    for one in by_variant(measured).into_iter().flatten() {
        table.rows.push(vec![
            one.cell.task.title().to_owned(),
            one.cell.variant.to_owned(),
            one.cell.method_name(),
            short(one.seconds),
            short(1e3 * one.seconds / one.steps.max(1) as f64),
        ]);
    }
    table
}

/// Whether the setting of a cell was searched for, learned, or named by its flags.
fn chosen(cell: &Cell) -> bool {
    let schedule = match cell.method.split_whitespace().collect::<Vec<_>>()[..] {
        [_] => None,
        [_, "--schedule", "static"] => Some(Schedule::Static),
        [_, "--schedule", "decay"] => Some(Schedule::Decay),
        _ => return true,
    };
    let searched = [Schedule::Static, Schedule::Decay].into_iter().any(|usual| {
        let searched = Searched::of(cell.task.name(), cell.softness(), schedule, usual);
        searched.is_some()
    });
    searched || cell.is_shipped() || Path::new(cell.softness()).exists()
}

/// Mean and interval, where there are several runs.
pub(crate) fn with_interval(error: &Error) -> String {
    let (mean, [low, high]) = (short(error.mean), error.ci95.map(short));
    if error.per_run.len() == 1 { mean } else { format!("{mean} ({low} to {high})") }
}

/// Mean and interval of the differences on the seeds that both have; in bold where one is clear.
fn difference(errors: &[f64], reference: &[f64]) -> String {
    let (mean, [low, high]) = paired(errors, reference);
    if errors.len() == 1 {
        return short(mean);
    }
    let shown = format!("{} ({} to {})", short(mean), short(low), short(high));
    if high < 0.0 || low > 0.0 { format!("**{shown}**") } else { shown }
}

fn pair(image: f64, parameter: Option<f64>) -> String {
    let parameter = parameter.map(|x| format!(" / {}", short(x))).unwrap_or_default();
    format!("{}{parameter}", short(image))
}

/// Image and parameter error in the unit of the paper's Table 3, see [`note`].
fn in_papers_unit(one: &Measured) -> (f64, Option<f64>) {
    const PAIRS_OF_POSES: f64 = 24.0;
    let original = one.cell.variant == "original";
    match one.cell.task {
        TaskName::Shape2d => (one.hard.mean, None),
        TaskName::Shape3d => {
            (one.hard.mean * if original { 100.0 } else { 1000.0 }, Some(one.parameter.mean))
        }
        TaskName::Pose => {
            let released = one.released.as_ref().map(|error| PAIRS_OF_POSES * error.mean);
            (PAIRS_OF_POSES * one.soft.mean, released)
        }
        TaskName::Occlusion => {
            let quads = one.faces as f64;
            (one.soft.mean, Some(one.parameter.mean * quads * (quads - 1.0) / 2.0))
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::Trace;

    /// A cell whose hard errors by seed are these.
    fn measured(method: &str, per_run: [f64; 3]) -> Measured {
        let task = TaskName::Pose;
        let purpose =
            if method == "learned-shape3d" { Purpose::Crossed } else { Purpose::Compared };
        let cell = Cell { task, variant: "original", method: method.to_owned(), runs: 3, purpose };
        let mean = per_run.iter().sum::<f64>() / 3.0;
        let error = json!({"name": "hard", "unit": "", "final": mean, "ci95": [0.0, 1.0], "per_run": per_run});
        let with = |key: &str| {
            let mut main = error.clone();
            main[key] = error.clone();
            main
        };
        let json: Value = json!({
            "image_error": with("hard"), "parameter_error": with("released"), "success_rate": 0.5,
            "seconds": {"per_run": 0.01}, "steps": 300, "size": 64, "faces": 9,
            "settings": {"scale": 0.03, "scale_end": 0.002, "learning_rate": 0.3},
        });
        let traces = per_run.map(|end| Trace { hard: vec![1.0, end], ..Trace::default() });
        Measured { traces: traces.to_vec(), ..Measured::new(cell, &json).unwrap() }
    }

    #[test]
    fn a_table_has_our_figures_their_differences_and_the_papers() {
        let table = markdown(
            &[measured("logistic", [0.1, 0.2, 0.3]), measured("gauss", [0.2, 0.3, 0.4])],
            "x",
            None,
        );
        let row = table.lines().find(|line| line.starts_with("| gauss")).unwrap();
        let expected = "| gauss | scale 0.03 to 0.002, rate 0.3 | 0.300 (0 to 1.00) | \
                        **0.100 (0.100 to 0.100)** | 0.300 | **0.100 (0.100 to 0.100)** | \
                        0.300 (0 to 1.00) | 50 % | 7.20 / 7.20 | 15.3 / 0.190 |";
        assert_eq!(row, expected);
    }

    #[test]
    fn what_was_learned_elsewhere_stands_in_table_6_alone() {
        let all = [("learned", 0.1), ("learned-mlp", 0.3), ("learned-shape3d", 0.2)];
        let text = markdown(&all.map(|(name, x)| measured(name, [x; 3])), "x", None);
        let (others, table) = text.split_once("## Table 6").unwrap();
        assert!(!others.contains("learned-shape3d"), "{others}");
        let rows: Vec<&str> = table.lines().filter(|line| line.starts_with("| ")).collect();
        assert_eq!(
            rows,
            ["| learned on | POSE original, hard |", "| 3D SHAPE | **0.200 (0 to 1.00)** |"]
        );
    }
}
