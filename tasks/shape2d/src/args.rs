use std::path::PathBuf;

/// Flags that only 2D SHAPE has.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Args {
    /// Picture to cover, by its luminance; by default the project's own logo of the variant.
    #[arg(long, value_name = "FILE.png")]
    pub target: Option<PathBuf>,

    /// Number of triangles [default: 800, or 4000 with --variant transfer].
    #[arg(long, value_name = "N", value_parser = triangles, allow_negative_numbers = true)]
    pub triangles: Option<usize>,
}

/// More triangles than this would run for hours.
const MOST: usize = 100_000;

fn triangles(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|n| (1..=MOST).contains(n));
    count.ok_or_else(|| format!("expected a whole number from 1 to {MOST}"))
}
