use anyhow::ensure;
use softrast_cli::Entry;
use softrast_cli::{InOurUnits, Variant};
use softrast_lab::{
    Encoded, Metric, Role, Run, Runner, halving::rounded, mean, mean_interval, place,
};

use crate::Cell;

/// Results of a cell.
pub struct Measured {
    /// The cell.
    pub cell: Cell,
    /// The evaluated experiment.
    pub entry: Entry,
    /// The runs, in the order of the seeds.
    pub runs: Vec<Run>,
    /// Pictures of the first run.
    pub pictures: Option<Encoded>,
    /// Time of the optimisation steps of a run, in seconds.
    pub seconds: f64,
}

/// One error over all runs at the last step.
#[derive(Clone, Debug, PartialEq)]
pub struct MeanError {
    /// Mean over the runs.
    pub mean: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
    /// Error of each run, in the order of the seeds.
    pub per_run: Vec<f64>,
}

impl Measured {
    /// Evaluates a cell, on `backend` unless it has another; finished runs are not repeated.
    ///
    /// # Errors
    ///
    /// Any error of the task.
    pub fn of(cell: &Cell, runner: &mut Runner, backend: Option<&str>) -> anyhow::Result<Self> {
        let (entry, seeds) = (cell.entry(backend)?, cell.seeds());
        runner.progress.expect(entry.solve.steps * seeds.len());
        let (mut evaluations, stopped) =
            runner.evaluate(&[entry.experiment.as_ref()], &seeds, true, Some(&cell.name))?;
        if stopped {
            return Err(softrast_lab::Error::Interrupted.into());
        }
        Self::new(cell.clone(), entry, evaluations.remove(0))
    }

    /// The results of an evaluated entry.
    pub(crate) fn new(
        cell: Cell,
        entry: Entry,
        evaluation: softrast_lab::Evaluation,
    ) -> anyhow::Result<Self> {
        let whole = evaluation.runs.iter().all(|run| !run.curve.is_empty());
        ensure!(whole, "{}: the numbers are not finite before the first step", cell.name);
        Ok(Self {
            cell,
            entry,
            seconds: evaluation.seconds_per_run(),
            runs: evaluation.runs,
            pictures: evaluation.pictures,
        })
    }

    /// Metrics measured at every point.
    pub fn metrics(&self) -> &[Metric] {
        self.entry.experiment.metrics()
    }

    /// Index of the hard image's error among the metrics; it compares methods of any width.
    pub fn hard_place(&self) -> usize {
        place(self.metrics(), Role::Score)
    }

    /// The error with this key, at the last step.
    pub fn error(&self, key: &str) -> Option<MeanError> {
        let place = self.metrics().iter().position(|metric| metric.key == key)?;
        let last = |run: &Run| run.curve[run.curve.len() - 1].values[place];
        let per_run: Vec<f64> = self.runs.iter().map(last).collect();
        Some(MeanError { mean: mean(&per_run), ci95: mean_interval(&per_run), per_run })
    }

    /// The error of the hard image.
    pub fn hard(&self) -> MeanError {
        self.error(self.metrics()[self.hard_place()].key)
            .unwrap_or_else(|| unreachable!("it is there"))
    }

    /// The error of the parameters.
    pub fn parameter(&self) -> MeanError {
        self.error("parameter_error").unwrap_or_else(|| self.hard())
    }

    /// Name and unit of the metric at index `place`.
    pub fn title(&self, place: usize) -> String {
        let Metric { name, unit, .. } = self.metrics()[place];
        if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") }
    }

    /// Hard errors of the returned steps, in the order of the seeds.
    pub fn returned(&self) -> Vec<f64> {
        let hard = self.hard_place();
        let returned = |run: &Run| run.returned(hard).map(|point| point.values[hard]);
        self.runs.iter().filter_map(returned).collect()
    }

    /// Share of runs that succeed.
    pub fn success_rate(&self) -> f64 {
        self.runs.iter().filter(|run| run.success).count() as f64 / self.runs.len() as f64
    }

    /// Whether the scale moves during a run.
    pub fn moves(&self) -> bool {
        !self.entry.method.softness.is_constant()
    }

    /// Scale before the first and at the last step, surrogate and depth scale if present, learning rate.
    pub fn setting(&self) -> String {
        let size = self.entry.solve.size;
        let [first, last] =
            [0.0, 1.0].map(|progress| plain(self.entry.method.softness.scale_at(progress, size)));
        let scale = if self.moves() {
            format!("scale {first} to {last}")
        } else {
            format!("scale {first}")
        };
        let named =
            [("surrogate_scale", "surrogate"), ("depth_scale", "depth"), ("learning_rate", "rate")];
        let others = named.iter().filter_map(|(key, name)| {
            Some(format!("{name} {}", plain(self.entry.settings.get(*key)?.as_f64()?)))
        });
        [scale].into_iter().chain(others).collect::<Vec<_>>().join(", ")
    }

    /// Image and parameter error in the unit of the paper's Table 3.
    pub fn in_papers_unit(&self) -> [Option<f64>; 2] {
        let parameters = self.metrics().iter().filter(|m| m.key.starts_with("parameter_error"));
        let mean_of = |key: &str| self.error(key).map_or(f64::NAN, |error| error.mean);
        let ours = InOurUnits {
            original: self.cell.variant == Variant::Original,
            hard: self.hard().mean,
            soft: mean_of("image_error"),
            parameters: parameters.map(|metric| mean_of(metric.key)).collect(),
            faces: self.entry.faces,
        };
        (self.cell.task.paper.in_its_unit)(&ours)
    }
}

/// A number rounded to three digits, as one would type it.
fn plain(x: f64) -> String {
    let rounded = rounded(x);
    if rounded < 1e-4 { format!("{rounded:e}") } else { rounded.to_string() }
}

/// A number with three significant digits.
pub(crate) fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    match x.abs().log10().floor() as i32 {
        digits @ -4..=2 => format!("{x:.*}", (2 - digits) as usize),
        3..6 => format!("{x:.0}"),
        _ => format!("{x:.2e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::{plain, short};

    #[test]
    fn settings_are_as_one_would_type_them() {
        assert_eq!([0.03, 0.0005, 1e-6, 0.7000001].map(plain), ["0.03", "0.0005", "1e-6", "0.7"]);
    }

    #[test]
    fn three_digits_count() {
        let shown = [0.0, 0.00123, 0.0456, 1.234, 56.78, 234.5, 12345.0, 1.5e-7].map(short);
        let expected = ["0", "0.00123", "0.0456", "1.23", "56.8", "234", "12345", "1.50e-7"];
        assert_eq!(shown, expected);
    }
}
