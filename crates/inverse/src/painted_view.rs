use anyhow::{Context, ensure};
use softrast_mesh::Mesh;

use crate::{Picture, View, coloured_pixels};

/// Squared errors below this count as this: 100 dB.
const LEAST_ERROR: f64 = 1e-10;

/// A view with the colours of its object.
#[derive(Clone, Debug)]
pub struct PaintedView {
    /// The view.
    pub view: View,
    /// Red, green and blue, as the numbers of the picture are, times the part of each pixel that counts.
    pub over_black: [Picture; 3],
    /// The part of each pixel that counts, from 0 to 1.
    pub part: Picture,
}

impl PaintedView {
    /// The view with the colours of its picture file.
    ///
    /// In a picture with transparency a pixel counts as much as its mask says, and its colour is known without what is behind: so
    /// the object is seen over black. In one that is opaque all over, pixels at the outline are mixed with what is behind, and a mask of
    /// luminance says how bright a pixel is and not how much of it the object covers. So there a pixel counts in full if its mask is at
    /// least one half, and else not at all: what is outside of the mask is compared with nothing.
    ///
    /// # Errors
    ///
    /// If the file is missing, no picture, or not of the size of the mask; if no pixel counts.
    pub fn load(view: &View) -> anyhow::Result<Self> {
        let of = || {
            let [red, green, blue, opacity] = Picture::load_with_opacity(&view.picture)?;
            let (found, mask) = (opacity.size(), view.mask.size());
            ensure!(
                found == mask,
                "the picture has {} x {} pixels, but its mask {} x {}",
                found.width,
                found.height,
                mask.width,
                mask.height
            );
            Ok(Self::new(view.clone(), [red, green, blue], &opacity))
        };
        let painted = of().with_context(|| view.name.clone())?;
        ensure!(
            painted.part.pixels().iter().any(|&part| part > 0.0),
            "{}: no pixel of the mask has a colour",
            view.name
        );
        Ok(painted)
    }

    /// The view with these colours, and how opaque the picture is, all of the size of its mask; see [`PaintedView::load`].
    ///
    /// # Panics
    ///
    /// If sizes differ.
    pub fn new(view: View, colours: [Picture; 3], opacity: &Picture) -> Self {
        let opaque = opacity.pixels().iter().all(|&x| x >= 1.0);
        let levels = view.mask.pixels().iter().zip(opacity.pixels());
        let part = levels.map(|(&mask, &opacity)| match opaque {
            true => f32::from(u8::from(mask >= 0.5)),
            // The colour of what is transparent all through is not known.
            false => mask * f32::from(u8::from(opacity > 0.0)),
        });
        let width = view.mask.size().width;
        let part = Picture::new(part.collect(), width);
        let over_black = colours.map(|channel| {
            assert_eq!(channel.size(), part.size(), "sizes of a channel and the mask");
            let pixels = channel.pixels().iter().zip(part.pixels());
            Picture::new(pixels.map(|(x, part)| x * part).collect(), width)
        });
        Self { view, over_black, part }
    }

    /// How near a mesh with colours comes to the view, in decibels, at most 100: `-10 log₁₀` of the mean squared difference of red, green and
    /// blue, each over black, in all pixels that the mesh or what counts of the mask covers at least in part. None if there is no such.
    ///
    /// The mesh is drawn by [`coloured_pixels`].
    pub fn psnr(&self, mesh: &Mesh) -> Option<f64> {
        let drawn = coloured_pixels(mesh, &self.view.camera);
        self.psnr_of(&drawn)
    }

    /// The same of what [`coloured_pixels`] drew.
    ///
    /// # Panics
    ///
    /// If it is of another size.
    pub fn psnr_of(&self, drawn: &[Vec<f64>; 4]) -> Option<f64> {
        let [.., covered] = drawn;
        let part = self.part.pixels();
        assert_eq!(covered.len(), part.len(), "pixels of what is drawn and of the view");
        let inside = |pixel: &usize| covered[*pixel] > 0.0 || part[*pixel] > 0.0;
        let pixels: Vec<usize> = (0..part.len()).filter(inside).collect();
        let error = |pixel: usize| {
            let off = |k: usize| drawn[k][pixel] - f64::from(self.over_black[k].pixels()[pixel]);
            (0..3).map(|k| off(k).powi(2)).sum::<f64>() / 3.0
        };
        let mean = pixels.iter().map(|&k| error(k)).sum::<f64>() / pixels.len() as f64;
        (!pixels.is_empty()).then(|| -10.0 * mean.max(LEAST_ERROR).log10())
    }
}
