use std::path::PathBuf;

use serde::Serialize;

use crate::{
    Command, Description, ErrorGroup, Run, Settings, against::Against, error_summary::ErrorSummary,
    evaluation::Evaluation, folder, median, peak_rss_mib, returned::Returned,
    search_summary::SearchSummary, wilson_interval,
};

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
    /// Which step of each run is returned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) returned: Option<Returned>,
    pub(crate) success_rate: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) success_ci95: Option<[f64; 2]>,
    pub(crate) success_means: String,
    pub(crate) seconds: Seconds,
    pub(crate) peak_memory_mib: Option<f64>,
    pub(crate) settings: serde_json::Map<String, serde_json::Value>,
    pub(crate) warnings: Vec<String>,
    /// There where the user stopped the program before all runs were finished.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) partial: Option<Partial>,
    /// There where a second method was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) against: Option<Against>,
    /// There where the settings were searched for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) search: Option<SearchSummary>,
    pub(crate) out: PathBuf,
}

/// How much of a job is finished.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Partial {
    pub(crate) finished: usize,
    pub(crate) asked: usize,
}

#[derive(Debug, Serialize)]
pub(crate) struct Seconds {
    /// Wall time of all runs, with metrics and pictures.
    pub(crate) total: f64,
    /// Wall time of one optimisation step of one batch.
    pub(crate) step_median: f64,
    /// Wall time of the optimisation steps that a run takes, its share of a batch.
    pub(crate) per_run: f64,
}

impl Summary {
    /// Of a finished or partial evaluation, which has one run at least.
    pub(crate) fn new(
        task: &'static str,
        command: Command,
        settings: &Settings,
        description: &Description,
        evaluation: &Evaluation,
        out: PathBuf,
    ) -> Self {
        let runs = &evaluation.runs;
        let many = command != Command::Solve;
        let error = |group| ErrorSummary::of_group(group, description, runs, many);
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
            image_error: error(ErrorGroup::Image),
            parameter_error: error(ErrorGroup::Parameter),
            returned: None,
            success_rate: successes as f64 / runs.len() as f64,
            success_ci95: many.then(|| wilson_interval(successes, runs.len())),
            success_means: description.success.clone(),
            seconds: Seconds {
                total: evaluation.seconds,
                step_median: median(&steps),
                per_run: evaluation.step_seconds / runs.len().max(1) as f64,
            },
            peak_memory_mib: peak_rss_mib(),
            settings: description.settings.clone(),
            warnings: distinct_warnings(runs),
            partial: None,
            against: None,
            search: None,
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
        lines.extend(self.search.iter().flat_map(SearchSummary::lines));
        lines.extend(
            self.partial.map(|partial| format!("  {:<22} {}", "stopped", partial.says("runs"))),
        );
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
        lines.extend(self.returned.iter().map(|r| format!("  {:<22} {}", "returned", r.says())));
        lines.push(format!("  {:<22} {}", "success", self.success()));
        let memory = self.peak_memory_mib.map(|mib| format!(", peak memory {mib:.0} MiB"));
        lines.push(format!(
            "  {:<22} {:.1} s, {} ms per step{}",
            "time",
            self.seconds.total,
            short(self.seconds.step_median * 1e3),
            memory.unwrap_or_default()
        ));
        lines.extend(self.against.iter().flat_map(Against::lines));
        lines.push(format!("  {:<22} {}", "report", self.out.join(folder::REPORT).display()));
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

impl Partial {
    /// How much that is, in words.
    pub(crate) fn says(self, what: &str) -> String {
        format!("{} of {} {what} are finished", self.finished, self.asked)
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
