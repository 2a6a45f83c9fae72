use softrast_inverse::NameOrFile;
use softrast_lab::parse::positive;
use softrast_softness::DepthSoftness;

/// Name of the task.
pub(crate) const NAME: &str = "occlusion";

/// Flags of OCCLUSION only.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Args {
    /// Softness of the depth: a family, `depth_mlp`, or a file [default: as for edges]
    #[arg(long, value_name = "NAME|FILE.json")]
    pub depth_softness: Option<NameOrFile<DepthSoftness>>,

    /// Width of the depth softness, in units of the distance between both planes [default: 0.1]
    #[arg(long, value_name = "X", value_parser = positive, allow_negative_numbers = true)]
    pub depth_scale: Option<f64>,
}
