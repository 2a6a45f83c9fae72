use std::path::PathBuf;

use softrast_lab::parse::whole;

/// Flags that only 2D SHAPE has.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Args {
    /// Cover a picture in its colours, by triangles that each have a colour and a depth
    #[arg(long)]
    pub colour: bool,

    /// Picture to cover, by its luminance or with --colour in its colours [default: our logo of the variant, or our landscape]
    #[arg(long, value_name = "FILE.png")]
    pub target: Option<PathBuf>,

    /// Number of triangles [default: 800, or 4000 with --variant transfer]
    #[arg(long, value_name = "N", value_parser = whole::<1, 100_000>, allow_negative_numbers = true)]
    pub triangles: Option<usize>,
}
