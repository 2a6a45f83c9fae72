use std::path::PathBuf;

use clap::ValueEnum;
use softrast_cli::EXPERIMENTS;

/// Flags of POSE only.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Args {
    /// Mesh to view (OBJ, PLY, STL, OFF, GLB or glTF), centred and with the longest side of its box scaled to 2 [default: the project's own fox]
    #[arg(long, value_name = "FILE", display_order = 0)]
    pub mesh: Option<PathBuf>,

    /// Find the camera from a colour picture, of a mesh with a texture or vertex colours
    #[arg(long)]
    pub colour: bool,

    /// Also optimise the field of view, from a random start; by default it is known
    #[arg(long)]
    pub optimise_fov: bool,

    /// Use the mesh without centring and scaling, as the paper's experiments do
    #[arg(long, requires = "mesh")]
    pub raw: bool,

    /// Degrees between the start and the target [default: 35-55]
    #[arg(long, value_enum, help_heading = EXPERIMENTS)]
    pub range: Option<Range>,

    /// Source of the pairs of start and target
    #[arg(long, value_enum, default_value_t, help_heading = EXPERIMENTS)]
    pub instances: Instances,

    /// Starts to try while the image does not fit [default: 8 to solve a seed, else 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64), help_heading = EXPERIMENTS)]
    pub starts: Option<u32>,
}

/// Angle between start and target of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Range {
    /// 15 to 35 degrees.
    #[value(name = "15-35")]
    Near,
    /// 35 to 55 degrees.
    #[default]
    #[value(name = "35-55")]
    Middle,
    /// 55 to 75 degrees.
    #[value(name = "55-75")]
    Far,
    /// 15 to 75 degrees.
    #[value(name = "15-75")]
    All,
}

impl Range {
    /// Smallest and largest angle, in degrees.
    ///
    /// Source: Wu et al. 2024, Sec. 5.1 (three parts of [15, 75]).
    pub fn degrees(self) -> [f64; 2] {
        match self {
            Range::Near => [15.0, 35.0],
            Range::Middle => [35.0, 55.0],
            Range::Far => [55.0, 75.0],
            Range::All => [15.0, 75.0],
        }
    }

    /// Name on the command line and in the results.
    pub fn name(self) -> &'static str {
        match self {
            Range::Near => "15-35",
            Range::Middle => "35-55",
            Range::Far => "55-75",
            Range::All => "15-75",
        }
    }
}

/// Source of the pairs of start and target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Instances {
    /// Random, by seed.
    #[default]
    Seeded,
    /// The 24 pairs of the released runs; the seed counts from 0 to 23.
    Released24,
}
