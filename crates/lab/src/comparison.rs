use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::{
    Evaluation, Experiment, Metric, Outcome, Run,
    error_summary::{errors_of, nested},
    format::short,
    mean, mean_interval,
    report::{Report, Table},
    statistics::mean_interval_at,
};

/// A second experiment on the same seeds, and the differences of the first to it.
#[derive(Clone, Debug)]
pub struct Comparison {
    titles: [String; 2],
    about: Map<String, Value>,
    /// Outcome on the seeds that both have solved.
    second: Outcome,
    /// Wall time of the second experiment's runs.
    seconds: f64,
    differences: Vec<Difference>,
}

/// Difference of two experiments in one metric at the last step; below 0 the first has the smaller value.
#[derive(Clone, Debug, Serialize)]
struct Difference {
    #[serde(skip)]
    metric: Metric,
    mean: f64,
    ci95: [f64; 2],
    /// Shares of the seeds on which either is better.
    first_better: f64,
    second_better: f64,
    per_run: Vec<f64>,
}

/// Mean of the elementwise differences of two lists, and its interval, which is jointly at 95 % for this number of `comparisons`.
/// Source: Bonferroni's correction.
pub fn paired_among(comparisons: usize, values: &[f64], reference: &[f64]) -> (f64, [f64; 2]) {
    let differences: Vec<f64> = values.iter().zip(reference).map(|(a, b)| a - b).collect();
    let level = 1.0 - 0.05 / comparisons.max(1) as f64;
    (mean(&differences), mean_interval_at(level, &differences))
}

impl Comparison {
    /// Compares two experiments on the seeds that both have solved, which come first in both.
    /// `titles` are their names, `about` is the description of the second in the results.
    ///
    /// # Errors
    ///
    /// If a run of the second has a non-finite number even before its first step.
    pub fn new(
        titles: [String; 2],
        about: Map<String, Value>,
        experiment: &dyn Experiment,
        first: &Evaluation,
        second: &Evaluation,
    ) -> anyhow::Result<Self> {
        let runs = first.runs.len().min(second.runs.len());
        let (first, others) = (&first.runs[..runs], &second.runs[..runs]);
        let seconds = second.seconds;
        let second = Outcome::new(experiment, others, true)?;
        let errors = errors_of(experiment.metrics());
        let differences = errors.map(|(k, metric)| Difference::new(metric, k, first, others));
        Ok(Self { titles, about, second, seconds, differences: differences.collect() })
    }

    pub(crate) fn json(&self) -> Value {
        let mut json = self.about.clone();
        json.extend(self.second.json());
        json.insert("seconds".into(), self.seconds.into());
        let differences = self.differences.iter().map(|one| (&one.metric, json!(one)));
        json.insert("difference".into(), nested(differences).into());
        json.into()
    }

    /// The seeds that both have solved, and the success rate of the second on them.
    fn head(&self) -> String {
        let (runs, success) = (self.second.successes[1], self.second.success_share());
        format!("on the same {runs} seeds, at the last step; it succeeds in {success}")
    }

    fn table(&self) -> Table {
        let head = ["Error", "First", "Second", "Mean difference", "95 % interval"];
        let shares = ["First better", "Second better", "First is"];
        let mut table = Table::new(head.into_iter().chain(shares));
        for (difference, error) in self.differences.iter().zip(&self.second.errors) {
            let [low, high] = difference.ci95.map(short);
            table.push([
                error.metric.title(),
                short(error.last + difference.mean),
                short(error.last),
                short(difference.mean),
                format!("{low} to {high}"),
                format!("{:.0} %", difference.first_better * 100.0),
                format!("{:.0} %", difference.second_better * 100.0),
                difference.verdict().to_owned(),
            ]);
        }
        table
    }

    pub(crate) fn text(&self) -> Vec<String> {
        let mut lines = vec![format!("  against {}, {}:", self.titles[1], self.head())];
        lines.extend(self.table().lines());
        lines
    }

    pub(crate) fn section(&self, report: &mut Report) {
        let [first, second] = &self.titles;
        report.heading(&format!("Against {second}"));
        report.paragraph(&format!("The second method {}.", self.head()));
        report.table(&self.table());
        report.note(&format!(
            "A difference below 0 means that the first method ({first}) has the smaller value. On the charts it is blue, the second \
             ({second}) is orange. Intervals are Student's over the seeds, that of the success is Wilson's."
        ));
    }
}

impl Difference {
    fn new(metric: Metric, place: usize, first: &[Run], second: &[Run]) -> Self {
        let last = |run: &Run| run.curve[run.curve.len() - 1].values[place];
        let per_run: Vec<f64> =
            first.iter().zip(second).map(|(one, two)| last(one) - last(two)).collect();
        let worse = if metric.is_gain() { -1.0 } else { 1.0 };
        let share = |of: fn(f64) -> bool| {
            per_run.iter().filter(|&&x| of(worse * x)).count() as f64 / per_run.len() as f64
        };
        Self {
            metric,
            mean: mean(&per_run),
            ci95: mean_interval(&per_run),
            first_better: share(|x| x < 0.0),
            second_better: share(|x| x > 0.0),
            per_run,
        }
    }

    /// The verdict: `better` or `worse` if the interval of the mean excludes 0.
    fn verdict(&self) -> &'static str {
        let [below, above] = match self.metric.is_gain() {
            false => ["better", "worse"],
            true => ["worse", "better"],
        };
        match self.ci95 {
            [_, high] if high < 0.0 => below,
            [low, _] if low > 0.0 => above,
            _ => "no clear difference",
        }
    }
}
