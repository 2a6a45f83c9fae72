use std::path::PathBuf;

/// Flags of 3D SHAPE only.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Args {
    /// Mesh whose silhouettes are the target (OBJ, PLY, STL, OFF, GLB or glTF), centred and with the longest side of its box scaled to 1 [default: our airplane, or chair]
    #[arg(long, value_name = "FILE")]
    pub mesh: Option<PathBuf>,

    /// Use the target mesh without centring and scaling, as the paper's experiments do
    #[arg(long, requires = "mesh")]
    pub raw: bool,

    /// Mesh to deform (OBJ, PLY, STL, OFF, GLB or glTF), centred and with the longest side scaled to 1 [default: a sphere]
    #[arg(long, value_name = "FILE", conflicts_with = "detail")]
    pub template: Option<PathBuf>,

    /// Subdivisions of the sphere: 162, 642 or 2,562 vertices [default: 3]
    #[arg(long, value_name = "2|3|4", value_parser = detail)]
    pub detail: Option<usize>,

    /// Elevation of all 24 cameras, -90 to 90 [default: 30, 60, 0, -30, -60 by seed]
    #[arg(long, value_name = "DEGREES", value_parser = elevation, allow_negative_numbers = true)]
    pub elevation: Option<f64>,
}

/// Levels of the icosphere, the coarsest first, and the default.
pub(crate) const DETAILS: [usize; 3] = [2, 3, 4];
pub(crate) const DETAIL: usize = 3;

fn detail(text: &str) -> Result<usize, String> {
    let detail = text.parse().ok().filter(|level| DETAILS.contains(level));
    detail.ok_or_else(|| "expected 2, 3 or 4".into())
}

fn elevation(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(degrees) if (-90.0..=90.0).contains(&degrees) => Ok(degrees),
        _ => Err("expected degrees from -90 to 90".into()),
    }
}
