use std::{ffi::OsString, path::PathBuf};

use clap::ValueEnum;
use softrast_cli::MaskFlags;
use softrast_inverse::{FoundTexture, shape::ShapeFit};
use softrast_lab::parse::positive;

/// Pictures and the cameras that took them.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct Views {
    /// Folder with pictures and their cameras: transforms.json (instant-ngp, nerfstudio), a model of COLMAP (also in sparse/0 or colmap),
    /// or `transforms_train.json`. Masks are transparency, files that it names, or those of --masks
    #[arg(long, value_name = "DIR")]
    pub views: Option<PathBuf>,

    /// Held-out views, on which the result is scored: a number of those in the folder, evenly spaced, or another file of cameras in the
    /// same world, such as `transforms_test.json`
    #[arg(long, value_name = "N|FILE", requires = "views")]
    pub hold_out: Option<HoldOut>,

    /// Start of the surface: the visual hull of the masks, or a sphere, which has no holes [default: hull]
    #[arg(long, value_enum, requires = "views", conflicts_with = "template")]
    pub start: Option<Begin>,

    /// Fit the shape to the colours of the pictures too, and give them to the mesh [default: if all pictures are there and some are not
    /// grey]. With --mesh the shape is given, in the world units of the cameras, and fixed
    #[arg(long)]
    pub colour: bool,

    /// Use the masks alone, whatever the pictures show
    #[arg(long, requires = "views", conflicts_with_all = ["colour", "mesh"])]
    pub masks_only: bool,

    /// Texels a side of the texture, from 64 to 4096 [default: about one for each pixel that shows the surface, up to 2048]
    #[arg(long, value_name = "N", requires = "views", conflicts_with = "masks_only", value_parser = clap::value_parser!(u32).range(FoundTexture::SIZES[0] as i64..=FoundTexture::SIZES[1] as i64))]
    pub texture_size: Option<u32>,

    /// Let normals pull the shape: red, green and blue are (n + 1) / 2 of a normal n in the axes of the world, in the pictures, or in those of a folder with
    /// their names
    #[arg(long, value_name = "DIR", requires = "views", num_args = 0..=1, conflicts_with_all = ["mesh", "template"])]
    pub normals: Option<Option<PathBuf>>,

    /// Largest number of faces [default: as many as the pixels resolve, up to 200000]
    #[arg(long, value_name = "N", requires = "views", conflicts_with = "template", value_parser = clap::value_parser!(u32).range(100..=2_000_000))]
    pub faces: Option<u32>,

    /// Smoothing of the surface relative to the usual, at most 5
    #[arg(long, value_name = "FACTOR", requires = "views", value_parser = smoothness, allow_negative_numbers = true)]
    pub smooth: Option<f64>,

    /// Conversion of pictures to masks.
    #[command(flatten)]
    pub masks: MaskFlags,
}

fn smoothness(text: &str) -> Result<f64, String> {
    positive(text).and_then(|factor| match factor <= ShapeFit::SMOOTHEST {
        true => Ok(factor),
        false => Err(format!("expected at most {}", ShapeFit::SMOOTHEST)),
    })
}

/// Held-out views, on which a result is scored.
#[derive(Clone, Debug)]
pub enum HoldOut {
    /// This many of the folder's views, evenly spaced.
    Count(usize),
    /// All views of another file of cameras.
    Cameras(PathBuf),
}

impl From<OsString> for HoldOut {
    fn from(text: OsString) -> Self {
        match text.to_str().and_then(|text| text.parse().ok()) {
            Some(count) => Self::Count(count),
            None => Self::Cameras(text.into()),
        }
    }
}

/// Start of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Begin {
    /// The space that no mask excludes.
    #[default]
    Hull,
    /// A sphere around the object.
    Sphere,
}
