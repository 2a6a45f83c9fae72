use serde::Serialize;

use crate::{Case, Outcome, Promise, Tested};

/// All outcomes: cases down, methods across.
#[derive(Serialize)]
pub struct Matrix {
    /// Names of the methods.
    pub methods: Vec<&'static str>,
    /// Cases with their outcomes, in the order of the methods.
    pub rows: Vec<Row>,
    /// Trials in all.
    pub trials: usize,
    /// Trials with a number that is not finite.
    pub non_finite: usize,
    /// Cells that are a fault of the program.
    pub broken: usize,
    /// Wall time of all of them.
    pub seconds: f64,
}

/// One case.
#[derive(Serialize)]
pub struct Row {
    /// Short and unique.
    pub id: &'static str,
    /// A few words.
    pub name: &'static str,
    /// Whether every method must reach the target.
    pub guaranteed: bool,
    /// What is drawn or optimised.
    pub scene: &'static str,
    /// What changes from level to level.
    pub perturbation: &'static str,
    /// What is measured.
    pub measure: &'static str,
    /// When a trial counts as reached.
    pub target: &'static str,
    /// In the order of the methods.
    pub outcomes: Vec<Outcome>,
}

impl Matrix {
    /// Of outcomes in the order of [`run`](crate::run).
    pub fn new(cases: &[&Case], methods: &[Tested], outcomes: Vec<Outcome>, seconds: f64) -> Self {
        let mut outcomes = outcomes.into_iter();
        let row = |case: &&Case| Row {
            id: case.id,
            name: case.name,
            guaranteed: case.promise == Promise::Guaranteed,
            scene: case.scene,
            perturbation: case.perturbation,
            measure: case.measure,
            target: case.target,
            outcomes: outcomes.by_ref().take(methods.len()).collect(),
        };
        let rows: Vec<Row> = cases.iter().map(row).collect();
        let all = || rows.iter().flat_map(|row| &row.outcomes);
        let (trials, non_finite) =
            (all().map(|o| o.trials).sum(), all().map(|o| o.non_finite).sum());
        let broken = rows.iter().map(Row::broken).sum();
        let methods = methods.iter().map(|method| method.name).collect();
        Self { methods, rows, trials, non_finite, broken, seconds }
    }

    /// The matrix as a table, then what is broken.
    pub fn text(&self) -> String {
        const NAME: usize = 38;
        let mut lines =
            vec![format!("{:<4} {:<NAME$}", "", "share of trials that reach the target")];
        lines[0] += &self.methods.iter().map(|name| format!(" {name:>9}")).collect::<String>();
        for row in &self.rows {
            let cells = row.outcomes.iter().map(|o| format!(" {:>9}", row.cell(o)));
            let mark = if row.guaranteed { "!" } else { " " };
            lines.push(format!(
                "{:<4}{mark}{:<NAME$}{}",
                row.id,
                row.name,
                cells.collect::<String>()
            ));
        }
        lines.push(format!(
            "{} cases x {} methods, {} trials in {:.0} s; not finite: {}; broken: {}",
            self.rows.len(),
            self.methods.len(),
            self.trials,
            self.seconds,
            self.non_finite,
            self.broken
        ));
        lines
            .push("! = every trial must; elsewhere a lower share is where the method fails".into());
        lines.extend(self.faults());
        lines.join("\n")
    }

    /// One line for each fault of the program.
    pub fn faults(&self) -> Vec<String> {
        let faults = self.rows.iter().flat_map(|row| {
            let broken = row.outcomes.iter().filter(|o| o.is_broken(row.promise()));
            broken.map(|outcome| row.fault(outcome))
        });
        faults.collect()
    }
}

impl Row {
    /// What a missed target means.
    pub fn promise(&self) -> Promise {
        if self.guaranteed { Promise::Guaranteed } else { Promise::Measured }
    }

    fn broken(&self) -> usize {
        self.outcomes.iter().filter(|o| o.is_broken(self.promise())).count()
    }

    /// A cell of the table: the share that reached the target.
    pub fn cell(&self, outcome: &Outcome) -> String {
        if outcome.failed.is_some() {
            return "FAILED".into();
        }
        if outcome.non_finite > 0 {
            return format!("{} NaN", outcome.non_finite);
        }
        format!("{}/{}", outcome.reached, outcome.trials)
    }

    fn fault(&self, outcome: &Outcome) -> String {
        let head = format!("broken: {} {}, {}", self.id, self.name, outcome.method);
        if let Some(failed) = &outcome.failed {
            return format!("{head}: {failed}");
        }
        let missed = |level: &&crate::LevelOutcome| level.reached < level.trials;
        let levels = outcome.levels.iter().filter(missed).map(|level| {
            let worst = level.worst.map_or("not finite".into(), |worst| format!("{worst:.2e}"));
            format!("{} ({worst}, {} not finite)", level.label, level.non_finite)
        });
        format!("{head}: misses \"{}\" at {}", self.target, levels.collect::<Vec<_>>().join(", "))
    }
}
