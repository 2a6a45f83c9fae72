use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use softrast_inverse::{NameOrFile, ScheduledSoftness};
use softrast_lab::{
    Error,
    parse::{count, positive, seed, whole},
};
use softrast_raster::TConorm;
use softrast_softness::{EdgeSoftness, Family, Softness};

use crate::{Data, Settings, Width};

/// Single-view 3D reconstruction: a network that learns shapes from their silhouettes.
#[derive(Debug, Parser)]
#[command(name = "reconstruct", version)]
pub(crate) struct CommandLine {
    #[command(subcommand)]
    pub(crate) command: Command,

    /// Backend: flex, ndarray, wgpu or cuda, if the program was built with it; by default the first of
    /// these that is available.
    #[arg(long, global = true, value_name = "NAME")]
    pub(crate) backend: Option<String>,

    /// Print one JSON object instead of text.
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Train a network; writes a checkpoint, a contact sheet and the report after every epoch.
    Train(TrainArgs),
    /// Score a trained network on held-out shapes.
    Evaluate(EvaluateArgs),
    /// Make a mesh of the shape in a picture.
    Predict(PredictArgs),
    /// Train with several softnesses and T-conorms, all else equal, and compare the scores.
    Compare(CompareArgs),
}

/// Flags of all trainings, independent of the softness.
#[derive(Args, Clone, Debug)]
pub(crate) struct Common {
    /// Folder with <class>_<split>_images.npz and ..._voxels.npz for the splits train, val and
    /// test; by default shapes are generated.
    #[arg(long, value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,

    /// Generated shapes per class to learn from [default: 1000].
    #[arg(long, value_name = "N", value_parser = count, conflicts_with = "data")]
    pub(crate) shapes: Option<usize>,

    /// Widths of the layers: those of the paper, or a quarter of them [default: quarter].
    #[arg(long, value_enum)]
    pub(crate) width: Option<Width>,

    /// Learning rate of the network [default: 0.0005].
    #[arg(long, value_name = "X", value_parser = positive)]
    pub(crate) learning_rate: Option<f64>,

    /// Learning rate of the parameters of the softness; 0 keeps them fixed.
    #[arg(long, value_name = "X", default_value_t = 0.001, value_parser = rate)]
    pub(crate) softness_rate: f64,

    /// Pairs of pictures per step [default: 16].
    #[arg(long, value_name = "N", value_parser = count)]
    pub(crate) pairs: Option<usize>,

    /// Parts of a step, which the processes of mpirun share; batch norms see one part at a time.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = count)]
    pub(crate) parts: usize,

    /// Steps per epoch [default: 100].
    #[arg(long, value_name = "N", value_parser = count)]
    pub(crate) steps: Option<usize>,

    /// Number of epochs; the rates fall to 0.3 of their values after 60 % of them [default: 50].
    #[arg(long, value_name = "N", value_parser = count)]
    pub(crate) epochs: Option<usize>,

    /// Held-out shapes per class that are scored after every epoch.
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = count)]
    pub(crate) val: usize,

    /// Train for a few minutes on two cores instead of about an hour: changes the defaults of
    /// learning rate, pairs and epochs.
    #[arg(long)]
    pub(crate) quick: bool,

    /// Seed of weights, shapes and order.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = seed)]
    pub(crate) seed: u64,

    /// Continue from the checkpoint in the folder.
    #[arg(long)]
    pub(crate) resume: bool,

    /// Show no progress.
    #[arg(long)]
    pub(crate) quiet: bool,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct TrainArgs {
    #[command(flatten)]
    pub(crate) common: Common,

    /// Softness: the name of a family, such as logistic, gauss or mlp, or a softness file in JSON,
    /// whose schedule, if any, starts at its last step.
    #[arg(long, value_name = "NAME|FILE.json", default_value = "logistic")]
    pub(crate) softness: NameOrFile<Family>,

    /// Width of the soft edge before the first step, in NDC (NDC² with --squared); by default that of
    /// earlier papers for the family.
    #[arg(long, value_name = "X", value_parser = positive)]
    pub(crate) scale: Option<f64>,

    /// Use the squared distance as the softness's input.
    #[arg(long)]
    pub(crate) squared: bool,

    /// T-conorm, such as probabilistic, einstein or yager:2.
    #[arg(long, value_name = "NAME", default_value = "probabilistic")]
    pub(crate) t_conorm: TConorm,

    /// Folder for the results; created if missing.
    #[arg(long, value_name = "DIR", default_value = "out/reconstruct")]
    pub(crate) out: PathBuf,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct EvaluateArgs {
    /// Checkpoint of a training.
    #[arg(long, value_name = "FILE", default_value = "out/reconstruct/checkpoint.bin")]
    pub(crate) checkpoint: PathBuf,

    /// Folder with test files; by default the data set of the training.
    #[arg(long, value_name = "DIR")]
    pub(crate) data: Option<PathBuf>,

    /// Test shapes per class.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = count)]
    pub(crate) shapes: usize,

    /// Views per shape, 1 to 24.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = whole::<1, { crate::VIEWS }>)]
    pub(crate) views: usize,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct PredictArgs {
    /// Picture of one object with alpha 0 around it: 64 x 64 pixels, other sizes are scaled.
    pub(crate) picture: PathBuf,

    /// Checkpoint of a training.
    #[arg(long, value_name = "FILE", default_value = "out/reconstruct/checkpoint.bin")]
    pub(crate) checkpoint: PathBuf,

    /// Mesh to write: OBJ, PLY or GLB by its extension.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct CompareArgs {
    #[command(flatten)]
    pub(crate) common: Common,

    /// Methods to compare: a softness and, after a plus, a T-conorm; by default the probabilistic sum.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        default_value = "logistic,gauss,mlp,gauss+einstein,gauss+yager:2"
    )]
    pub(crate) methods: Vec<String>,

    /// Test shapes per class for the table.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = count)]
    pub(crate) test_shapes: usize,

    /// Folder for the results, with a subfolder for each method; created if missing.
    #[arg(long, value_name = "DIR", default_value = "out/reconstruct-compare")]
    pub(crate) out: PathBuf,
}

impl Common {
    /// The training of a softness and a T-conorm.
    pub(crate) fn settings(
        &self,
        (softness, phi): (EdgeSoftness, Vec<f64>),
        t_conorm: TConorm,
    ) -> Settings {
        // Quick: as many pairs as fit a few minutes, at a rate that has an effect within them.
        let (rate, pairs) = if self.quick { (1e-3, 8) } else { (5e-4, 16) };
        Settings {
            data: match &self.data {
                Some(folder) => Data::Files(folder.clone()),
                None => Data::Procedural(self.shapes.unwrap_or(1000)),
            },
            width: self.width.unwrap_or(Width::Quarter),
            softness,
            phi,
            t_conorm: t_conorm.to_string(),
            learning_rate: self.learning_rate.unwrap_or(rate),
            softness_rate: self.softness_rate,
            pairs: self.pairs.unwrap_or(pairs),
            parts: self.parts,
            steps: self.steps.unwrap_or(100),
            val: self.val,
            seed: self.seed,
        }
    }

    /// Number of epochs.
    pub(crate) fn epochs(&self) -> usize {
        self.epochs.unwrap_or(if self.quick { 6 } else { 50 })
    }
}

/// A softness and its first parameters, from a family or a file; a file with a schedule gives those
/// of the last step.
///
/// # Errors
///
/// If the file cannot be used, or it and a scale contradict each other.
pub(crate) fn softness(
    chosen: &NameOrFile<Family>,
    scale: Option<f64>,
    squared: bool,
) -> anyhow::Result<(EdgeSoftness, Vec<f64>)> {
    match chosen {
        NameOrFile::File(_) if scale.is_some() || squared => Err(Error::usage(
            "a softness file holds its own parameters: leave out --scale and --squared",
        )),
        NameOrFile::File(path) => {
            let file = ScheduledSoftness::load(path)?;
            // With a schedule those of the last step: a file with a schedule stores φ at scale 1.
            Ok((file.softness, file.phi_at(1.0, crate::SIZE)))
        }
        &NameOrFile::Name(family) => {
            let softness =
                if squared { EdgeSoftness::squared(family) } else { EdgeSoftness::new(family) };
            Ok((softness, softness.default_phi(scale.unwrap_or(default_scale(softness)))))
        }
    }
}

/// Scale of a family for the probabilistic sum. Source: docs/notes.md, Reconstruction; families
/// that are not listed there use that of the logistic.
fn default_scale(softness: EdgeSoftness) -> f64 {
    match (softness.family, softness.scale_is_squared()) {
        (Family::Uniform | Family::Gauss, false) => 10_f64.powf(-1.5),
        // It has long tails, and a wider one covers the whole picture.
        (Family::Mlp, false) => 10_f64.powf(-2.5),
        (Family::Cauchy, false) => 10_f64.powf(-3.5),
        (Family::Cauchy, true) => 10_f64.powf(-4.5),
        (_, false) => 1e-2,
        (_, true) => 1e-4,
    }
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if x >= 0.0 && f64::is_finite(x) => Ok(x),
        _ => Err("expected 0 or a positive number".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_softness_file_whose_scale_moves_begins_as_at_its_last_step() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("softness.json");
        let edge = EdgeSoftness::new(Family::Gauss);
        ScheduledSoftness::decay(edge, 0.3, 0.02).save(&path).unwrap();
        let (found, phi) = softness(&NameOrFile::File(path), None, false).unwrap();
        assert_eq!(found, edge);
        assert!((edge.scale(&phi) / 0.02 - 1.0).abs() < 1e-12, "{phi:?}");
    }
}
