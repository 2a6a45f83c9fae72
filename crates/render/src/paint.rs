//! Paint of a mesh's faces: a texture, vertex colours, or grey.

use std::{fmt, sync::Arc};

use anyhow::{Context, bail};
use image::RgbImage;
use softrast_lab::Error;
use softrast_mesh::{Mesh, MeshError};
use softrast_raster::Attributes;
use softrast_tensor::{Backend, Tensor, TensorData, tensor};
use softrast_views::{Atlas, PictureFile};

use crate::args::Args;

/// Largest number of texels, about 3500 × 3500, at some 60 bytes each in the op. Larger pictures are reduced.
const MOST_TEXELS: usize = 12 << 20;
/// Red, green and blue of a mesh without colours.
const GREY: [f64; 3] = [0.7; 3];

/// Scale of the depth softness relative to the longest side of the mesh: below the thickness of thin parts.
const DEPTH: f64 = 0.005;

/// Settings for drawing a mesh in colour.
pub(crate) struct Colour {
    pub(crate) paint: Paint,
    /// Whether a lamp at the camera lights it.
    pub(crate) shade: bool,
    /// Samples along each side of a pixel.
    pub(crate) samples: usize,
    /// Scale of the depth softness in world units; none for the default of the op.
    pub(crate) depth_scale: Option<f64>,
}

/// Colours of faces, sRGB from 0 to 1.
pub(crate) enum Paint {
    Texture {
        /// `[entries, 2]`, v up.
        coordinates: Vec<f64>,
        /// The entry of each corner.
        corners: Arc<[[u32; 3]]>,
        picture: RgbImage,
    },
    /// `[vertices, 3]`.
    Vertices(Vec<f64>),
    Grey,
}

/// Largest number of samples along each side of an image: by default, and on request (the pixels of the largest image).
const USUAL_SAMPLES: usize = 2048;
const MOST_SAMPLES: usize = 4096;

impl Colour {
    /// Settings requested by `args` for a mesh in its drawn position, and warnings for the user.
    pub(crate) fn of(
        mesh: &Mesh,
        args: &Args,
        reasons: &[MeshError],
    ) -> anyhow::Result<(Self, Vec<String>)> {
        if args.size * samples(args) > MOST_SAMPLES {
            return Err(Error::usage(format!(
                "--samples {} times --size {} is above {MOST_SAMPLES}: take fewer",
                samples(args),
                args.size
            )));
        }
        let (paint, warnings) = Paint::of(mesh, args, reasons)?;
        let [low, high] = mesh.bounds();
        let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        // With a softness of infinite support, so narrow a depth scale would draw near faces all over the image: docs/notes.md, Colour.
        let depth_scale = args.softness.is_none().then_some(DEPTH * longest);
        Ok((Self { paint, shade: args.shade, samples: samples(args), depth_scale }, warnings))
    }
}

/// Samples along each side of a pixel, by default 1 for a requested softness or scale, so that its edges show unchanged.
pub(crate) fn samples(args: &Args) -> usize {
    let usual = || match (&args.softness, args.scale) {
        (None, None) => (1..=4).rev().find(|n| n * args.size <= USUAL_SAMPLES).unwrap_or(1),
        _ => 1,
    };
    args.samples.unwrap_or_else(usual)
}

impl Paint {
    /// The paint requested by `args`, and warnings; `reasons` explain why colours or the texture are missing or differ from the file.
    fn of(mesh: &Mesh, args: &Args, reasons: &[MeshError]) -> anyhow::Result<(Self, Vec<String>)> {
        let name = args.mesh.display();
        let mut warnings: Vec<String> = reasons.iter().map(ToString::to_string).collect();
        if let Some(path) = &args.texture {
            return match mesh.texture() {
                Some(texture) => {
                    let picture = PictureFile::load(path).context("--texture")?;
                    let (coordinates, corners) = (texture.coordinates(), texture.corners());
                    let picture = picture.texels(MOST_TEXELS);
                    Ok((Self::on_picture(coordinates, corners, picture), vec![]))
                }
                None if warnings.is_empty() => {
                    bail!("--texture: {name} has no texture coordinates")
                }
                None => bail!("--texture has no place on the mesh: {}", warnings.join("; ")),
            };
        }
        let (atlas, errors) = Atlas::of(mesh, MOST_TEXELS);
        let left_out = match atlas {
            Some(_) => "drawn without a picture",
            None => "drawn without its texture",
        };
        let warning = |reason| format!("{left_out}: {name}: its picture: {reason:#}");
        warnings.extend(errors.into_iter().map(warning));
        if let Some(atlas) = atlas {
            let (coordinates, corners) = (atlas.coordinates(), atlas.corners());
            let paint = Self::on_picture(coordinates, corners, atlas.picture().clone());
            return Ok((paint, warnings));
        }
        let paint = match mesh.colours() {
            Some(colours) => Self::Vertices(colours.as_flattened().to_vec()),
            None => Self::Grey,
        };
        Ok((paint, warnings))
    }

    fn on_picture(coordinates: &[[f64; 2]], corners: &[[u32; 3]], picture: RgbImage) -> Self {
        let coordinates = coordinates.as_flattened().to_vec();
        Self::Texture { coordinates, corners: corners.into(), picture }
    }

    /// Attributes of the op for these faces: three channels.
    pub(crate) fn attributes<B: Backend>(&self, faces: &Arc<[[u32; 3]]>) -> Attributes<B> {
        match self {
            Self::Texture { coordinates, corners, picture } => {
                let places = tensor(coordinates.clone(), [1, coordinates.len() / 2, 2]);
                let (width, height) = picture.dimensions();
                let levels: Vec<f32> = picture.iter().map(|&x| f32::from(x) / 255.0).collect();
                let data = TensorData::new(levels, [height as usize, width as usize, 3]);
                let texels = Tensor::from_data(data, (&Default::default(), places.dtype()));
                Attributes::new(places, corners.clone()).with_texture(texels)
            }
            Self::Vertices(colours) => {
                let values = tensor(colours.clone(), [1, colours.len() / 3, 3]);
                Attributes::new(values, faces.clone())
            }
            Self::Grey => {
                Attributes::new(tensor(GREY.to_vec(), [1, 1, 3]), vec![[0; 3]; faces.len()].into())
            }
        }
    }
}

impl fmt::Display for Paint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Texture { picture, .. } => {
                write!(f, "texture of {} x {} texels", picture.width(), picture.height())
            }
            Self::Vertices(_) => f.write_str("colours of vertices"),
            Self::Grey => f.write_str("grey: the mesh has no texture and no colours"),
        }
    }
}
