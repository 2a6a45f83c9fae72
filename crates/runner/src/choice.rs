use serde::Serialize;

use crate::{ladder::Rung, mean, summary::short};

/// Which method of a ladder is the least complex one that is as good as the best, and why.
///
/// As good means: its error is above that of the best by at most one standard error of their
/// difference, seed by seed. Source: Breiman et al. 1984, Sec. 3.4.3 (the one-standard-error rule);
/// META 6.8.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Choice {
    /// Place of the chosen method among the reasons.
    pub(crate) chosen: usize,
    /// Place of the method with the least error.
    pub(crate) best: usize,
    /// All methods that were tried, the least complex one first.
    pub(crate) reasons: Vec<Reason>,
}

/// A method and what speaks for or against it.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Reason {
    #[serde(flatten)]
    pub(crate) rung: Rung,
    /// Mean error; none if a run has no finite one.
    pub(crate) mean: Option<f64>,
    /// Mean difference from the best, and its standard error.
    pub(crate) above_best: Option<f64>,
    pub(crate) standard_error: Option<f64>,
    /// What follows from that.
    pub(crate) verdict: &'static str,
}

impl Choice {
    /// Among rungs in the order of their complexity; none if no rung has only finite errors.
    pub(crate) fn among(rungs: Vec<Rung>) -> Option<Self> {
        let means: Vec<Option<f64>> = rungs.iter().map(Rung::mean).collect();
        let finite = (0..rungs.len()).filter_map(|k| means[k].map(|mean| (k, mean)));
        let (best, _) = finite.reduce(|a, b| if b.1 < a.1 { b } else { a })?;
        let against: Vec<Option<[f64; 2]>> =
            rungs.iter().map(|rung| difference(rung, &rungs[best])).collect();
        let as_good = |k: &usize| against[*k].is_some_and(|[above, error]| above <= error);
        let chosen = (0..rungs.len()).find(as_good).unwrap_or(best);
        let verdict = |k: usize| match against[k] {
            _ if k == chosen => "chosen",
            None => "not finite",
            Some(_) if as_good(&k) && k == best => "best, but no simpler",
            Some(_) if as_good(&k) => "as good, but no simpler",
            Some(_) => "worse",
        };
        let verdicts: Vec<_> = (0..rungs.len()).map(verdict).collect();
        let reasons = rungs.into_iter().enumerate().map(|(k, rung)| Reason {
            rung,
            mean: means[k],
            above_best: against[k].map(|[above, _]| above),
            standard_error: against[k].map(|[_, error]| error),
            verdict: verdicts[k],
        });
        Some(Self { chosen, best, reasons: reasons.collect() })
    }

    /// The chosen method.
    pub(crate) fn method(&self) -> &Rung {
        &self.reasons[self.chosen].rung
    }

    /// Flags that ask for the chosen method.
    pub(crate) fn flags(&self) -> String {
        let Rung { softness, schedule, .. } = self.method();
        format!("--softness {softness} --schedule {schedule}")
    }

    /// The reasons as rows of a table, the head first.
    pub(crate) fn table(&self) -> Vec<[String; 7]> {
        let head = ["method", "scale", "parameters", "error", "above best", "s per run", "verdict"];
        let number = |x: Option<f64>| x.map_or_else(|| "none".into(), short);
        let row = |reason: &Reason| {
            let Reason { rung, mean, above_best, standard_error, verdict } = reason;
            [
                rung.softness.into(),
                rung.schedule.into(),
                rung.parameters.to_string(),
                number(*mean),
                format!("{} (se {})", number(*above_best), number(*standard_error)),
                short(rung.seconds),
                (*verdict).into(),
            ]
        };
        std::iter::once(head.map(String::from)).chain(self.reasons.iter().map(row)).collect()
    }

    /// What the choice costs and gains against the best method.
    pub(crate) fn price(&self) -> String {
        let [chosen, best] = [self.chosen, self.best].map(|k| &self.reasons[k]);
        if self.chosen == self.best {
            return format!(
                "{} {} has the least error of all",
                best.rung.softness, best.rung.schedule
            );
        }
        let above = chosen.above_best.unwrap_or(f64::NAN);
        let ratio = best.rung.seconds / chosen.rung.seconds.max(1e-9);
        format!(
            "an error {} above that of {} {} ({}), with {} parameters instead of {}, in {:.2} times less \
             time",
            short(above),
            best.rung.softness,
            best.rung.schedule,
            best.mean.map_or_else(|| "none".into(), short),
            chosen.rung.parameters,
            best.rung.parameters,
            ratio
        )
    }
}

/// Mean difference of the errors of two rungs, seed by seed, and its standard error.
fn difference(rung: &Rung, best: &Rung) -> Option<[f64; 2]> {
    let pairs = rung.errors.iter().zip(&best.errors);
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

    fn rung(softness: &'static str, errors: &[f64]) -> Rung {
        let errors = errors.iter().map(|&x| Some(x).filter(|x| x.is_finite())).collect();
        Rung { softness, schedule: "static", parameters: 1, errors, seconds: 1.0 }
    }

    fn chosen(rungs: Vec<Rung>) -> &'static str {
        Choice::among(rungs).unwrap().method().softness
    }

    #[test]
    fn the_simplest_within_one_standard_error_is_chosen() {
        // Differences 0.1, -0.1, 0.2, 0.0: mean 0.05, deviation 0.129, standard error 0.065.
        let near = rung("logistic", &[1.1, 0.9, 1.2, 1.0]);
        let best = rung("mlp", &[1.0; 4]);
        assert_eq!(chosen(vec![near.clone(), best.clone()]), "logistic");
        // Differences 0.1, 0.1, 0.2, 0.0: mean 0.1, standard error 0.041.
        let far = rung("logistic", &[1.1, 1.1, 1.2, 1.0]);
        assert_eq!(chosen(vec![far, best]), "mlp");
    }

    #[test]
    fn what_is_not_finite_is_never_chosen() {
        let broken = rung("logistic", &[0.0, f64::NAN]);
        assert_eq!(chosen(vec![broken.clone(), rung("gauss", &[0.5, 0.6])]), "gauss");
        assert!(Choice::among(vec![broken]).is_none());
    }

    #[test]
    fn of_equal_ones_the_first_is_chosen() {
        assert_eq!(chosen(vec![rung("logistic", &[0.5]), rung("gauss", &[0.5])]), "logistic");
    }
}
