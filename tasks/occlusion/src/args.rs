use std::path::PathBuf;

use softrast_lab::parse::positive;
use softrast_softness::DepthSoftness;

/// Name of the task.
pub(crate) const NAME: &str = "occlusion";

/// Flags that only OCCLUSION has.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Args {
    /// Softness of the depth: a family, `depth_mlp`, or a file [default: like that of edges]
    #[arg(long, value_name = "NAME|FILE.json", value_parser = depth_softness)]
    pub depth_softness: Option<DepthSoftnessChoice>,

    /// Width of the soft depth, in units of the distance between both planes [default: 0.1]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub depth_scale: Option<f64>,
}

/// A depth softness as named on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DepthSoftnessChoice {
    /// By its name.
    Named(DepthSoftness),
    /// A file, not opened yet.
    File(PathBuf),
}

fn depth_softness(text: &str) -> Result<DepthSoftnessChoice, String> {
    if text.to_ascii_lowercase().ends_with(".json") {
        return Ok(DepthSoftnessChoice::File(text.into()));
    }
    let named = text.parse().map(DepthSoftnessChoice::Named);
    named.map_err(|error| format!("{error}, or a file that ends in .json"))
}
