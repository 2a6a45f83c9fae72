//! Settings and history of a training.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize, Serializer};
use softrast_inverse::ScheduledSoftness;
use softrast_lab::shown;
use softrast_raster::TConorm;
use softrast_softness::EdgeSoftness;

use crate::Width;

/// Header of a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// The training.
    pub settings: Settings,
    /// Names of the classes of its shapes.
    pub classes: Vec<String>,
    /// Epochs so far, the first one before any step.
    pub epochs: Vec<Epoch>,
}

/// Settings of a training, stored in its checkpoint, so that resuming continues the same training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Source of the shapes.
    pub data: Data,
    /// Widths of the layers.
    pub width: Width,
    /// The softness of the silhouettes.
    pub softness: EdgeSoftness,
    /// Its parameters before the first step.
    pub phi: Vec<f64>,
    /// T-conorm of the coverages of several faces, by its name on the command line.
    pub t_conorm: String,
    /// Learning rate of the network.
    pub learning_rate: f64,
    /// Learning rate of the parameters of the softness; 0 keeps them fixed.
    pub softness_rate: f64,
    /// Pairs of pictures per step.
    pub pairs: usize,
    /// Parts of a step: gradients are averaged over them, and batch norms see one at a time.
    #[serde(default = "one")]
    pub parts: usize,
    /// Steps per epoch.
    pub steps: usize,
    /// Shapes per class for the `IoU` after every epoch.
    pub val: usize,
    /// Seed of the weights, the shapes and their order.
    pub seed: u64,
}

/// Source of shapes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Data {
    /// [`Procedural`](crate::Procedural), with this many shapes per class to learn from.
    Procedural(usize),
    /// The files of a folder, see [`NpzFolder`](crate::NpzFolder).
    Files(#[serde(serialize_with = "as_text")] PathBuf),
}

/// A path as text, even if it is not UTF-8.
fn as_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&shown(path))
}

impl fmt::Display for Data {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Procedural(count) => {
                write!(f, "procedural, {count} shapes of a class to learn from")
            }
            Self::Files(folder) => folder.display().fmt(f),
        }
    }
}

/// The default for checkpoints without parts: one part.
fn one() -> usize {
    1
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

    /// The differences to `other`, in words; `None` if both are the same training.
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

/// Results of an epoch; number 0 is before the first step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Epoch {
    /// Its number, from 1.
    pub number: usize,
    /// Mean loss over its steps: silhouettes and smoothness; `None` before the first step.
    pub loss: Option<f64>,
    /// Mean soft `IoU` of the silhouettes over its steps.
    pub silhouette_iou: Option<f64>,
    /// Mean voxel `IoU` of each class on held-out shapes.
    pub voxel_iou: Vec<f64>,
    /// Parameters of the softness.
    pub phi: Vec<f64>,
    /// Time of its steps in seconds.
    pub time: Time,
}

/// Seconds of the steps of an epoch, in total and by component.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Total time.
    pub all: f64,
    /// Making or reading pictures.
    pub data: f64,
    /// The network, forward and back.
    pub network: f64,
    /// The rasterizer and the loss of silhouettes, forward and back.
    pub rasterizer: f64,
    /// The smoothness term, forward and back.
    pub smoothness: f64,
    /// The optimisers.
    pub optimizer: f64,
    /// Pictures processed by the network.
    pub pictures: usize,
}

impl Epoch {
    /// Mean of the classes.
    pub fn mean_iou(&self) -> f64 {
        softrast_lab::mean(&self.voxel_iou)
    }
}

impl Time {
    /// Pictures a second; 0 without any.
    pub fn rate(&self) -> f64 {
        if self.all > 0.0 { self.pictures as f64 / self.all } else { 0.0 }
    }

    /// Share of the rasterizer in the time, 0 to 1.
    pub fn rasterizer_share(&self) -> f64 {
        if self.all > 0.0 { self.rasterizer / self.all } else { 0.0 }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.all += other.all;
        self.data += other.data;
        self.network += other.network;
        self.rasterizer += other.rasterizer;
        self.smoothness += other.smoothness;
        self.optimizer += other.optimizer;
        self.pictures += other.pictures;
    }
}

impl Header {
    /// Checks that this version of the program has the softness and the T-conorm. The checksum covers everything else.
    pub(crate) fn check(&self, path: &Path) -> anyhow::Result<()> {
        let Settings { softness, phi, .. } = &self.settings;
        let file = serde_json::json!({ "softness": softness, "phi": phi });
        ScheduledSoftness::parse(&file.to_string(), path)?;
        self.settings.t_conorm()?;
        Ok(())
    }
}
