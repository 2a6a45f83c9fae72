use std::time::Instant;

use serde::Serialize;

use crate::{
    Experiment, Runner,
    format::{short, short_or_none},
    mean,
    report::{Report, Table},
};

/// One answer to a question of a selection.
pub struct Candidate<A> {
    /// The flags of this answer.
    pub flags: String,
    /// Its resources, such as `2 parameters`.
    pub with: String,
    /// The experiment to run.
    pub experiment: Box<dyn Experiment>,
    /// The caller's value, returned for the chosen answer.
    pub answer: A,
}

/// One question, and the cheapest of its answers that is as good as the best.
///
/// As good means: its error exceeds that of the best by at most one standard error of their difference, paired by seed.
/// Source: Breiman et al. 1984, Sec. 3.4.3 (the one-standard-error rule).
#[derive(Clone, Debug, Serialize)]
pub struct Selection {
    /// The subject of the question, such as `softness`.
    of: &'static str,
    /// Indices among the reasons: of the chosen answer, and of the one with the smallest error.
    chosen: usize,
    best: usize,
    /// All tried answers, the cheapest first.
    reasons: Vec<Reason>,
}

/// An answer and its results.
#[derive(Clone, Debug, Serialize)]
struct Reason {
    flags: String,
    with: String,
    /// Error of the returned step for each seed, in their order; `None` if not finite.
    errors: Vec<Option<f64>>,
    /// Time of the steps of one run.
    seconds: f64,
    /// Mean error; `None` if a run has no finite error.
    mean: Option<f64>,
    /// Mean difference from the best, and its standard error.
    above_best: Option<f64>,
    standard_error: Option<f64>,
    verdict: &'static str,
}

/// Remaining time for trials.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    /// Seconds.
    pub left: f64,
    /// Whether it has sufficed so far.
    pub lasted: bool,
}

impl Runner {
    /// Tries the answers to one question in their order, and returns the cheapest that is as good as the best, with the reasons. None if no
    /// answer has only finite errors.
    ///
    /// The first answer is always tried. A further one is skipped if it would exceed the budget; it is expected to take as long as the mean
    /// of those before. Runs already in the store cost nothing. Shards have no budget: they share all answers.
    ///
    /// # Errors
    ///
    /// The errors of the experiments and of the store.
    pub fn select<A>(
        &mut self,
        of: &'static str,
        candidates: Vec<Candidate<A>>,
        seeds: &[u64],
        budget: &mut Budget,
    ) -> anyhow::Result<Option<(A, Selection)>> {
        let experiments: Vec<_> = candidates.iter().map(|one| one.experiment.as_ref()).collect();
        self.complete(&experiments, seeds)?;
        let (mut reasons, mut answers, mut spent) = (Vec::new(), Vec::new(), Vec::new());
        for Candidate { flags, with, experiment, answer } in candidates {
            let known = self.is_finished(experiment.as_ref(), seeds);
            if !known && !spent.is_empty() && mean(&spent) > budget.left {
                budget.lasted = false;
                continue;
            }
            let clock = Instant::now();
            let (errors, tried) = self.score(experiment.as_ref(), seeds, &flags)?;
            if !known {
                spent.push(clock.elapsed().as_secs_f64());
                budget.left -= spent[spent.len() - 1];
            }
            reasons.push(Reason::new(flags, with, errors, tried.seconds_per_run()));
            answers.push(answer);
        }
        let selection = Selection::select(of, reasons);
        Ok(selection.map(|selection| (answers.swap_remove(selection.chosen), selection)))
    }
}

impl Reason {
    fn new(flags: String, with: String, errors: Vec<Option<f64>>, seconds: f64) -> Self {
        let mean = errors.iter().copied().collect::<Option<Vec<f64>>>().map(|all| mean(&all));
        let (above_best, standard_error, verdict) = (None, None, "not finite");
        Self { flags, with, errors, seconds, mean, above_best, standard_error, verdict }
    }
}

impl Selection {
    /// Selects among answers in ascending cost; `None` if no answer has only finite errors.
    fn select(of: &'static str, mut reasons: Vec<Reason>) -> Option<Self> {
        let finite = reasons.iter().enumerate().filter_map(|(k, reason)| Some((k, reason.mean?)));
        let (best, _) = finite.reduce(|a, b| if b.1 < a.1 { b } else { a })?;
        let relative: Vec<Option<[f64; 2]>> = reasons
            .iter()
            .map(|reason| difference(&reason.errors, &reasons[best].errors))
            .collect();
        let as_good = |k: &usize| relative[*k].is_some_and(|[above, error]| above <= error);
        let chosen = (0..reasons.len()).find(as_good).unwrap_or(best);
        for (k, reason) in reasons.iter_mut().enumerate() {
            reason.above_best = relative[k].map(|[above, _]| above);
            reason.standard_error = relative[k].map(|[_, error]| error);
            reason.verdict = match relative[k] {
                _ if k == chosen => "chosen",
                None => "not finite",
                Some(_) if as_good(&k) && k == best => "best, but no simpler",
                Some(_) if as_good(&k) => "as good, but no simpler",
                Some(_) => "worse",
            };
        }
        Some(Self { of, chosen, best, reasons })
    }

    fn answer(&self) -> &Reason {
        &self.reasons[self.chosen]
    }

    /// The reasons, with the chosen answer marked.
    pub fn table(&self) -> Table {
        let mut table =
            Table::new([self.of, "with", "error", "above best", "s per run", "verdict"]);
        for (k, reason) in self.reasons.iter().enumerate() {
            let [mean, above, error] =
                [reason.mean, reason.above_best, reason.standard_error].map(short_or_none);
            let above = format!("{above} (se {error})");
            let (flags, with) = (reason.flags.clone(), reason.with.clone());
            let (seconds, verdict) = (short(reason.seconds), reason.verdict.to_owned());
            table.push([flags, with, mean, above, seconds, verdict]);
            if k == self.chosen {
                table.choose_last();
            }
        }
        table
    }
}

/// The flags of all chosen answers, on one line.
pub fn chosen_flags(stages: &[Selection]) -> String {
    stages.iter().map(|stage| stage.answer().flags.as_str()).collect::<Vec<_>>().join(" ")
}

/// Cost and gain of the choices relative to the best answer to the first question; empty without questions.
pub fn cost(stages: &[Selection]) -> String {
    let (Some(first), Some(last)) = (stages.first(), stages.last()) else {
        return String::new();
    };
    let (best, chosen) = (&first.reasons[first.best], last.answer());
    format!(
        "an error of {} in {} s, where the least of all methods is {} in {} s, of {}",
        short_or_none(chosen.mean),
        short(chosen.seconds),
        short_or_none(best.mean),
        short(best.seconds),
        best.flags
    )
}

/// The choices and their reasons as a section of a page.
pub fn section(stages: &[Selection], report: &mut Report) {
    report.heading("Chosen");
    report.code(&chosen_flags(stages));
    report.paragraph(&format!("Its cost: {}.", cost(stages)));
    report.heading("Reasons");
    stages.iter().for_each(|stage| report.table(&stage.table()));
    report.note(
        "Each table starts from what the one before chose, and goes from the cheapest to the costliest. The first whose error is \
         above that of the best by no more than one standard error (se) of their difference, seed by seed, is chosen. Seconds are \
         those of the optimisation steps.",
    );
}

/// Mean paired difference of errors to the best ones, and its standard error.
fn difference(errors: &[Option<f64>], best: &[Option<f64>]) -> Option<[f64; 2]> {
    let pairs = errors.iter().zip(best);
    let off = pairs.map(|(a, b)| Some((*a)? - (*b)?)).collect::<Option<Vec<f64>>>()?;
    let middle = mean(&off);
    let n = off.len() as f64;
    // A single seed has no spread: then only the best is as good as the best.
    let variance = off.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    Some([middle, (variance / n).sqrt()])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(flags: &str, errors: &[f64]) -> Reason {
        let errors = errors.iter().map(|&x| Some(x).filter(|x| x.is_finite())).collect();
        Reason::new(flags.into(), String::new(), errors, 1.0)
    }

    fn chosen(reasons: &[Reason]) -> String {
        Selection::select("softness", reasons.to_vec()).unwrap().answer().flags.clone()
    }

    #[test]
    fn the_cheapest_within_one_standard_error_is_chosen() {
        // Differences 0.1, -0.1, 0.2, 0.0: mean 0.05, deviation 0.129, standard error 0.065.
        let near = reason("logistic", &[1.1, 0.9, 1.2, 1.0]);
        let best = reason("mlp", &[1.0; 4]);
        assert_eq!(chosen(&[near, best.clone()]), "logistic");
        // Differences 0.1, 0.1, 0.2, 0.0: mean 0.1, standard error 0.041.
        let far = reason("logistic", &[1.1, 1.1, 1.2, 1.0]);
        assert_eq!(chosen(&[far, best]), "mlp");
    }

    #[test]
    fn what_is_not_finite_is_never_chosen() {
        let broken = reason("logistic", &[0.0, f64::NAN]);
        assert_eq!(chosen(&[broken.clone(), reason("gauss", &[0.5, 0.6])]), "gauss");
        assert!(Selection::select("softness", vec![broken]).is_none());
    }

    #[test]
    fn of_equal_ones_the_first_is_chosen() {
        assert_eq!(chosen(&[reason("logistic", &[0.5]), reason("gauss", &[0.5])]), "logistic");
    }
}
