use std::{fs, path::Path};

use anyhow::Context;

/// The errors of one run over its steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Seed of the run.
    pub seed: u64,
    /// Error of the hard image before the first step and after each.
    pub hard: Vec<f64>,
    /// Error of the parameters, likewise.
    pub parameter: Vec<f64>,
}

impl Trace {
    /// Reads the runs of `evaluate` from its `curve.csv`, in the order of the file.
    ///
    /// # Errors
    ///
    /// If it cannot be read or is no such file.
    pub fn load(path: &Path) -> anyhow::Result<Vec<Self>> {
        let text = fs::read_to_string(path).with_context(|| format!("cannot read {path:?}"))?;
        Self::parse(&text).with_context(|| format!("{path:?} is no table of curves"))
    }

    fn parse(text: &str) -> Option<Vec<Self>> {
        let mut lines = text.lines();
        let names: Vec<&str> = lines.next()?.split(',').collect();
        let place = |name| names.iter().position(|other| *other == name);
        let (hard, parameter) = (place("image_error_hard")?, place("parameter_error")?);
        let mut traces: Vec<Self> = Vec::new();
        for line in lines {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |place: usize| cells.get(place)?.parse::<f64>().ok();
            let seed = cells.first()?.parse().ok()?;
            if traces.last().is_none_or(|trace| trace.seed != seed) {
                traces.push(Self { seed, ..Self::default() });
            }
            let trace = traces.last_mut()?;
            trace.hard.push(number(hard)?);
            trace.parameter.push(number(parameter)?);
        }
        Some(traces)
    }

    /// Share of the run's time that passes until the hard error is `target` or less; none if it never
    /// is.
    pub fn reaches(&self, target: f64) -> Option<f64> {
        let step = self.hard.iter().position(|error| *error <= target)?;
        Some(step as f64 / self.hard.len().saturating_sub(1).max(1) as f64)
    }

    /// The lowest hard error so far, after every step.
    pub fn lowest(&self) -> impl Iterator<Item = f64> {
        self.hard.iter().scan(f64::INFINITY, |lowest, error| {
            *lowest = lowest.min(*error);
            Some(*lowest)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "\
seed,step,loss,image_error,parameter_error,scale,image_error_hard
3,0,1,1,9,0.1,0.8
3,1,1,1,8,0.1,0.2
3,2,1,1,7,0.1,0.4
4,0,1,1,6,0.1,0.5
";

    #[test]
    fn curves_come_run_by_run() {
        let traces = Trace::parse(TABLE).unwrap();
        assert_eq!(traces.len(), 2);
        let first = &traces[0];
        assert_eq!((first.seed, &first.parameter[..]), (3, &[9.0, 8.0, 7.0][..]));
        assert_eq!(first.lowest().collect::<Vec<_>>(), [0.8, 0.2, 0.2]);
        assert_eq!((first.reaches(0.3), first.reaches(0.1)), (Some(0.5), None));
        assert!(Trace::parse("seed,step\n1,2\n").is_none());
    }
}
