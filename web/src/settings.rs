use anyhow::{Context, ensure};
use serde::{Deserialize, Serialize};
use softrast_inverse::{Method, ScheduledSoftness, SolveConfig};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Tensor, numbers, vector};

use crate::Backend;

/// Prefix of the name of a learned softness.
const LEARNED: &str = "learned:";
/// Name of the best known softness of a task.
const PRESET: &str = "preset";
/// Smallest and largest width of a softness, in NDC.
const WIDTHS: [f64; 2] = [1e-4, 1.0];
/// Largest image, and most steps and triangles: more would take a browser minutes.
const LARGEST_SIZE: usize = 256;
const MOST_STEPS: usize = 2000;
const MOST_TRIANGLES: usize = 1000;

/// Settings of one run. Runs with equal settings, mesh and picture are equal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Seed of target and start; at most 2^32 - 1, so that JavaScript can represent it.
    pub seed: u32,
    /// Pixels a side of the image, 16 to 256.
    pub size: usize,
    /// Steps of the optimiser, 1 to 2000.
    pub steps: usize,
    /// Learning rate of the optimiser; by default that of the softness, or else of the problem.
    #[serde(default)]
    pub learning_rate: Option<f64>,
    /// Triangles of 2D SHAPE, 1 to 1000.
    #[serde(default = "usual_triangles")]
    pub triangles: usize,
    /// The softness of edges.
    pub softness: SoftnessChoice,
}

/// A softness by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoftnessChoice {
    /// `preset`, `learned:NAME` or a family.
    pub name: String,
    /// Whether the input of a family is the squared distance.
    #[serde(default)]
    pub squared: bool,
    /// Width of a family at the beginning, in NDC, 1e-4 to 1.
    #[serde(default = "usual_first")]
    pub first: f64,
    /// Width of a family at the end.
    #[serde(default = "usual_last")]
    pub last: f64,
}

fn usual_triangles() -> usize {
    200
}

// As in the task POSE.
fn usual_first() -> f64 {
    0.03
}

fn usual_last() -> f64 {
    0.002
}

impl Settings {
    /// Reads the settings of a run.
    ///
    /// # Errors
    ///
    /// A message of one line with the mistake.
    pub fn parse(json: &str) -> anyhow::Result<Self> {
        let settings: Self =
            serde_json::from_str(json).context("these are no settings of a run")?;
        let Self { size, steps, triangles, learning_rate, .. } = settings;
        ensure!(
            (16..=LARGEST_SIZE).contains(&size),
            "an image of {size} pixels a side: expected 16 to {LARGEST_SIZE}"
        );
        ensure!((1..=MOST_STEPS).contains(&steps), "{steps} steps: expected 1 to {MOST_STEPS}");
        ensure!(
            (1..=MOST_TRIANGLES).contains(&triangles),
            "{triangles} triangles: expected 1 to {MOST_TRIANGLES}"
        );
        let rate = learning_rate.unwrap_or(1.0);
        ensure!(
            rate > 0.0 && rate <= 100.0,
            "a learning rate of {rate}: expected more than 0, at most 100"
        );
        Ok(settings)
    }

    /// Method and numbers for a problem of this task, whose default learning rate is `usual_rate`.
    pub(crate) fn method(
        &self,
        task: &str,
        usual_rate: f64,
    ) -> anyhow::Result<(Method, SolveConfig)> {
        let softness = self.softness.of_task(task)?;
        let learning_rate = self.learning_rate.or(softness.learning_rate).unwrap_or(usual_rate);
        let config = SolveConfig { size: self.size, steps: self.steps, learning_rate };
        Ok((Method::new(&self.softness.name, softness), config))
    }
}

impl SoftnessChoice {
    /// The softness for a task: `pose`, `mask` or `shape2d`. A learning rate that was learned on another task is dropped.
    ///
    /// # Errors
    ///
    /// If no softness has this name, or a width is out of range.
    pub fn of_task(&self, task: &str) -> anyhow::Result<ScheduledSoftness> {
        // Masks use the softness learned on POSE without an adaptive schedule: they have other starts without its restarts.
        let (learned_on, preset) = if task == "mask" { ("pose", "pose") } else { (task, "") };
        let softness = match self.name.strip_prefix(LEARNED) {
            Some(name) => ScheduledSoftness::learned(name)?,
            None if self.name == PRESET && preset.is_empty() => ScheduledSoftness::preset(task)?,
            None if self.name == PRESET => ScheduledSoftness::learned(preset)?,
            None => return self.of_family(),
        };
        // Poses from masks have other units, so their problem has its own learning rate.
        let suits = softness.task.as_deref().is_none_or(|of| of == learned_on) && task != "mask";
        Ok(ScheduledSoftness {
            learning_rate: softness.learning_rate.filter(|_| suits),
            rate_end: softness.rate_end.filter(|_| suits),
            ..softness
        })
    }

    fn of_family(&self) -> anyhow::Result<ScheduledSoftness> {
        let edge = if self.squared { EdgeSoftness::squared } else { EdgeSoftness::new };
        let edge = edge(self.name.parse::<Family>()?);
        let [least, largest] = WIDTHS;
        let scale = |width: f64| {
            ensure!(
                (least..=largest).contains(&width),
                "a width of {width}: expected {least} to {largest}"
            );
            Ok(if self.squared { width * width } else { width })
        };
        let (first, last) = (scale(self.first)?, scale(self.last)?);
        Ok(if first == last {
            ScheduledSoftness::constant(edge, first)
        } else {
            ScheduledSoftness::decay(edge, first, last)
        })
    }

    /// All names: the preset, families, then learned softnesses.
    pub fn names() -> [Vec<String>; 3] {
        let families = Family::ALL.map(|family| family.name().to_owned()).to_vec();
        let learned =
            ScheduledSoftness::learned_names().map(|name| format!("{LEARNED}{name}")).collect();
        [vec![PRESET.to_owned()], families, learned]
    }
}

/// Values s(d) of a softness at `progress` of a run, 0 to 1, on images of `size` pixels a side: at `count` distances,
/// evenly spaced from `-reach` to `reach` in NDC, `[count]`. Those of its surrogate, if it has one, follow.
pub fn curves(
    softness: &ScheduledSoftness,
    progress: f64,
    size: usize,
    reach: f64,
    count: usize,
) -> Vec<f32> {
    let last = count.max(2) as f64 - 1.0;
    let distances: Vec<f64> = (0..count).map(|k| reach * (2.0 * k as f64 / last - 1.0)).collect();
    let values = |edge: EdgeSoftness, phi: &[f64]| -> Tensor<Backend, 1> {
        edge.value(vector(phi), vector(&distances))
    };
    let own = values(softness.softness, &softness.phi_at(progress, size));
    let other = softness.surrogate_at(progress, size).map(|of| values(of.softness, &of.phi));
    [Some(own), other].into_iter().flatten().flat_map(numbers).map(|x| x as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choice(name: &str) -> SoftnessChoice {
        SoftnessChoice { name: name.to_owned(), squared: false, first: 0.03, last: 0.002 }
    }

    #[test]
    fn every_name_is_a_softness_of_every_task() {
        for name in SoftnessChoice::names().concat() {
            for task in ["pose", "mask", "shape2d"] {
                choice(&name).of_task(task).unwrap();
            }
        }
        let unknown = choice("soft").of_task("pose").unwrap_err().to_string();
        assert!(unknown.starts_with("unknown softness \"soft\"; known are logistic"), "{unknown}");
    }

    #[test]
    fn a_learned_rate_goes_with_its_task_only() {
        assert!(choice("learned:shape2d").of_task("shape2d").unwrap().learning_rate.is_some());
        assert!(choice("learned:shape2d").of_task("pose").unwrap().learning_rate.is_none());
    }

    #[test]
    fn wrong_settings_are_one_line() {
        for (json, expected) in [
            ("{", "these are no settings of a run"),
            (
                r#"{"seed":0,"size":8,"steps":1,"softness":{"name":"gauss"}}"#,
                "an image of 8 pixels a side: expected 16 to 256",
            ),
            (
                r#"{"seed":0,"size":64,"steps":0,"softness":{"name":"gauss"}}"#,
                "0 steps: expected 1 to 2000",
            ),
        ] {
            assert_eq!(Settings::parse(json).unwrap_err().to_string(), expected);
        }
    }

    #[test]
    fn a_curve_is_one_half_at_the_edge_and_narrows_with_the_run() {
        let softness = choice("logistic").of_task("pose").unwrap();
        let [first, last] = [0.0, 1.0].map(|progress| curves(&softness, progress, 64, 0.1, 21));
        assert!((first[10] - 0.5).abs() < 1e-6 && (last[10] - 0.5).abs() < 1e-6);
        assert!(last[11] > first[11] && last[11] > 0.99);
    }
}
