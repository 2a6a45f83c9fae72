use std::path::PathBuf;

use clap::ValueEnum;
use softrast_cli::EXPERIMENTS;

/// Flags that only POSE has.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Args {
    /// Mesh to view (OBJ, PLY, STL, OFF, GLB or glTF), centred and with the longest side of its box scaled to 2 [default: the project's own fox]
    #[arg(long, value_name = "FILE", display_order = 0)]
    pub mesh: Option<PathBuf>,

    /// Find the camera by a picture in colours, of a mesh with a texture or with colours at its vertices
    #[arg(long)]
    pub colour: bool,

    /// Optimise the field of view too, from a random start, instead of knowing it
    #[arg(long)]
    pub optimise_fov: bool,

    /// Take the mesh as it stands, as the paper's experiments do
    #[arg(long, requires = "mesh")]
    pub raw: bool,

    /// Degrees between the start and the target [default: 35-55]
    #[arg(long, value_enum, help_heading = EXPERIMENTS)]
    pub range: Option<Range>,

    /// Where the pairs of start and target come from
    #[arg(long, value_enum, default_value_t, help_heading = EXPERIMENTS)]
    pub instances: Instances,

    /// Poses to start from while the image does not fit [default: 8 to solve a seed, else 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64), help_heading = EXPERIMENTS)]
    pub starts: Option<u32>,
}

/// How far from the target a run starts.
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
    /// Least and largest angle, in degrees.
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

/// Where the pairs of start and target come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Instances {
    /// Drawn from the seed.
    #[default]
    Seeded,
    /// The 24 pairs of the released runs; the seed counts from 0 to 23.
    Released24,
}
