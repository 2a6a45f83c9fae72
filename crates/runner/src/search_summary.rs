use std::fmt::Write;

use serde::Serialize;

use crate::{
    Measure, Run, Settings, bootstrap_mean_interval,
    error_summary::{RESAMPLES, RESAMPLING_SEED},
    mean,
    search::{Cell, Stage, best},
    space::{Setting, Space, exact},
    summary::{Partial, short},
    task::Point,
};

/// What a search tried and found, as it stands in `search.json`.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct SearchSummary {
    pub(crate) score: ScoreName,
    /// How settings are compared.
    pub(crate) criterion: &'static str,
    /// First of the seeds trained on, and how many they are.
    pub(crate) training_seed: u64,
    pub(crate) training_runs: usize,
    /// There where the user stopped the search before it was finished.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) partial: Option<Partial>,
    pub(crate) best: Best,
    /// The score of the best on seeds that the search never saw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) held_out: Option<HeldOut>,
    /// Wall time of all runs.
    pub(crate) seconds: f64,
    pub(crate) warnings: Vec<String>,
    pub(crate) cells: Vec<Cell>,
}

/// Name and unit of the score.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ScoreName {
    pub(crate) name: &'static str,
    pub(crate) unit: &'static str,
}

/// The score over some seeds at the last step.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct HeldOut {
    /// First of the seeds, and how many they are.
    pub(crate) seed: u64,
    pub(crate) runs: usize,
    pub(crate) mean: f64,
    /// Of the mean.
    pub(crate) ci95: [f64; 2],
    pub(crate) success_rate: f64,
}

/// The best cell.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Best {
    /// What to pass to `solve` or `evaluate`.
    pub(crate) flags: String,
    #[serde(flatten)]
    pub(crate) cell: Cell,
}

const CRITERION: &str = "lowest mean of the score over the training seeds, at the last step, among \
                         the settings with the fewest runs whose numbers stop being finite";

impl SearchSummary {
    /// Of cells, one of which has a finite mean at least; none of that is `None`.
    pub(crate) fn new(
        settings: &Settings,
        space: &Space,
        score: Measure,
        seeds: &[u64],
        cells: Vec<Cell>,
        partial: Option<Partial>,
    ) -> Option<Self> {
        let best = best(&cells)?.clone();
        let tried: Vec<Setting> = cells.iter().map(|cell| cell.setting).collect();
        let edges = space.at_edge(best.setting, &tried);
        let warning = |flag: &&str| {
            format!(
                "the best --{flag} lies at the edge of what was tried, and may lie beyond: give \
                 --scales, --learning-rates or the flag itself"
            )
        };
        let warnings =
            if partial.is_some() { Vec::new() } else { edges.iter().map(warning).collect() };
        Some(Self {
            score: ScoreName { name: score.name, unit: score.unit },
            criterion: CRITERION,
            training_seed: seeds[0],
            training_runs: seeds.len(),
            partial,
            best: Best { flags: flags(settings, best.setting), cell: best },
            held_out: None,
            seconds: cells.iter().map(|cell| cell.seconds).sum(),
            warnings,
            cells,
        })
    }

    /// Adds how the best did on the runs, none of which is of a training seed.
    pub(crate) fn score_held_out(&mut self, score: impl Fn(&Point) -> f64, runs: &[Run]) {
        let last = |run: &Run| score(&run.curve[run.curve.len() - 1]);
        let values: Vec<f64> = runs.iter().map(last).collect();
        let successes = runs.iter().filter(|run| run.success).count();
        self.held_out = runs.first().map(|first| HeldOut {
            seed: first.seed,
            runs: runs.len(),
            mean: mean(&values),
            ci95: bootstrap_mean_interval(&values, RESAMPLES, RESAMPLING_SEED),
            success_rate: successes as f64 / runs.len() as f64,
        });
    }

    /// How many settings were tried on what.
    pub(crate) fn head(&self) -> String {
        let fine = self.cells.iter().filter(|cell| cell.grid == Stage::Fine).count();
        let (coarse, first) = (self.cells.len() - fine, self.training_seed);
        let last = first + self.training_runs as u64 - 1;
        format!(
            "{coarse} settings of a coarse grid and {fine} of a fine one, each on the training seeds \
             {first} to {last}, {:.1} s",
            self.seconds
        )
    }

    /// A few lines for people.
    pub(crate) fn lines(&self) -> Vec<String> {
        let score = self.score.name;
        let mut lines = vec![format!("  {:<22} {}", "searched", self.head())];
        lines.extend(
            self.partial.map(|partial| format!("  {:<22} {}", "stopped", partial.says("settings"))),
        );
        let mean = self.best.cell.mean.map_or_else(|| "none".into(), short);
        lines.push(format!("  {:<22} {}", "best", self.best.flags));
        lines.push(format!("  {:<22} {score} {mean} on the training seeds", ""));
        lines
    }

    /// All cells as CSV, one row each.
    ///
    /// Columns: `grid,scale,scale_end,learning_rate,mean,n,non_finite,success_rate,seconds`, and last
    /// the task's own number if it has one; a field without a value is empty.
    pub(crate) fn csv(&self) -> String {
        let mut text = String::from(
            "grid,scale,scale_end,learning_rate,mean,n,non_finite,success_rate,seconds",
        );
        let own = self.best.cell.setting.own.map(|(flag, _)| format!(",{flag}"));
        text += &own.unwrap_or_default().replace('-', "_");
        text.push('\n');
        let field = |x: Option<f64>| x.map(exact).unwrap_or_default();
        for cell in &self.cells {
            let grid = if cell.grid == Stage::Coarse { "coarse" } else { "fine" };
            let Setting { scale, scale_end, learning_rate, own } = cell.setting;
            let [scale, end, rate, mean] = [scale, scale_end, learning_rate, cell.mean].map(field);
            let own = own.map(|(_, value)| format!(",{}", exact(value))).unwrap_or_default();
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "{grid},{scale},{end},{rate},{mean},{},{},{},{}{own}",
                cell.n, cell.non_finite, cell.success_rate, cell.seconds
            );
        }
        text
    }
}

/// The flags that ask for this setting of the softness and the variant searched.
fn flags(settings: &Settings, setting: Setting) -> String {
    let mut flags = Vec::new();
    if settings.variant != crate::Variant::Original {
        flags.push(format!("--variant {}", settings.variant.name()));
    }
    flags.extend(settings.softness.iter().map(|softness| format!("--softness {softness}")));
    if settings.squared {
        flags.push("--squared".into());
    }
    flags.extend(settings.surrogate_scale.map(|x| format!("--surrogate-scale {}", exact(x))));
    // Nobody should have to know what a scale alone means to a task that decays by default.
    if setting.scale.is_some() && setting.scale_end.is_none() {
        flags.push("--schedule static".into());
    }
    flags.push(setting.flags());
    flags.join(" ")
}
