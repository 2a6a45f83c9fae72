use anyhow::{Context, ensure};
use softrast_mesh::Mesh;

use crate::{Picture, View, coloured_pixels, levels::Levels};

/// Lower bound of squared errors: 100 dB.
const LEAST_ERROR: f64 = 1e-10;

/// A view with the colours of its object.
#[derive(Clone, Debug)]
pub struct PaintedView {
    /// The view.
    pub view: View,
    /// Red, green and blue, as the picture has them.
    colours: [Levels; 3],
    /// The weight of each pixel, from 0 to 1.
    pub part: Picture,
    /// Whether weights are 0 or 1.
    opaque: bool,
}

impl PaintedView {
    /// The view with the colours of its picture file.
    ///
    /// In a picture with transparency the weight of a pixel is its mask, and its colour is known without the background: the object is
    /// compared over black. In an opaque picture, pixels at the outline are mixed with the background, and a mask of luminance is the
    /// brightness of a pixel and not its coverage. There a pixel has weight 1 if its mask and those of all eight neighbours are at least
    /// one half, else 0: the outline and everything outside are excluded. If that excludes all pixels, the outline is included.
    ///
    /// # Errors
    ///
    /// If the file is missing, not a picture, or not of the size of the mask; if no pixel has a weight.
    pub fn load(view: &View) -> anyhow::Result<Self> {
        let [red, green, blue, opacity] = view.load_colours()?;
        let painted = Self::new(view.clone(), [red, green, blue], &opacity);
        ensure!(
            painted.part.pixels().iter().any(|&part| part > 0.0),
            "{}: no pixel of the mask has a colour",
            view.name
        );
        Ok(painted)
    }

    /// The view with these colours and the opacity of the picture, all of the size of its mask; see [`PaintedView::load`].
    ///
    /// # Panics
    ///
    /// If sizes differ.
    pub fn new(view: View, colours: [Picture; 3], opacity: &Picture) -> Self {
        let opaque = opacity.pixels().iter().all(|&x| x >= 1.0);
        let width = view.mask.size().width;
        let levels = view.mask.pixels().iter().zip(opacity.pixels());
        // The colour of fully transparent pixels is unknown.
        let known = levels.map(|(&mask, &opacity)| mask * f32::from(u8::from(opacity > 0.0)));
        let part = match opaque {
            true => within(&view.mask),
            // Copies share their pixels.
            false if known.clone().eq(view.mask.pixels().iter().copied()) => view.mask.clone(),
            false => Picture::new(known.collect(), width),
        };
        let colours = colours.map(|channel| {
            assert_eq!(channel.size(), part.size(), "sizes of a channel and the mask");
            Levels::of(channel.pixels())
        });
        Self { view, colours, part, opaque }
    }

    /// Red, green and blue, in the levels of the picture, times the weight of each pixel. They are computed anew at each call: the view
    /// itself keeps 16 bits of them where the picture has no more, half the memory of a [`Picture`].
    pub fn over_black(&self) -> [Picture; 3] {
        let width = self.part.size().width;
        [0, 1, 2].map(|k| {
            let pixels = (0..self.part.pixels().len()).map(|pixel| self.level(k, pixel));
            Picture::new(pixels.collect(), width)
        })
    }

    /// The level of a channel over black.
    fn level(&self, channel: usize, pixel: usize) -> f32 {
        self.colours[channel].at(pixel) * self.part.pixels()[pixel]
    }

    /// Whether at least one in a thousand of the pixels that count is not grey: its channels differ by a sixteenth or more.
    pub fn is_coloured(&self) -> bool {
        let counts = |&pixel: &usize| self.part.pixels()[pixel] > 0.0;
        let in_colour = |&pixel: &usize| {
            let [red, green, blue] = self.colours.each_ref().map(|levels| levels.at(pixel));
            red.max(green).max(blue) - red.min(green).min(blue) >= 1.0 / 16.0
        };
        let all = || (0..self.part.pixels().len()).filter(counts);
        1000 * all().filter(in_colour).count() > all().count()
    }

    /// Whether the picture is opaque everywhere, so that weights are 0 or 1.
    pub fn is_opaque(&self) -> bool {
        self.opaque
    }

    /// The PSNR of a coloured mesh relative to the view, in decibels, at most 100: `-10 log₁₀` of the mean squared difference of red, green
    /// and blue, each over black, in all pixels with coverage or weight. `None` if there are none.
    ///
    /// The mesh is drawn by [`coloured_pixels`]. If weights are 0 or 1, coverages of the mesh are rounded likewise, and pixels of the
    /// mask's outline, whose colours are unknown, are excluded.
    pub fn psnr(&self, mesh: &Mesh) -> Option<f64> {
        let drawn = coloured_pixels(mesh, &self.view.camera);
        self.psnr_of(&drawn)
    }

    /// [`psnr`](Self::psnr) for the result of [`coloured_pixels`].
    ///
    /// # Panics
    ///
    /// If it has another size.
    pub fn psnr_of(&self, drawn: &[Vec<f64>; 4]) -> Option<f64> {
        let [colours @ .., covered] = drawn;
        let part = self.part.pixels();
        assert_eq!(covered.len(), part.len(), "pixels of what is drawn and of the view");
        // Factor of a pixel of the drawing.
        let gain = |pixel: usize| match (self.opaque, covered[pixel]) {
            (false, _) => 1.0,
            (true, share) if share >= 0.5 => 1.0 / share,
            (true, _) => 0.0,
        };
        let mask = self.view.mask.pixels();
        let unknown = |pixel: usize| self.opaque && mask[pixel] >= 0.5 && part[pixel] == 0.0;
        let shown = |pixel: usize| covered[pixel] * gain(pixel) > 0.0 || part[pixel] > 0.0;
        let inside = |&pixel: &usize| shown(pixel) && !unknown(pixel);
        let pixels: Vec<usize> = (0..part.len()).filter(inside).collect();
        let error = |pixel: usize| {
            let known = (0..3).map(|k| f64::from(self.level(k, pixel)));
            let drawn = colours.iter().map(|channel| gain(pixel) * channel[pixel]);
            drawn.zip(known).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 3.0
        };
        let mean = pixels.iter().map(|&k| error(k)).sum::<f64>() / pixels.len() as f64;
        (!pixels.is_empty()).then(|| -10.0 * mean.max(LEAST_ERROR).log10())
    }
}

impl View {
    /// Red, green, blue and opacity of the picture file, undistorted, with as many pixels as the mask. Levels between those of the file,
    /// from a lens or a reduced size, are rounded to 16 bits.
    ///
    /// # Errors
    ///
    /// If the file is missing, no picture, or not of the size of the mask.
    pub fn load_colours(&self) -> anyhow::Result<[Picture; 4]> {
        let of = || {
            let colours = Picture::load_with_opacity(&self.picture)?;
            let (found, mask) = (colours[3].whole_size(), self.mask.whole_size());
            ensure!(found == mask, "the picture has {found} pixels, but its mask {mask}");
            Ok(match self.distortion {
                Some(_) => undistorted(self, colours).map(of_16_bits),
                None if mask != colours[3].size() => colours.map(of_16_bits),
                None => colours,
            })
        };
        of().with_context(|| self.name.clone())
    }
}

/// The picture with each level a multiple of 1 / 65535.
fn of_16_bits(picture: Picture) -> Picture {
    let levels = picture.pixels().iter().map(|&x| (x * Levels::MOST).round() / Levels::MOST);
    Picture::new(levels.collect(), picture.size().width)
}

/// Colours and opacity of a picture as a straight lens would have shown them: a colour counts as much as it is opaque.
fn undistorted(view: &View, [colours @ .., opacity]: [Picture; 4]) -> [Picture; 4] {
    let width = opacity.size().width;
    let with = |colour: &Picture, opacity: &Picture, change: fn(f32, f32) -> f32| {
        let pairs = colour.pixels().iter().zip(opacity.pixels());
        Picture::new(pairs.map(|(&x, &a)| change(x, a)).collect(), width)
    };
    let straight = view.undistorted(opacity.clone());
    let [red, green, blue] = colours.map(|colour| {
        let over_black = view.undistorted(with(&colour, &opacity, |x, a| x * a));
        with(&over_black, &straight, |x, a| if a > 0.0 { x / a } else { 0.0 })
    });
    [red, green, blue, straight]
}

/// White where a mask and all eight neighbours are at least half white, or where the mask itself is if there is no such pixel.
fn within(mask: &Picture) -> Picture {
    let (levels, width) = (mask.pixels(), mask.size().width);
    let height = mask.size().height;
    let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
    let firm = |k: usize| {
        let mut rows = around(k / width, height);
        rows.all(|y| around(k % width, width).all(|x| levels[y * width + x] >= 0.5))
    };
    let inner: Vec<f32> = (0..levels.len()).map(|k| f32::from(u8::from(firm(k)))).collect();
    match inner.contains(&1.0) {
        true => Picture::new(inner, width),
        false => mask.clone().thresholded(0.5),
    }
}

#[cfg(test)]
mod tests {
    use softrast_raster::Pinhole;

    use super::*;

    fn view(mask: Vec<f32>, width: usize) -> View {
        let rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let size = [mask.len() / width, width].into();
        let camera =
            Pinhole { rotation, translation: [0.0; 3], focal: [1.0; 2], centre: [0.0; 2], size };
        let (name, picture) = ("a".into(), "a.png".into());
        View { name, picture, mask: Picture::new(mask, width), camera, distortion: None, off: 0.0 }
    }

    #[test]
    fn transparent_pictures_count_by_their_mask_and_opaque_ones_within_it() {
        let mask = vec![0.0, 0.6, 1.0, 1.0, 1.0, 0.3];
        let gray = || [(); 3].map(|()| Picture::new(vec![0.5; 6], 6));
        let clear = Picture::new(vec![0.0, 0.6, 1.0, 1.0, 0.0, 0.3], 6);
        let seen = PaintedView::new(view(mask.clone(), 6), gray(), &clear);
        assert_eq!(seen.part.pixels(), [0.0, 0.6, 1.0, 1.0, 0.0, 0.3]);
        assert_eq!(seen.over_black()[2].pixels(), [0.0, 0.3, 0.5, 0.5, 0.0, 0.15]);
        let opaque = Picture::new(vec![1.0; 6], 6);
        let seen = PaintedView::new(view(mask, 6), gray(), &opaque);
        assert_eq!(seen.part.pixels(), [0.0, 0.0, 1.0, 1.0, 0.0, 0.0]);
        // A thin mask is all outline.
        let seen = PaintedView::new(view(vec![0.0, 1.0, 0.7, 0.0, 0.0, 0.0], 6), gray(), &opaque);
        assert_eq!(seen.part.pixels(), [0.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn decibels_count_what_either_shows_and_leave_out_an_outline_that_is_not_known() {
        let gray = || [(); 3].map(|()| Picture::new(vec![0.5; 6], 6));
        let drawn = |levels: [f64; 6], covered: [f64; 6]| {
            let [r, g, b] = [levels; 3].map(|channel| channel.to_vec());
            [r, g, b, covered.to_vec()]
        };
        let mask = vec![0.0, 1.0, 1.0, 1.0, 0.0, 0.0];
        let clear = Picture::new(mask.clone(), 6);
        let seen = PaintedView::new(view(mask.clone(), 6), gray(), &clear);
        // One of four pixels has an error of 0.2, another is drawn where nothing should be.
        let image = drawn([0.0, 0.5, 0.5, 0.7, 0.1, 0.0], [0.0, 1.0, 1.0, 1.0, 0.25, 0.0]);
        let expected = -10.0 * ((0.04f64 + 0.01) / 4.0).log10();
        assert!((seen.psnr_of(&image).unwrap() - expected).abs() < 1e-5);
        let opaque = Picture::new(vec![1.0; 6], 6);
        let seen = PaintedView::new(view(mask, 6), gray(), &opaque);
        // Only the middle of the mask has a weight; coverage below half of a pixel is ignored.
        assert_eq!(seen.psnr_of(&image), Some(100.0));
        let image = drawn([0.0, 0.5, 0.5, 0.7, 0.3, 0.0], [0.0, 1.0, 1.0, 1.0, 0.75, 0.0]);
        let expected = -10.0 * (0.16f64 / 2.0).log10();
        assert!((seen.psnr_of(&image).unwrap() - expected).abs() < 1e-5);
        let nothing = drawn([0.0; 6], [0.0; 6]);
        let none = PaintedView::new(view(vec![0.0; 6], 6), gray(), &clear);
        assert_eq!(none.psnr_of(&nothing), None);
    }
}
