use std::path::Path;

use anyhow::Context;
use serde_json::Value;
use softrast_runner::{bootstrap_mean_interval, mean};

use crate::{Cell, Trace};

/// Samples behind the interval of a difference, and their seed.
const RESAMPLES: usize = 10_000;
const RESAMPLING_SEED: u64 = 0;

/// What a cell came to, at the last step.
#[derive(Clone, Debug)]
pub struct Measured {
    /// The cell.
    pub cell: Cell,
    /// Error of the hard image, which compares methods of any width.
    pub hard: Error,
    /// Error of the method's own soft image.
    pub soft: Error,
    /// Error of the parameters.
    pub parameter: Error,
    /// POSE: the error of the parameters as the released curves have it.
    pub released: Option<Error>,
    /// Share of runs that succeed.
    pub success_rate: f64,
    /// Time of the optimisation steps of a run, in seconds: its share of a batch.
    pub seconds: f64,
    /// How each run went on, in the order of the seeds.
    pub traces: Vec<Trace>,
    /// Steps, pixels along a side of the image, and faces.
    pub steps: u64,
    /// Width and height of the image, in pixels.
    pub size: u64,
    /// Faces of the scene.
    pub faces: u64,
    /// Scale at the last step, where there is one, in NDC (NDC² if squared).
    pub scale_end: Option<f64>,
    /// Whether the softness sees the squared distance.
    pub squared: bool,
    /// Scale before the first and at the last step, depth scale if there is one, learning rate.
    pub settings: String,
}

/// One error over all runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Error {
    /// Name and unit.
    pub name: String,
    /// Mean over the runs, and its 95 % interval.
    pub mean: f64,
    /// Of the mean.
    pub ci95: [f64; 2],
    /// In the order of the seeds.
    pub per_run: Vec<f64>,
}

impl Measured {
    /// From the JSON line of `evaluate`.
    ///
    /// # Errors
    ///
    /// If something is not there that `evaluate` writes.
    pub fn new(cell: Cell, json: &Value) -> anyhow::Result<Self> {
        let number = |pointer: &str| {
            let number = json.pointer(pointer).and_then(Value::as_f64);
            number.with_context(|| format!("a result has no number {pointer}"))
        };
        let whole = |key: &str| {
            json[key].as_u64().with_context(|| format!("a result has no whole number {key}"))
        };
        let settings = &json["settings"];
        let named = |(key, name): (&str, &str)| {
            settings[key].as_f64().map(|value| format!("{name} {}", plain(value)))
        };
        let first = settings["scale"].as_f64();
        let end =
            [("scale_end", "to")].into_iter().filter(|_| first != settings["scale_end"].as_f64());
        let names = [("scale", "scale")].into_iter().chain(end);
        let names = names.chain([
            ("surrogate_scale", "surrogate"),
            ("depth_scale", "depth"),
            ("learning_rate", "rate"),
        ]);
        let released = &json["parameter_error"]["released"];
        Ok(Self {
            hard: Error::new(&json["image_error"]["hard"])?,
            soft: Error::new(&json["image_error"])?,
            parameter: Error::new(&json["parameter_error"])?,
            released: released.is_object().then(|| Error::new(released)).transpose()?,
            success_rate: number("/success_rate")?,
            seconds: number("/seconds/per_run")?,
            traces: Vec::new(),
            scale_end: settings["scale_end"].as_f64(),
            squared: settings["squared"].as_bool() == Some(true),
            steps: whole("steps")?,
            size: whole("size")?,
            faces: whole("faces")?,
            settings: names.filter_map(named).collect::<Vec<_>>().join(", ").replace(", to", " to"),
            cell,
        })
    }
}

impl Measured {
    /// Whether the scale moves during a run.
    pub(crate) fn moves(&self) -> bool {
        self.settings.contains(" to ")
    }

    /// Hard errors of the steps that the runs return, in the order of the seeds.
    pub(crate) fn returned(&self) -> Vec<f64> {
        self.traces.iter().filter_map(|trace| trace.lowest().last()).collect()
    }

    /// With the curves that `evaluate` has left in its folder.
    ///
    /// # Errors
    ///
    /// If they are not there or cannot be read.
    pub fn with_traces(mut self, folder: &Path) -> anyhow::Result<Self> {
        self.traces = Trace::load(&folder.join("curve.csv"))?;
        Ok(self)
    }
}

impl Error {
    fn new(json: &Value) -> anyhow::Result<Self> {
        let numbers = |key: &str| -> anyhow::Result<Vec<f64>> {
            let list = json[key].as_array().with_context(|| format!("an error has no {key}"))?;
            let number = |x: &Value| x.as_f64().with_context(|| format!("{key}: {x} is no number"));
            list.iter().map(number).collect()
        };
        let ci95 = numbers("ci95")?;
        let ci95 = ci95.try_into().ok().context("an interval has two ends")?;
        let [name, unit] = ["name", "unit"].map(|key| json[key].as_str().unwrap_or_default());
        let name = if unit.is_empty() { name.to_owned() } else { format!("{name}, {unit}") };
        let mean = json["final"].as_f64().context("an error has no mean")?;
        Ok(Self { name, mean, ci95, per_run: numbers("per_run")? })
    }
}

/// Mean and 95 % interval of the differences on the seeds that both have.
pub(crate) fn paired(errors: &[f64], reference: &[f64]) -> (f64, [f64; 2]) {
    let differences: Vec<f64> = errors.iter().zip(reference).map(|(a, b)| a - b).collect();
    let interval = bootstrap_mean_interval(&differences, RESAMPLES, RESAMPLING_SEED);
    (mean(&differences), interval)
}

/// A number with three digits that count.
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

/// A number of three digits as one would type it.
fn plain(x: f64) -> String {
    let rounded = format!("{x:.2e}").parse().unwrap_or(x);
    if rounded < 1e-4 { format!("{rounded:e}") } else { rounded.to_string() }
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
