use std::path::PathBuf;

use softrast_cli::{Detail, Variant};
use softrast_lab::parse::whole;

/// Flags of 2D SHAPE only.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Args {
    /// Cover a picture in colour, by triangles with a colour and a depth each
    #[arg(long)]
    pub colour: bool,

    /// Picture to cover, by its luminance or, with --colour, its colours; images keep its proportions [default: our logo of the variant, or our landscape]
    #[arg(long, value_name = "FILE.png")]
    pub target: Option<PathBuf>,

    /// Number of triangles [default: 800, or 4000 with --variant transfer]
    #[arg(long, value_name = "N", value_parser = whole::<1, 100_000>, allow_negative_numbers = true)]
    pub triangles: Option<usize>,
}

impl Args {
    /// The default number of triangles of a variant.
    pub(crate) fn usual_triangles(variant: Variant) -> usize {
        match variant {
            Variant::Original => 800,
            Variant::Transfer => 4000,
        }
    }

    /// Numbers of triangles for `choose` to try, unless the flags fix it.
    pub(crate) fn detail(&self, usual: usize) -> Option<Detail<Self>> {
        self.triangles.is_none().then(|| Detail {
            flag: "triangles",
            values: vec![usual / 4, usual / 2, usual],
            set: |args: &mut Self, value| args.triangles = Some(value),
        })
    }
}
