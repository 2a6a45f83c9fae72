use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Map, Value};

use crate::{
    Description, ErrorGroup, Measure, Run, bootstrap_mean_interval,
    error_summary::{ErrorSummary, RESAMPLES, RESAMPLING_SEED},
    evaluation::Evaluation,
    mean,
    quantity::Quantity,
    summary::short,
    wilson_interval,
};

/// A second method on the same seeds, and how the first differs from it.
#[derive(Debug, Serialize)]
pub(crate) struct Against {
    pub(crate) softness: String,
    pub(crate) parameters: usize,
    /// Seeds that both methods have solved.
    pub(crate) runs: usize,
    pub(crate) image_error: ErrorSummary,
    pub(crate) parameter_error: ErrorSummary,
    pub(crate) success_rate: f64,
    pub(crate) success_ci95: [f64; 2],
    /// Wall time of its runs.
    pub(crate) seconds: f64,
    pub(crate) difference: Differences,
    pub(crate) settings: Map<String, Value>,
    /// What to call the two methods.
    #[serde(skip)]
    pub(crate) titles: [String; 2],
}

/// The errors of the first method at the last step less those of the second, seed by seed.
#[derive(Debug, Serialize)]
pub(crate) struct Differences {
    pub(crate) image_error: Difference,
    pub(crate) parameter_error: Difference,
}

/// How two methods differ in one error; below 0 the first is the better one.
#[derive(Debug, Serialize)]
pub(crate) struct Difference {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
    pub(crate) mean: f64,
    /// Of the mean.
    pub(crate) ci95: [f64; 2],
    /// Share of the seeds on which the first has the smaller error.
    pub(crate) first_better: f64,
    /// Share of the seeds on which the second has.
    pub(crate) second_better: f64,
    /// In the order of the seeds.
    pub(crate) per_run: Vec<f64>,
    #[serde(flatten)]
    pub(crate) more: BTreeMap<&'static str, Difference>,
}

impl Against {
    /// Compares two methods, each with its description, on the seeds that both have solved, which
    /// come first in both.
    pub(crate) fn new(
        (one, first): (&Description, &Evaluation),
        (description, second): (&Description, &Evaluation),
    ) -> Self {
        let runs = first.runs.len().min(second.runs.len());
        let (seconds, first, second) = (second.seconds, &first.runs[..runs], &second.runs[..runs]);
        let successes = second.iter().filter(|run| run.success).count();
        let group = |group| ErrorSummary::of_group(group, description, second, true);
        let difference = |group| Difference::of_group(group, description, first, second);
        Self {
            softness: description.softness.clone(),
            parameters: description.parameters,
            runs,
            image_error: group(ErrorGroup::Image),
            parameter_error: group(ErrorGroup::Parameter),
            success_rate: successes as f64 / runs as f64,
            success_ci95: wilson_interval(successes, runs),
            seconds,
            difference: Differences {
                image_error: difference(ErrorGroup::Image),
                parameter_error: difference(ErrorGroup::Parameter),
            },
            settings: description.settings.clone(),
            titles: [title(one, description), title(description, one)],
        }
    }

    /// The differences in all errors, in the order of the results.
    pub(crate) fn differences(&self) -> impl Iterator<Item = &Difference> {
        let main = [&self.difference.image_error, &self.difference.parameter_error];
        main.into_iter().flat_map(|one| std::iter::once(one).chain(one.more.values()))
    }

    /// A few lines for people.
    pub(crate) fn lines(&self) -> Vec<String> {
        let mut lines =
            vec![format!("  against {}, on the same {} seeds:", self.titles[1], self.runs)];
        for (difference, second) in self.differences().zip(self.errors()) {
            let [low, high] = difference.ci95.map(short);
            lines.push(format!(
                "    {:<20} {} there; difference {}, 95 % interval {low} to {high}: {}; better on \
                 {:.0} % of seeds, worse on {:.0} %",
                difference.name,
                short(second.last),
                short(difference.mean),
                difference.verdict(),
                difference.first_better * 100.0,
                difference.second_better * 100.0,
            ));
        }
        lines.push(format!(
            "    {:<20} {:.1} % of runs there",
            "success",
            self.success_rate * 100.0
        ));
        lines
    }

    /// The errors of the second method, in the same order.
    pub(crate) fn errors(&self) -> impl Iterator<Item = &ErrorSummary> {
        let main = [&self.image_error, &self.parameter_error];
        main.into_iter().flat_map(|one| std::iter::once(one).chain(one.more.values()))
    }
}

/// The softness of a method, and where the other has the same what else is different.
fn title(one: &Description, other: &Description) -> String {
    if one.softness != other.softness {
        return one.softness.clone();
    }
    let differs =
        one.settings.iter().filter(|(key, value)| other.settings.get(*key) != Some(value));
    let named = differs.map(|(key, value)| {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        format!("{} {value}", key.replace('_', " "))
    });
    let named: Vec<String> = [one.softness.clone()].into_iter().chain(named).collect();
    named.join(", ")
}

impl Difference {
    fn of_group(
        group: ErrorGroup,
        description: &Description,
        first: &[Run],
        second: &[Run],
    ) -> Self {
        let (main, more) = Quantity::group(group, description);
        let of = |quantity: Quantity| Self::new(quantity, description, first, second);
        let more = more.into_iter().map(|(key, quantity)| (key, of(quantity))).collect();
        Self { more, ..of(main) }
    }

    fn new(quantity: Quantity, description: &Description, first: &[Run], second: &[Run]) -> Self {
        let last = |run: &Run| quantity.of(&run.curve[run.curve.len() - 1]);
        let pairs = first.iter().zip(second);
        let per_run: Vec<f64> = pairs.map(|(one, two)| last(one) - last(two)).collect();
        let share = |of: fn(f64) -> bool| {
            per_run.iter().filter(|&&x| of(x)).count() as f64 / per_run.len() as f64
        };
        let Measure { name, unit } = quantity.measure(description);
        Self {
            name,
            unit,
            mean: mean(&per_run),
            ci95: bootstrap_mean_interval(&per_run, RESAMPLES, RESAMPLING_SEED),
            first_better: share(|x| x < 0.0),
            second_better: share(|x| x > 0.0),
            per_run,
            more: BTreeMap::new(),
        }
    }

    /// Whether the interval of the mean leaves no doubt which method is the better one.
    pub(crate) fn verdict(&self) -> &'static str {
        match self.ci95 {
            [_, high] if high < 0.0 => "better",
            [low, _] if low > 0.0 => "worse",
            _ => "no clear difference",
        }
    }
}
