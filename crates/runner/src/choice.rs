use serde::Serialize;

use crate::{Settings, mean, summary::short, trial::Trial};

/// The cheapest way to solve a task that is as good as the best, and why: what
/// [`choose`](crate::choose()) finds.
#[derive(Clone, Debug, Serialize)]
pub struct Choice {
    /// One for every question, in the order in which they were asked: softness, resolution, tolerance,
    /// detail. Each starts from the answers to those before.
    pub stages: Vec<Stage>,
    /// Whether the budget lasted for all answers that the task knows.
    pub whole: bool,
    /// The settings that were given, with all answers.
    #[serde(skip)]
    pub settings: Settings,
}

/// One question, and which of its answers is the cheapest that is as good as the best.
///
/// As good means: its error is above that of the best by at most one standard error of their
/// difference, seed by seed. Source: Breiman et al. 1984, Sec. 3.4.3 (the one-standard-error rule);
/// META 6.8.
#[derive(Clone, Debug, Serialize)]
pub struct Stage {
    /// What is asked for: `softness`, `resolution`, `tolerance` or `detail`.
    pub of: &'static str,
    /// Place of the chosen answer among the reasons.
    pub chosen: usize,
    /// Place of the one with the least error.
    pub best: usize,
    /// All that were tried, the cheapest first.
    pub reasons: Vec<Reason>,
}

/// An answer and what speaks for or against it.
#[derive(Clone, Debug, Serialize)]
pub struct Reason {
    /// The flags that give it.
    pub flags: String,
    /// What it computes with, such as `2 parameters`.
    pub with: String,
    /// Error of what each training seed returns, in their order; none where it is not finite.
    pub errors: Vec<Option<f64>>,
    /// Time of the optimisation steps of one run.
    pub seconds: f64,
    /// Mean error; none if a run has no finite one.
    pub mean: Option<f64>,
    /// Mean difference from the best.
    pub above_best: Option<f64>,
    /// Standard error of that difference.
    pub standard_error: Option<f64>,
    /// What follows from that.
    pub verdict: &'static str,
}

impl Stage {
    /// Among trials in the order of their cost; none if no trial has only finite errors.
    pub(crate) fn among(of: &'static str, trials: &[Trial]) -> Option<Self> {
        let means: Vec<Option<f64>> = trials.iter().map(Trial::mean).collect();
        let finite = (0..trials.len()).filter_map(|k| means[k].map(|mean| (k, mean)));
        let (best, _) = finite.reduce(|a, b| if b.1 < a.1 { b } else { a })?;
        let against: Vec<Option<[f64; 2]>> =
            trials.iter().map(|trial| difference(&trial.errors, &trials[best].errors)).collect();
        let as_good = |k: &usize| against[*k].is_some_and(|[above, error]| above <= error);
        let chosen = (0..trials.len()).find(as_good).unwrap_or(best);
        let verdict = |k: usize| match against[k] {
            _ if k == chosen => "chosen",
            None => "not finite",
            Some(_) if as_good(&k) && k == best => "best, but no simpler",
            Some(_) if as_good(&k) => "as good, but no simpler",
            Some(_) => "worse",
        };
        let reasons = trials.iter().enumerate().map(|(k, trial)| Reason {
            flags: trial.flags.clone(),
            with: trial.with.clone(),
            errors: trial.errors.clone(),
            seconds: trial.seconds,
            mean: means[k],
            above_best: against[k].map(|[above, _]| above),
            standard_error: against[k].map(|[_, error]| error),
            verdict: verdict(k),
        });
        Some(Self { of, chosen, best, reasons: reasons.collect() })
    }

    /// The reason of what is chosen.
    pub fn answer(&self) -> &Reason {
        &self.reasons[self.chosen]
    }

    /// The reasons as rows of a table, the head first.
    pub(crate) fn table(&self) -> Vec<[String; 6]> {
        let head = [self.of, "with", "error", "above best", "s per run", "verdict"];
        let number = |x: Option<f64>| x.map_or_else(|| "none".into(), short);
        let row = |reason: &Reason| {
            let Reason { flags, with, mean, above_best, standard_error, verdict, .. } = reason;
            [
                flags.clone(),
                with.clone(),
                number(*mean),
                format!("{} (se {})", number(*above_best), number(*standard_error)),
                short(reason.seconds),
                (*verdict).into(),
            ]
        };
        std::iter::once(head.map(String::from)).chain(self.reasons.iter().map(row)).collect()
    }
}

impl Choice {
    /// The flags that ask for what is chosen, on one line.
    pub fn flags(&self) -> String {
        self.stages.iter().map(|stage| stage.answer().flags.as_str()).collect::<Vec<_>>().join(" ")
    }

    /// What the choice costs and gains against the method with the least error, at full size and with
    /// all that is usual; empty if nothing was asked.
    pub fn price(&self) -> String {
        let (Some(first), Some(last)) = (self.stages.first(), self.stages.last()) else {
            return String::new();
        };
        let (best, chosen) = (&first.reasons[first.best], last.answer());
        let number = |x: Option<f64>| x.map_or_else(|| "none".into(), short);
        format!(
            "an error of {} in {} s, where the least of all methods is {} in {} s, of {}",
            number(chosen.mean),
            short(chosen.seconds),
            number(best.mean),
            short(best.seconds),
            best.flags
        )
    }
}

/// Mean difference of errors from the best ones, seed by seed, and its standard error.
fn difference(errors: &[Option<f64>], best: &[Option<f64>]) -> Option<[f64; 2]> {
    let pairs = errors.iter().zip(best);
    let off = pairs.map(|(a, b)| Some((*a)? - (*b)?)).collect::<Option<Vec<f64>>>()?;
    let middle = mean(&off);
    let n = off.len() as f64;
    // One seed has no spread, so that only the best is as good as the best.
    let variance = off.iter().map(|x| (x - middle).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    Some([middle, (variance / n).sqrt()])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(flags: &str, errors: &[f64]) -> Trial {
        Trial {
            flags: flags.into(),
            settings: Settings::default(),
            with: String::new(),
            errors: errors.iter().map(|&x| Some(x).filter(|x| x.is_finite())).collect(),
            seconds: 1.0,
            wall: 1.0,
        }
    }

    fn chosen(trials: &[Trial]) -> String {
        Stage::among("softness", trials).unwrap().answer().flags.clone()
    }

    #[test]
    fn the_cheapest_within_one_standard_error_is_chosen() {
        // Differences 0.1, -0.1, 0.2, 0.0: mean 0.05, deviation 0.129, standard error 0.065.
        let near = trial("logistic", &[1.1, 0.9, 1.2, 1.0]);
        let best = trial("mlp", &[1.0; 4]);
        assert_eq!(chosen(&[near, best.clone()]), "logistic");
        // Differences 0.1, 0.1, 0.2, 0.0: mean 0.1, standard error 0.041.
        let far = trial("logistic", &[1.1, 1.1, 1.2, 1.0]);
        assert_eq!(chosen(&[far, best]), "mlp");
    }

    #[test]
    fn what_is_not_finite_is_never_chosen() {
        let broken = trial("logistic", &[0.0, f64::NAN]);
        assert_eq!(chosen(&[broken.clone(), trial("gauss", &[0.5, 0.6])]), "gauss");
        assert!(Stage::among("softness", &[broken]).is_none());
    }

    #[test]
    fn of_equal_ones_the_first_is_chosen() {
        assert_eq!(chosen(&[trial("logistic", &[0.5]), trial("gauss", &[0.5])]), "logistic");
    }
}
