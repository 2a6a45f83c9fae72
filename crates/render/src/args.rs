use std::{path::PathBuf, str::FromStr};

use clap::Parser;
use softrast_inverse::NameOrFile;
use softrast_lab::parse::{count, positive, share, whole};
use softrast_raster::{TConorm, low_level::Rasterizer};
use softrast_softness::Family;

/// Draws soft silhouettes or colours of a mesh and measures what they cost.
#[derive(Debug, Parser)]
#[command(name = "render", version, allow_negative_numbers = true)]
pub(crate) struct Args {
    /// Mesh to draw: OBJ, PLY, STL, OFF, GLB or glTF
    #[arg(value_name = "MESH")]
    pub(crate) mesh: PathBuf,

    /// Width and height of the image, in pixels
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = whole::<1, 4096>)]
    pub(crate) size: usize,

    /// Azimuths of the views in degrees: 0 looks along +z from -z, 90 from +x
    #[arg(long, value_name = "A,B,..", default_value = "30", value_delimiter = ',', value_parser = finite, allow_hyphen_values = true)]
    pub(crate) azimuths: Vec<f64>,

    /// Elevation of the views, in degrees above the ground
    #[arg(long, value_name = "X", default_value_t = 20.0, value_parser = finite)]
    pub(crate) elevation: f64,

    /// Distance of the camera from the origin, in world units
    #[arg(long, value_name = "X", default_value_t = 2.732, value_parser = positive)]
    pub(crate) distance: f64,

    /// Whole field of view
    #[arg(long, value_name = "DEGREES", default_value_t = 60.0, value_parser = angle)]
    pub(crate) fov: f64,

    /// Draw the mesh in colour, on white: its texture if it has one, else its vertex colours, else grey
    #[arg(long, conflicts_with_all = ["reference", "target", "t_conorm"])]
    pub(crate) colour: bool,

    /// Picture to use as texture instead of the mesh's own
    #[arg(long, value_name = "FILE.png", requires = "colour")]
    pub(crate) texture: Option<PathBuf>,

    /// Light the mesh from the camera
    #[arg(long, requires = "colour")]
    pub(crate) shade: bool,

    /// Samples along each side of a pixel in colour [default: 4, fewer above 512 pixels, 1 with --softness or --scale]
    #[arg(long, value_name = "N", value_parser = whole::<1, 4>, requires = "colour")]
    pub(crate) samples: Option<usize>,

    /// Softness: a name such as logistic, gauss, exp, gamma or mlp, or a softness file, used as at the last step if its scale moves
    /// [default: logistic, uniform with --colour]
    #[arg(long, value_name = "NAME|FILE.json")]
    pub(crate) softness: Option<NameOrFile<Family>>,

    /// Scale of a named softness in NDC, NDC² with --squared; by default edges are about half a pixel wide, half a sample with --colour
    #[arg(long, value_name = "X", value_parser = positive)]
    pub(crate) scale: Option<f64>,

    /// Apply a named softness to the squared distance
    #[arg(long)]
    pub(crate) squared: bool,

    /// T-conorm that joins faces: probabilistic, einstein, hamacher:p, frank:p, yager:p, `aczel_alsina:p`, dombi:p or `schweizer_sklar:p`
    #[arg(long, value_name = "NAME[:p]", default_value = "probabilistic")]
    pub(crate) t_conorm: TConorm,

    /// Keep the coordinates of the mesh, instead of centring it with its longest side scaled to 2
    #[arg(long)]
    pub(crate) raw: bool,

    /// Largest error of a pixel relative to evaluating every pixel-face pair
    #[arg(long, value_name = "X", default_value_t = Rasterizer::TOLERANCE, value_parser = share)]
    pub(crate) tolerance: f64,

    /// Evaluate every pixel-face pair, by tensor ops in f64; takes minutes
    #[arg(long)]
    pub(crate) reference: bool,

    /// Image to compare all views with: a picture (its luminance is used), or a disk at x, y with radius r in NDC, y up
    #[arg(long, value_name = "FILE.png|disk:x,y,r")]
    pub(crate) target: Option<Target>,

    /// Backend to draw on: ndarray, flex, wgpu or cuda, if the program was built with it; by default the first of these
    #[arg(long, value_name = "NAME", conflicts_with = "reference")]
    pub(crate) backend: Option<String>,

    /// Timed repetitions, after an untimed one [default: 5, or 1 with --reference]
    #[arg(long, value_name = "N", value_parser = count)]
    pub(crate) repeat: Option<usize>,

    /// Threads to use; all cores by default
    #[arg(long, value_name = "N", value_parser = count)]
    pub(crate) threads: Option<usize>,

    /// Picture to write; a contact sheet if there are several views
    #[arg(long, value_name = "FILE.png", default_value = "out/render.png")]
    pub(crate) out: PathBuf,

    /// Print one JSON object instead of a table
    #[arg(long)]
    pub(crate) json: bool,

    /// Show no progress
    #[arg(long)]
    pub(crate) quiet: bool,
}

/// Target of the silhouettes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Target {
    /// A disk with a hard edge at pixel centres, in NDC (x right, y up).
    Disk { x: f64, y: f64, radius: f64 },
    /// The luminance of a picture.
    Picture(PathBuf),
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some(numbers) = text.strip_prefix("disk:") else {
            return Ok(Self::Picture(text.into()));
        };
        let numbers: Result<Vec<f64>, _> = numbers.split(',').map(|x| x.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[x, y, radius]) if x.is_finite() && y.is_finite() && radius > 0.0 => {
                Ok(Self::Disk { x, y, radius })
            }
            _ => Err("expected disk:x,y,r with a positive radius r".into()),
        }
    }
}

fn finite(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|x: &f64| x.is_finite());
    number.ok_or_else(|| "expected a number (or several, with commas between them)".into())
}

fn angle(text: &str) -> Result<f64, String> {
    let angle = positive(text).ok().filter(|&angle| angle < 180.0);
    angle.ok_or_else(|| "expected degrees between 0 and 180".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn azimuths_may_be_many_and_negative() {
        let args = Args::try_parse_from(["render", "a.obj", "--azimuths", "-30,0,1e1"]).unwrap();
        assert_eq!(args.azimuths, [-30.0, 0.0, 10.0]);
    }

    #[test]
    fn a_broken_disk_is_refused() {
        for text in ["disk:", "disk:1,2", "disk:0,0,0", "disk:0,0,-1", "disk:a,0,1", "disk:0,0,nan"]
        {
            assert!(text.parse::<Target>().is_err(), "{text}");
        }
    }
}
