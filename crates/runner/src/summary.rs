use std::{collections::BTreeMap, path::PathBuf};

use serde::Serialize;

use crate::{
    Command, Description, ErrorGroup, Measure, Run, Settings, bootstrap_mean_interval, mean,
    median, peak_rss_mib, task::Point, wilson_interval,
};

/// Samples behind a confidence interval, and the seed that draws them.
const RESAMPLES: usize = 10_000;
const RESAMPLING_SEED: u64 = 0;

/// What a program found out, as it stands in `result.json`.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    pub(crate) task: &'static str,
    pub(crate) command: &'static str,
    pub(crate) variant: &'static str,
    pub(crate) softness: String,
    pub(crate) parameters: usize,
    pub(crate) backend: String,
    pub(crate) seed: u64,
    pub(crate) runs: usize,
    pub(crate) steps: usize,
    pub(crate) size: usize,
    pub(crate) faces: usize,
    pub(crate) image_error: ErrorSummary,
    pub(crate) parameter_error: ErrorSummary,
    pub(crate) success_rate: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) success_ci95: Option<[f64; 2]>,
    pub(crate) success_means: String,
    pub(crate) seconds: Seconds,
    pub(crate) peak_memory_mib: Option<f64>,
    pub(crate) settings: serde_json::Map<String, serde_json::Value>,
    pub(crate) warnings: Vec<String>,
    pub(crate) out: PathBuf,
}

/// One error over all runs: means over the runs, each run's own value where there may be several.
#[derive(Debug, Serialize)]
pub(crate) struct ErrorSummary {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    /// Before the first step.
    pub(crate) initial: f64,
    /// After the last step.
    #[serde(rename = "final")]
    pub(crate) last: f64,
    /// Lowest over all steps.
    pub(crate) best: f64,
    /// Of the mean of `last`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ci95: Option<[f64; 2]>,
    /// `last` of every run, in the order of the seeds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) per_run: Option<Vec<f64>>,
    #[serde(flatten)]
    pub(crate) more: BTreeMap<&'static str, ErrorSummary>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Seconds {
    /// Wall time of all runs, with metrics and pictures.
    pub(crate) total: f64,
    /// Wall time of one optimisation step of one batch.
    pub(crate) step_median: f64,
}

impl Summary {
    pub(crate) fn new(
        task: &'static str,
        command: Command,
        settings: &Settings,
        description: &Description,
        runs: &[Run],
        seconds: f64,
        out: PathBuf,
    ) -> Self {
        let many = command == Command::Evaluate;
        let error = |group, measure, main: fn(&Point) -> f64| {
            let mut error = ErrorSummary::new(measure, runs, many, main);
            for (k, extra) in description.extra.iter().enumerate().filter(|(_, e)| e.group == group)
            {
                let more = ErrorSummary::new(extra.measure, runs, many, |point| point.extra[k]);
                error.more.insert(extra.key, more);
            }
            error
        };
        let successes = runs.iter().filter(|run| run.success).count();
        let steps: Vec<f64> = runs.iter().flat_map(|run| run.step_seconds.clone()).collect();
        Self {
            task,
            command: command.name(),
            variant: settings.variant.name(),
            softness: description.softness.clone(),
            parameters: description.parameters,
            backend: description.backend.clone(),
            seed: settings.seed,
            runs: runs.len(),
            steps: description.steps,
            size: description.size,
            faces: description.faces,
            image_error: error(ErrorGroup::Image, description.image_error, |p| p.image_error),
            parameter_error: error(ErrorGroup::Parameter, description.parameter_error, |p| {
                p.parameter_error
            }),
            success_rate: successes as f64 / runs.len() as f64,
            success_ci95: many.then(|| wilson_interval(successes, runs.len())),
            success_means: description.success.clone(),
            seconds: Seconds { total: seconds, step_median: median(&steps) },
            peak_memory_mib: peak_rss_mib(),
            settings: description.settings.clone(),
            warnings: distinct_warnings(runs),
            out,
        }
    }

    /// All errors with their rank in the results: the image error and its like, then the other.
    pub(crate) fn errors(&self) -> impl Iterator<Item = &ErrorSummary> {
        let main = [&self.image_error, &self.parameter_error];
        main.into_iter().flat_map(|error| std::iter::once(error).chain(error.more.values()))
    }

    /// The first warnings, and how many more there are.
    pub(crate) fn first_warnings(&self) -> Vec<String> {
        const SHOWN: usize = 3;
        let mut shown: Vec<String> = self.warnings.iter().take(SHOWN).cloned().collect();
        match self.warnings.len().saturating_sub(SHOWN) {
            0 => {}
            more => shown.push(format!("and {more} more, listed in result.json")),
        }
        shown
    }

    /// A few lines for people.
    pub(crate) fn text(&self) -> String {
        let mut lines = vec![self.head()];
        for error in self.errors() {
            let [initial, last, best] = [error.initial, error.last, error.best].map(short);
            let interval = match error.ci95 {
                Some([low, high]) => format!("; 95 % interval {} to {}", short(low), short(high)),
                None => String::new(),
            };
            let unit = error.unit;
            let space = if unit.is_empty() { "" } else { " " };
            lines.push(format!(
                "  {:<22} {initial} -> {last}{space}{unit} (best {best}{interval})",
                error.name
            ));
        }
        lines.push(format!("  {:<22} {}", "success", self.success()));
        let memory = self.peak_memory_mib.map(|mib| format!(", peak memory {mib:.0} MiB"));
        lines.push(format!(
            "  {:<22} {:.1} s, {} ms per step{}",
            "time",
            self.seconds.total,
            short(self.seconds.step_median * 1e3),
            memory.unwrap_or_default()
        ));
        lines.push(format!("  {:<22} {}", "report", self.out.join("report.html").display()));
        lines.join("\n")
    }

    /// What was run, in a line.
    pub(crate) fn head(&self) -> String {
        let parameters = match self.parameters {
            1 => "1 parameter".to_owned(),
            n => format!("{n} parameters"),
        };
        let seeds = match self.runs {
            1 => format!("seed {}", self.seed),
            n => {
                let last = self.seed.wrapping_add(n as u64 - 1);
                format!("means over {n} runs, seeds {} to {last}", self.seed)
            }
        };
        let (task, variant, softness, steps) =
            (self.task, self.variant, &self.softness, self.steps);
        format!("{task} ({variant}): {softness} with {parameters}, {steps} steps, {seeds}")
    }

    /// How often the runs succeeded and what that means.
    pub(crate) fn success(&self) -> String {
        let asked = &self.success_means;
        match self.success_ci95 {
            None if self.success_rate > 0.0 => format!("yes (asked: {asked})"),
            None => format!("no (asked: {asked})"),
            Some([low, high]) => format!(
                "{:.1} % of runs, 95 % interval {:.1} to {:.1} % (asked: {asked})",
                self.success_rate * 100.0,
                low * 100.0,
                high * 100.0
            ),
        }
    }
}

fn distinct_warnings(runs: &[Run]) -> Vec<String> {
    let mut warnings = Vec::new();
    for warning in runs.iter().flat_map(|run| &run.warnings) {
        if !warnings.contains(warning) {
            warnings.push(warning.clone());
        }
    }
    warnings
}

impl ErrorSummary {
    /// Name with the unit.
    pub(crate) fn title(&self) -> String {
        Measure { name: self.name, unit: self.unit }.title()
    }

    fn new(measure: Measure, runs: &[Run], many: bool, of: impl Fn(&Point) -> f64) -> Self {
        let each = |pick: fn(&[f64]) -> f64| -> Vec<f64> {
            runs.iter().map(|run| pick(&run.curve.iter().map(&of).collect::<Vec<_>>())).collect()
        };
        let last = each(|curve| curve[curve.len() - 1]);
        Self {
            name: measure.name,
            unit: measure.unit,
            initial: mean(&each(|curve| curve[0])),
            last: mean(&last),
            best: mean(&each(|curve| curve.iter().copied().fold(f64::INFINITY, f64::min))),
            ci95: many.then(|| bootstrap_mean_interval(&last, RESAMPLES, RESAMPLING_SEED)),
            per_run: many.then_some(last),
            more: BTreeMap::new(),
        }
    }
}

/// A number with about four digits that count.
pub(crate) fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".into(),
        1e-3..1.0 => format!("{x:.4}"),
        1.0..10.0 => format!("{x:.3}"),
        10.0..100.0 => format!("{x:.2}"),
        100.0..1e3 => format!("{x:.1}"),
        1e3..1e6 => format!("{x:.0}"),
        _ => format!("{x:.3e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_are_cut_to_about_four_digits() {
        let shown = [0.0, 0.012345, 1.23456, -12.3456, 123.456, 12345.6, 1e-9, 2.5e7].map(short);
        let expected = ["0", "0.0123", "1.235", "-12.35", "123.5", "12346", "1.000e-9", "2.500e7"];
        assert_eq!(shown, expected);
    }
}
