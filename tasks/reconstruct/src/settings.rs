use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use softrast_raster::TConorm;
use softrast_softness::EdgeSoftness;

use crate::Width;

/// What a training does; kept in its checkpoint, so that going on means the same training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Where the shapes come from.
    pub data: Data,
    /// Widths of the layers.
    pub width: Width,
    /// The softness of the silhouettes.
    pub softness: EdgeSoftness,
    /// Its parameters before the first step.
    pub phi: Vec<f64>,
    /// How the coverages of several faces make one, as the command line names it.
    pub t_conorm: String,
    /// Learning rate of the network.
    pub learning_rate: f64,
    /// Learning rate of the parameters of the softness; 0 leaves them as they are.
    pub softness_rate: f64,
    /// Pairs of pictures in a step.
    pub pairs: usize,
    /// Steps in an epoch.
    pub steps: usize,
    /// Shapes of a class that the `IoU` after every epoch is taken from.
    pub val: usize,
    /// Seed of the weights, the shapes and their order.
    pub seed: u64,
}

/// Where shapes come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Data {
    /// [`Procedural`](crate::Procedural), with so many shapes of a class to learn from.
    Procedural(usize),
    /// The files of a folder, see [`NpzFolder`](crate::NpzFolder).
    Files(PathBuf),
}

impl Settings {
    /// The T-conorm.
    ///
    /// # Errors
    ///
    /// If its name is not one.
    pub fn t_conorm(&self) -> anyhow::Result<TConorm> {
        Ok(self.t_conorm.parse()?)
    }

    /// What differs from `other`, in words; nothing if they are the same training.
    pub(crate) fn difference(&self, other: &Self) -> Option<String> {
        let [mine, theirs] = [self, other].map(|settings| serde_json::to_value(settings).ok());
        let (mine, theirs) = (mine?, theirs?);
        let differ = |(key, value): (&String, &serde_json::Value)| {
            (theirs.get(key) != Some(value)).then(|| {
                let other = theirs.get(key).unwrap_or(&serde_json::Value::Null);
                format!("{key} is {value} there, {other} here")
            })
        };
        let found: Vec<String> = mine.as_object()?.iter().filter_map(differ).collect();
        (!found.is_empty()).then(|| found.join("; "))
    }
}
