//! Reports of a search: files, lines and a section of a page.

use serde_json::{Map, Value, json};

use super::{Halving, SearchAxis, SearchSpace, Setting, Trial, better_first};
use crate::{
    format::{exact, line, short, short_or_none},
    mean, mean_interval,
    plot::{Axis, Plot, Series},
    report::{Report, Table},
};

/// Number of settings in the table of a page.
const SHOWN: usize = 24;

/// From light to dark.
const ROUND_COLOURS: [[u8; 3]; 4] =
    [[200, 205, 210], [130, 180, 220], [31, 96, 168], [196, 84, 24]];

const CRITERION: &str = "lowest mean of the score of what is returned over the training seeds, among the settings of the last round with \
                         the fewest runs whose numbers stop being finite";

impl Trial {
    /// The fields of a trial, in the order of the columns of a table.
    fn fields(&self, space: &SearchSpace) -> Vec<(String, Value)> {
        let mut fields = vec![("round".into(), self.round.into())];
        let values = space.axes.iter().zip(&self.setting);
        fields.extend(values.map(|(axis, value)| (axis.flag.replace('-', "_"), json!(value))));
        let runs = self.scores.len();
        let rate = self.successes as f64 / runs.max(1) as f64;
        fields.extend([
            ("mean".into(), json!(self.mean())),
            ("n".into(), (runs - self.broken()).into()),
            ("non_finite".into(), self.broken().into()),
            ("success_rate".into(), rate.into()),
            ("seconds".into(), self.seconds.into()),
        ]);
        fields
    }

    fn json(&self, space: &SearchSpace) -> Value {
        let mut json = Map::from_iter(self.fields(space));
        json.insert("per_run".into(), json!(self.scores));
        json.into()
    }
}

impl Halving {
    /// The search as in `search.json`.
    pub fn json(&self) -> Value {
        let held_out = (!self.held_out.is_empty()).then(|| {
            let (values, ends) = (&self.held_out, mean_interval(&self.held_out));
            json!({ "runs": values.len(), "mean": mean(values), "ci95": ends })
        });
        let mut best = self.best().map_or(Value::Null, |trial| trial.json(&self.space));
        best["flags"] = self.best_flags.as_str().into();
        json!({
            "score": { "name": self.score[0], "unit": self.score[1] },
            "criterion": CRITERION,
            "training_seed": self.seeds[0],
            "training_runs": self.seeds.len(),
            "loops": self.made(),
            "partial": self.partial(),
            "best": best,
            "held_out": held_out,
            "seconds": self.trials.iter().map(|trial| trial.seconds).sum::<f64>(),
            "warnings": self.warnings(),
            "trials": self.trials.iter().map(|trial| trial.json(&self.space)).collect::<Vec<_>>(),
        })
    }

    /// All trials as CSV, one row each: `round`, a column for every axis,
    /// `mean,n,non_finite,success_rate,seconds`; missing values are empty.
    pub fn csv(&self) -> String {
        let text = |value: &Value| match value {
            Value::Null => String::new(),
            number => number.as_f64().map_or_else(|| number.to_string(), exact),
        };
        let rows = self.trials.iter().map(|trial| trial.fields(&self.space));
        let (mut head, mut body) = (Vec::new(), String::new());
        for row in rows {
            let values: Vec<String> = row.iter().map(|(_, value)| text(value)).collect();
            body += &format!("{}\n", values.join(","));
            head = row.into_iter().map(|(name, _)| name).collect();
        }
        format!("{}\n{body}", head.join(","))
    }

    fn head(&self) -> String {
        let settings = self.trials.iter().filter(|trial| self.earlier(trial) == 0).count();
        let (first, last) = (self.seeds[0], self.seeds[self.seeds.len() - 1]);
        let seconds: f64 = self.trials.iter().map(|trial| trial.seconds).sum();
        format!(
            "{settings} settings in {} runs on the training seeds {first} to {last}, the better ones on more of them, {seconds:.1} s",
            self.made()
        )
    }

    fn best_score(&self) -> String {
        let mean = short_or_none(self.best().and_then(Trial::mean));
        format!("{} {mean} on the training seeds", self.score[0])
    }

    /// A few lines for people.
    pub fn text(&self) -> Vec<String> {
        let mut lines = vec![line("searched", &self.head())];
        lines.extend(self.partial().map(|partial| line("stopped", &partial.of("runs"))));
        lines.extend([line("best", &self.best_flags), line("", &self.best_score())]);
        lines
    }

    /// The trials and the best setting, as a section of a page.
    ///
    /// # Errors
    ///
    /// If a chart cannot be drawn.
    pub fn section(&self, report: &mut Report) -> anyhow::Result<()> {
        report.heading("Search");
        report.paragraph(&format!("{}. The best setting:", self.head()));
        report.code(&self.best_flags);
        report.paragraph(&format!("It has {}.", self.best_score()));
        if !self.held_out.is_empty() {
            let [low, high] = mean_interval(&self.held_out).map(short);
            report.paragraph(&format!(
                "On {} seeds that the search never saw it is {} (95 % interval {low} to {high}); all results below are of these.",
                self.held_out.len(),
                short(mean(&self.held_out))
            ));
        }
        for axis in 0..self.space.axes.len() {
            if let Some(plot) = self.chart(axis) {
                report.chart(&plot.svg()?, "");
            }
        }
        report.table(&self.table());
        report.note(&format!(
            "Mean {} of what is returned on the training seeds. The {SHOWN} settings that came farthest, the best first; search.csv has \
             all. The best has the {CRITERION}. A star marks settings with runs whose numbers did not stay finite.",
            self.score[0]
        ));
        Ok(())
    }

    /// Score over the values of a searched axis, with a colour per round.
    fn chart(&self, axis: usize) -> Option<Plot> {
        let SearchAxis { flag, range, .. } = &self.space.axes[axis];
        range.filter(|[low, high]| low < high)?;
        let score = Axis::logarithmic(&format!("{} returned", self.score[0]));
        let mut plot = Plot::new(Axis::logarithmic(flag), score);
        for round in 1..=self.rounds().len() {
            let of_round = self.trials.iter().filter(|trial| trial.round == round);
            let points = of_round.filter_map(|trial| Some([trial.setting[axis]?, trial.mean()?]));
            let mut name = format!("round {round}");
            for point in points {
                let name = std::mem::take(&mut name);
                let colour = ROUND_COLOURS[(round - 1) % ROUND_COLOURS.len()];
                plot.series.push(Series { name, colour, points: vec![point], ..Series::default() });
            }
        }
        (!plot.series.is_empty()).then_some(plot)
    }

    fn table(&self) -> Table {
        let mut trials: Vec<&Trial> = self.trials.iter().collect();
        trials.sort_by(|a, b| b.round.cmp(&a.round).then(better_first(a, b)));
        let mut settings: Vec<&Setting> = Vec::new();
        trials.retain(|trial| {
            let new = !settings.contains(&&trial.setting);
            settings.push(&trial.setting);
            new
        });
        let axes = self.space.axes.iter().map(|axis| axis.flag);
        let mut table =
            Table::new(["seeds"].into_iter().chain(axes).chain([self.score[0]]).map(str::to_owned));
        let named = |value: &Option<f64>| value.map_or_else(|| "-".into(), exact);
        for (k, trial) in trials.into_iter().take(SHOWN).enumerate() {
            let star = if trial.broken() > 0 { " *" } else { "" };
            let mean = format!("{}{star}", short_or_none(trial.mean()));
            let values = trial.setting.iter().map(named);
            table.push([trial.scores.len().to_string()].into_iter().chain(values).chain([mean]));
            if k == 0 {
                table.choose_last();
            }
        }
        table
    }
}
