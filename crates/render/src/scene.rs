use std::{path::Path, sync::Arc};

use anyhow::Context;
use image::{GrayImage, imageops};
use softrast_inverse::{NameOrFile, ScheduledSoftness};
use softrast_lab::Error;
use softrast_mesh::Mesh;
use softrast_raster::{ImageSize, NEAR, Orbit, Pinhole, TConorm};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Backend, Tensor, tensor, vector};
use softrast_views::{Picture, faces_across_note};

use crate::{
    args::{Args, Target},
    paint::{Colour, samples},
};

/// Inputs of a measurement, as plain numbers.
pub(crate) struct Scene {
    pub(crate) faces: Arc<[[u32; 3]]>,
    /// `[vertices, 3]`, world units.
    pub(crate) vertices: Vec<f64>,
    /// `[views, 4]`, in the layout of `softrast_raster::project`.
    pub(crate) orbits: Vec<f64>,
    pub(crate) size: usize,
    pub(crate) softness: EdgeSoftness,
    pub(crate) phi: Vec<f64>,
    pub(crate) t_conorm: TConorm,
    pub(crate) tolerance: f64,
    /// `[size, size]`, top row first.
    pub(crate) target: Option<Vec<f64>>,
    /// Settings for drawing in colour; none for silhouettes.
    pub(crate) colour: Option<Colour>,
    /// Warnings for the user.
    pub(crate) warnings: Vec<String>,
}

/// Results of one pass, and its times in milliseconds.
pub(crate) struct Step {
    /// `[views, size, size]`, or `[views, 3, size, size]` in colour; top row first.
    pub(crate) image: Vec<f64>,
    /// Mean coverage over views and pixels.
    pub(crate) mean_alpha: f64,
    /// Mean squared difference to the target, and the norm of its gradient with respect to the vertices.
    pub(crate) loss: Option<[f64; 2]>,
    /// Time from world vertices to coverage, or to colours.
    pub(crate) forward_ms: f64,
    /// Time from coverage to the loss and its gradient with respect to the world vertices.
    pub(crate) backward_ms: Option<f64>,
}

impl Step {
    pub(crate) fn of_silhouettes(
        image: Vec<f64>,
        loss: Option<[f64; 2]>,
        forward_ms: f64,
        backward_ms: Option<f64>,
    ) -> Self {
        let mean_alpha = image.iter().sum::<f64>() / image.len() as f64;
        Self { image, mean_alpha, loss, forward_ms, backward_ms }
    }
}

/// Scale of the logistic that rises from 10 % to 90 % within half a pixel, in pixels.
const HALF_PIXEL: f64 = 0.5 / 4.4;

impl Scene {
    /// Reads the files that `args` names.
    pub(crate) fn load(args: &Args) -> anyhow::Result<Self> {
        let (softness, phi) = softness(args)?;
        let (mesh, reasons) = match args.colour {
            true => Mesh::load_textured(&args.mesh)?,
            false => (Mesh::load(&args.mesh)?, vec![]),
        };
        let mesh = if args.raw { mesh } else { mesh.normalized() };
        let coloured = args.colour.then(|| Colour::of(&mesh, args, &reasons)).transpose()?;
        let (colour, warnings) = coloured.map_or((None, vec![]), |(c, warned)| (Some(c), warned));
        let target = args.target.as_ref().map(|target| pixels(target, args.size)).transpose()?;
        let orbit = |&azimuth: &f64| [args.distance, args.elevation, azimuth, args.fov];
        let camera = |&azimuth_deg: &f64| {
            let (distance, elevation_deg, fov_deg) = (args.distance, args.elevation, args.fov);
            let orbit = Orbit { distance, elevation_deg, azimuth_deg, fov_deg };
            (format!("azimuth {azimuth_deg}"), Pinhole::from_orbit(&orbit, args.size))
        };
        let across = faces_across_note(&mesh, args.azimuths.iter().map(camera), NEAR);
        Ok(Self {
            faces: mesh.faces().into(),
            vertices: mesh.positions().as_flattened().to_vec(),
            orbits: args.azimuths.iter().flat_map(orbit).collect(),
            size: args.size,
            softness,
            phi,
            t_conorm: args.t_conorm,
            tolerance: args.tolerance,
            target,
            colour,
            warnings: warnings.into_iter().chain(across).collect(),
        })
    }

    /// Number of views.
    pub(crate) fn views(&self) -> usize {
        self.orbits.len() / 4
    }

    /// The vertices `[1, vertices, 3]`, shared by all views.
    pub(crate) fn vertices<B: Backend>(&self) -> Tensor<B, 3> {
        tensor(self.vertices.clone(), [1, self.vertices.len() / 3, 3])
    }

    /// The cameras `[views, 4]`.
    pub(crate) fn orbits<B: Backend>(&self) -> Tensor<B, 2> {
        tensor(self.orbits.clone(), [self.views(), 4])
    }

    /// Parameters of the softness.
    pub(crate) fn phi<B: Backend>(&self) -> Tensor<B, 1> {
        vector(&self.phi)
    }

    /// The target of all views, `[1, size, size]`.
    pub(crate) fn target<B: Backend>(&self) -> Option<Tensor<B, 3>> {
        Some(tensor(self.target.clone()?, [1, self.size, self.size]))
    }
}

fn softness(args: &Args) -> anyhow::Result<(EdgeSoftness, Vec<f64>)> {
    let across = args.size * if args.colour { samples(args) } else { 1 };
    // In colour, a softness of finite support does not enlarge front surfaces: docs/notes.md, Colour.
    let usual = NameOrFile::Name(if args.colour { Family::Uniform } else { Family::Logistic });
    match args.softness.as_ref().unwrap_or(&usual) {
        NameOrFile::File(_) if args.scale.is_some() || args.squared => {
            Err(Error::usage("--scale and --squared are for a named softness: a file has its own"))
        }
        NameOrFile::File(path) => {
            let file = ScheduledSoftness::load(path).context("--softness")?;
            // As at the last step if its scale moves: a file with a schedule stores φ at scale 1.
            Ok((file.softness, file.phi_at(1.0, across)))
        }
        &NameOrFile::Name(family) => {
            let edge = if args.squared { EdgeSoftness::squared } else { EdgeSoftness::new };
            let softness = edge(family);
            let narrow = HALF_PIXEL * 2.0 / across as f64;
            let scale = args.scale.unwrap_or(if args.squared { narrow * narrow } else { narrow });
            Ok((softness, softness.default_phi(scale)))
        }
    }
}

/// Values `[size, size]` in [0, 1], top row first.
fn pixels(target: &Target, size: usize) -> anyhow::Result<Vec<f64>> {
    match target {
        &Target::Disk { x, y, radius } => Ok(disk(x, y, radius, size)),
        Target::Picture(path) => picture(path, size),
    }
}

fn disk(x: f64, y: f64, radius: f64, size: usize) -> Vec<f64> {
    let centre = |index: usize| (2.0 * index as f64 + 1.0 - size as f64) / size as f64;
    let covered = |pixel: usize| {
        let (dx, dy) = (centre(pixel % size) - x, centre(size - 1 - pixel / size) - y);
        f64::from(u8::from(dx * dx + dy * dy <= radius * radius))
    };
    (0..size * size).map(covered).collect()
}

fn picture(path: &Path, size: usize) -> anyhow::Result<Vec<f64>> {
    let picture = Picture::load_luminance(path).context("cannot read the target")?;
    let (whole, found) = (picture.whole_size(), picture.size());
    let levels = picture.pixels().iter().map(|level| (255.0 * level).round() as u8).collect();
    let image = GrayImage::from_raw(found.width as u32, found.height as u32, levels);
    let mut image = image.context("a picture of whole rows")?;
    if whole != ImageSize::from(size) {
        eprintln!("the target is {whole} pixels: resized to {size} x {size}");
    }
    if found != ImageSize::from(size) {
        image = imageops::resize(&image, size as u32, size as u32, imageops::FilterType::Triangle);
    }
    Ok(image.pixels().map(|pixel| f64::from(pixel.0[0]) / 255.0).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_has_its_area_and_its_place() {
        let pixels = disk(0.5, 0.5, 0.25, 200);
        let area = pixels.iter().sum::<f64>() * 4.0 / 200.0 / 200.0;
        assert!((area - std::f64::consts::PI / 16.0).abs() < 2e-3, "{area}");
        assert_eq!([pixels[50 * 200 + 150], pixels[150 * 200 + 150]], [1.0, 0.0], "y points up");
    }
}
