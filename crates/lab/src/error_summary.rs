use serde::Serialize;
use serde_json::{Map, Value, json};

use crate::{Metric, Run, mean, mean_interval};

/// One error over all runs.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ErrorSummary {
    #[serde(skip)]
    pub(crate) metric: Metric,
    /// Mean before the first step.
    pub(crate) initial: f64,
    /// Mean after the last step.
    #[serde(rename = "final")]
    pub(crate) last: f64,
    /// Mean over the runs at the returned step.
    pub(crate) returned: f64,
    /// Mean over the runs of the best over all steps.
    pub(crate) best: f64,
    /// 95 % interval of the mean of `last`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ci95: Option<[f64; 2]>,
    /// `last` of every run, in the order of the seeds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) per_run: Option<Vec<f64>>,
}

/// The metrics that runs are judged by, with their indices, sorted by key so that groups are contiguous.
pub(crate) fn errors_of(metrics: &[Metric]) -> impl Iterator<Item = (usize, Metric)> {
    let errors = metrics.iter().copied().enumerate().filter(|(_, metric)| metric.is_measure());
    let mut errors: Vec<_> = errors.collect();
    errors.sort_by_key(|(_, metric)| metric.key);
    errors.into_iter()
}

impl ErrorSummary {
    /// Summary of the metric at index `place`; the metric at index `score` determines the returned step of a run.
    pub(crate) fn new(
        metric: Metric,
        [place, score]: [usize; 2],
        runs: &[Run],
        many: bool,
    ) -> Self {
        let returned = runs.iter().filter_map(|run| Some(run.returned(score)?.values[place]));
        let returned = mean(&returned.collect::<Vec<_>>());
        let each = |pick: fn(&[f64]) -> f64| -> Vec<f64> {
            let curve = |run: &Run| run.curve.iter().map(|p| p.values[place]).collect::<Vec<_>>();
            runs.iter().map(|run| pick(&curve(run))).collect()
        };
        let last = each(|curve| curve[curve.len() - 1]);
        let best: fn(&[f64]) -> f64 = match metric.is_gain() {
            false => |curve| curve.iter().copied().fold(f64::INFINITY, f64::min),
            true => |curve| curve.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        };
        Self {
            metric,
            initial: mean(&each(|curve| curve[0])),
            last: mean(&last),
            returned,
            best: mean(&each(best)),
            ci95: many.then(|| mean_interval(&last)),
            per_run: many.then_some(last),
        }
    }
}

/// Objects by the keys of their metrics: that of `a.b` is nested in that of `a`.
pub(crate) fn nested<'a>(objects: impl Iterator<Item = (&'a Metric, Value)>) -> Map<String, Value> {
    let mut all: Map<String, Value> = Map::new();
    for (metric, mut object) in objects {
        object["name"] = metric.name.into();
        object["unit"] = metric.unit.into();
        match metric.key.split_once('.') {
            None => drop(all.insert(metric.key.into(), object)),
            Some((group, key)) => all.entry(group).or_insert_with(|| json!({}))[key] = object,
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Point, Role};

    #[test]
    fn an_error_is_returned_where_the_score_is_least() {
        let values = [[0.5, 1.0], [0.1, 2.0], [0.3, 0.5]];
        let point = |(step, values): (usize, &[f64; 2])| Point { step, values: values.to_vec() };
        let run = Run { curve: values.iter().enumerate().map(point).collect(), ..Run::default() };
        let metric = Metric { key: "angle", name: "angle", unit: "degrees", role: Role::Error };
        let error = ErrorSummary::new(metric, [1, 0], &[run], false);
        assert_eq!([error.initial, error.returned, error.last, error.best], [1.0, 2.0, 0.5, 0.5]);
    }
}
