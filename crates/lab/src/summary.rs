use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::{
    Comparison, Experiment, Outcome, Role, Run,
    format::{counted, line, short},
    mean, median, peak_rss_mib, place,
    report::{Report, Table},
};

/// The results of the runs of one experiment.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Their errors, and the number of successes.
    pub outcome: Outcome,
    returned: Returned,
    /// First of the seeds.
    pub seed: u64,
    /// Wall time of all runs, with errors and pictures.
    pub(crate) seconds: f64,
    /// Wall time of a step of a run, median, and of all steps of a run, mean.
    step_seconds: [f64; 2],
    /// Warnings for the user, each line once.
    pub warnings: Vec<String>,
    /// Finished and requested runs, if the user stopped the program.
    pub partial: Option<Partial>,
    /// Another experiment on the same seeds.
    pub baseline: Option<Box<Comparison>>,
}

/// The returned step of the runs: the one with the smallest score.
#[derive(Clone, Debug, Serialize)]
struct Returned {
    /// Name of the score.
    by: &'static str,
    /// Its value there, mean over the runs.
    error: f64,
    /// The step, median over the runs.
    step: f64,
    /// Steps of a run.
    of: usize,
}

/// Progress of stopped work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Partial {
    /// Number of finished runs.
    pub finished: usize,
    /// Number of requested runs.
    pub asked: usize,
}

impl Partial {
    /// The progress in words.
    pub fn of(self, what: &str) -> String {
        format!("{} of {} {what} are finished", self.finished, self.asked)
    }
}

impl Summary {
    /// A summary of finished runs and their wall time, with intervals if `many`.
    ///
    /// # Errors
    ///
    /// If a run has a non-finite number even before its first step.
    pub fn new(
        experiment: &dyn Experiment,
        runs: &[Run],
        seconds: f64,
        many: bool,
    ) -> anyhow::Result<Self> {
        let steps: Vec<f64> = runs.iter().flat_map(|run| run.step_seconds.clone()).collect();
        let per_run: Vec<f64> = runs.iter().map(Run::seconds).collect();
        let mut warnings: Vec<String> = Vec::new();
        for warning in runs.iter().flat_map(|run| &run.warnings) {
            if !warnings.contains(warning) {
                warnings.push(warning.clone());
            }
        }
        Ok(Self {
            returned: Returned::new(experiment, runs),
            outcome: Outcome::new(experiment, runs, many)?,
            seed: runs.first().map_or(0, |run| run.seed),
            seconds,
            step_seconds: [median(&steps), mean(&per_run)],
            warnings,
            partial: None,
            baseline: None,
        })
    }

    /// The fields of `result.json`, after the description `about`.
    pub fn json(&self, about: &Map<String, Value>, success_means: &str) -> Map<String, Value> {
        let mut json = about.clone();
        json.extend(self.outcome.json());
        json.insert("seed".into(), self.seed.into());
        json.insert("returned".into(), json!(self.returned));
        json.insert("success_means".into(), success_means.into());
        let [step_median, per_run] = self.step_seconds;
        let seconds =
            json!({ "total": self.seconds, "step_median": step_median, "per_run": per_run });
        json.insert("seconds".into(), seconds);
        json.insert("peak_memory_mib".into(), json!(peak_rss_mib()));
        json.insert("warnings".into(), json!(self.warnings));
        json.extend(self.partial.map(|partial| ("partial".into(), json!(partial))));
        json.extend(self.baseline.as_ref().map(|baseline| ("baseline".into(), baseline.json())));
        json
    }

    fn success(&self, means: &str) -> String {
        let succeeded = match self.outcome.successes[0] {
            _ if self.outcome.many => self.outcome.success_share(),
            0 => "no".to_owned(),
            _ => "yes".to_owned(),
        };
        format!("{succeeded} (asked: {means})")
    }

    /// The seeds that were run.
    pub fn seeds(&self) -> String {
        match self.outcome.successes[1] {
            1 => format!("seed {}", self.seed),
            n => {
                let last = self.seed.wrapping_add(n as u64 - 1);
                format!("means over {n} runs, seeds {} to {last}", self.seed)
            }
        }
    }

    /// A few lines for people.
    pub fn text(&self, success_means: &str) -> Vec<String> {
        let mut lines: Vec<String> =
            self.partial.iter().map(|partial| line("stopped", &partial.of("runs"))).collect();
        lines.extend(self.table().lines());
        lines.push(line("returned", &self.returned.in_words(self.outcome.successes[1])));
        lines.push(line("success", &self.success(success_means)));
        lines.push(line("time", &self.time()));
        lines.extend(self.baseline.iter().flat_map(|baseline| baseline.text()));
        lines
    }

    fn time(&self) -> String {
        let memory = peak_rss_mib().map(|mib| format!(", peak memory {mib:.0} MiB"));
        let ms = short(self.step_seconds[0] * 1e3);
        format!("{:.1} s, {ms} ms per step{}", self.seconds, memory.unwrap_or_default())
    }

    fn table(&self) -> Table {
        let interval = self.outcome.many.then_some("95 % interval of the end");
        let head = ["Error", "Start", "Returned", "End"].into_iter().chain(interval);
        let mut table = Table::new(head);
        for error in &self.outcome.errors {
            let numbers = [error.initial, error.returned, error.last].map(short);
            let interval =
                error.ci95.map(|[low, high]| format!("{} to {}", short(low), short(high)));
            table.push([error.metric.title()].into_iter().chain(numbers).chain(interval));
        }
        table
    }

    /// The results as a section of a page.
    pub fn section(&self, report: &mut Report, runs: &[Run], success_means: &str) {
        report.heading("Results");
        report.table(&self.table());
        report.labelled("Returned", &self.returned.in_words(self.outcome.successes[1]));
        report.labelled("Success", &self.success(success_means));
        let gains = match self.outcome.errors.iter().any(|error| error.metric.is_gain()) {
            false => "",
            true => ", of dB the higher",
        };
        let means =
            if self.outcome.successes[1] > 1 { " All are means over the runs." } else { "" };
        report.note(&format!(
            "The lower the better{gains}; \"returned\" is at the step that is returned.{means} {}.",
            self.time()
        ));
        if let Some(baseline) = &self.baseline {
            baseline.section(report);
        }
        if self.outcome.many {
            report.folded("Every run at its end", |report| report.table(&self.each_run(runs)));
        }
    }

    fn each_run(&self, runs: &[Run]) -> Table {
        let titles = self.outcome.errors.iter().map(|error| error.metric.title());
        let mut table =
            Table::new(["Seed".to_owned()].into_iter().chain(titles).chain(["Success".into()]));
        for (k, run) in runs.iter().enumerate() {
            let last = self.outcome.errors.iter().filter_map(|error| error.per_run.as_ref());
            let success = if run.success { "yes" } else { "no" };
            let cells = last.map(|values| short(values[k]));
            table.push([run.seed.to_string()].into_iter().chain(cells).chain([success.into()]));
        }
        table
    }
}

impl Returned {
    fn new(experiment: &dyn Experiment, runs: &[Run]) -> Self {
        let score = place(experiment.metrics(), Role::Score);
        let best = runs.iter().filter_map(|run| run.returned(score));
        let (errors, steps): (Vec<f64>, Vec<f64>) =
            best.map(|point| (point.values[score], point.step as f64)).unzip();
        let by = experiment.metrics()[score].name;
        Self { by, error: mean(&errors), step: median(&steps), of: experiment.steps() }
    }

    fn in_words(&self, runs: usize) -> String {
        let Self { by, error, step, of } = self;
        let error = short(*error);
        match runs {
            1 => format!("step {step} of {of}, where the {by} is lowest: {error}"),
            _ => format!(
                "of each run the step where the {by} is lowest: {error}; in the middle step {step} of {of}"
            ),
        }
    }
}

/// The experiment in a line: `pose (original): gauss with 1 parameter, 300 steps, seed 0`.
pub fn headline(what: &str, method: &str, parameters: usize, steps: usize, seeds: &str) -> String {
    let parameters = counted(parameters, "parameter");
    format!("{what}: {method} with {parameters}, {steps} steps, {seeds}")
}
