use std::{collections::BTreeSet, path::Path, sync::Arc};

use anyhow::{Context, anyhow, ensure};
use softrast_raster::{ImageSize, Pinhole};
use softrast_tensor::{Backend, Tensor, tensor_on};

use crate::{
    Distortion, MaskRules, PictureFile,
    mask_rules::{Levels, Looks},
    picture_file::{Pixel, luminance},
};

/// What is looked at of a mask is this much larger than what is white.
const MARGIN: f64 = 1.5;
/// Labels that an error names at most.
const MOST_CLASSES: usize = 12;
/// Pixels of a picture at most, 2048 × 2048: of larger ones in files the means over equal rectangles are kept.
const MOST_PIXELS: usize = 1 << 22;

/// A gray picture of any size: a target for silhouettes. Copies share their pixels.
///
/// A picture of more than 4,194,304 pixels in a file, as 2048 × 2048, is reduced to that many or a few less when it is read. [`Picture::size`] is the
/// size of its pixels then, [`Picture::whole_size`] that of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// From 0 to 1, row by row from the top.
    levels: Arc<[f32]>,
    width: usize,
    /// Size of the picture in the file, before it was reduced.
    whole: ImageSize,
    /// The level of the file that was taken for white, where it had just one above 0.
    only_level: Option<f32>,
}

impl Picture {
    /// The mask in a picture file: its transparency, or where all of it is opaque its luminance; see [`Picture::mask_of`].
    ///
    /// # Errors
    ///
    /// If the path is no regular file or no picture, or those of [`Picture::mask_of`].
    pub fn load_mask(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        Self::load_mask_by(&MaskRules::default(), path)
    }

    /// The mask in a picture file by rules.
    ///
    /// # Errors
    ///
    /// If the path is no regular file or no picture, or those of [`Picture::mask_of`].
    pub fn load_mask_by(rules: &MaskRules, path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let (path, file) = (path.as_ref(), PictureFile::load(path.as_ref())?);
        Self::mask_of(&file, rules).with_context(|| path.display().to_string())
    }

    /// The mask that a picture is: its transparency, or where all of it is opaque its luminance.
    ///
    /// Where one level is above 0 and nothing else, as in masks of 0 and 1, that is the mask: it becomes white, and
    /// [`Picture::only_level`] has it. A threshold takes levels as they are, and a label the pixels of one class.
    ///
    /// # Errors
    ///
    /// If no pixel would be half white: with the brightest level, and the threshold that takes it. If there is neither transparency nor a
    /// threshold nor a label, and the picture looks like a photograph.
    pub fn mask_of(file: &PictureFile, rules: &MaskRules) -> anyhow::Result<Self> {
        if let Some(label) = rules.label {
            return Self::of_class(file, label, rules.invert);
        }
        let opaque = file.is_opaque();
        let level = |pixel: Pixel| if opaque { luminance(pixel) } else { pixel[3] };
        let (mut levels, mut looks) = (Levels::default(), Looks::default());
        file.each(|pixel| {
            levels.see(level(pixel));
            looks.see(pixel);
        });
        let (change, only_level) = rules.change(&levels).map_err(|wrong| match opaque {
            false if levels.brightest() == 0.0 => {
                anyhow!("{wrong}: all of it is transparent, so save it without an alpha channel if its colours are the mask")
            }
            _ => wrong,
        })?;
        if opaque && rules.threshold.is_none() && only_level.is_none() {
            looks.check()?;
        }
        Ok(Self { only_level, ..Self::of(file, |pixel| change(level(pixel))) })
    }

    /// The pixels of a class, or all others.
    fn of_class(file: &PictureFile, label: u32, invert: bool) -> anyhow::Result<Self> {
        let mut classes = BTreeSet::new();
        file.each(|pixel| {
            if classes.len() < MOST_CLASSES {
                classes.extend(file.class_of(pixel));
            }
        });
        let mut found = false;
        file.each(|pixel| found |= file.class_of(pixel) == Some(label));
        let classes: Vec<String> = classes.iter().map(u32::to_string).collect();
        ensure!(
            found,
            "no pixel has the label {label}: labels of the picture are {}",
            if classes.is_empty() { "none, it has colours".to_owned() } else { classes.join(", ") }
        );
        let level = |pixel| f32::from(u8::from((file.class_of(pixel) == Some(label)) != invert));
        Ok(Self::of(file, level))
    }

    /// The luminance of a picture file; what is transparent is black.
    ///
    /// # Errors
    ///
    /// If the path is no regular file or no picture.
    pub fn load_luminance(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        Ok(Self::of(&PictureFile::load(path)?, |pixel| luminance(pixel) * pixel[3]))
    }

    /// Red, green and blue of a picture file, as its numbers are; what is transparent is black.
    ///
    /// # Errors
    ///
    /// If the path is no regular file or no picture.
    pub fn load_colours(path: impl AsRef<Path>) -> anyhow::Result<[Self; 3]> {
        Ok(Self::channels(&PictureFile::load(path)?, |[r, g, b, a]| [r * a, g * a, b * a]))
    }

    /// Red, green and blue of a picture file, as its numbers are whatever the transparency, and how opaque it is. In a picture that is reduced
    /// colours count as much as they are opaque.
    ///
    /// # Errors
    ///
    /// If the path is no regular file or no picture.
    pub fn load_with_opacity(path: impl AsRef<Path>) -> anyhow::Result<[Self; 4]> {
        let file = PictureFile::load(path)?;
        if file.size().pixels() <= MOST_PIXELS {
            return Ok(Self::channels(&file, |pixel| pixel));
        }
        let [mut colours @ .., opacity] =
            Self::channels(&file, |[r, g, b, a]| [r * a, g * a, b * a, a]);
        for colour in &mut colours {
            let of = |(&x, &a): (&f32, &f32)| if a > 0.0 { x / a } else { 0.0 };
            colour.levels = colour.levels.iter().zip(opacity.pixels()).map(of).collect();
        }
        let [red, green, blue] = colours;
        Ok([red, green, blue, opacity])
    }

    /// A picture of these levels from 0 to 1, row by row from the top.
    ///
    /// # Panics
    ///
    /// If there are no levels, or no whole rows of this width.
    pub fn new(levels: Vec<f32>, width: usize) -> Self {
        let count = levels.len();
        assert!(
            count > 0 && width > 0 && count.is_multiple_of(width),
            "{count} levels, {width} a row"
        );
        let whole = [count / width, width].into();
        Self { levels: levels.into(), width, whole, only_level: None }
    }

    /// Height and width in pixels.
    pub fn size(&self) -> ImageSize {
        [self.levels.len() / self.width, self.width].into()
    }

    /// Height and width of the picture in its file, turned as the file asks for: those that a camera of the picture has.
    pub fn whole_size(&self) -> ImageSize {
        self.whole
    }

    /// The level from 0 to 1 that stood for white in the file of a mask, where it was the only one above 0 and less than 1.
    pub fn only_level(&self) -> Option<f64> {
        self.only_level.map(f64::from)
    }

    /// A camera of the picture in the file as one of these pixels.
    pub fn camera(&self, of_whole: &Pinhole) -> Pinhole {
        resized(of_whole, self.whole, self.size())
    }

    /// A camera of these pixels as one of the picture in the file.
    pub fn whole_camera(&self, camera: &Pinhole) -> Pinhole {
        resized(camera, self.size(), self.whole)
    }

    /// All pixels, row by row from the top.
    pub fn pixels(&self) -> &[f32] {
        &self.levels
    }

    /// As a straight lens would have shown it: `camera` is that of these pixels but for its lens. What lies beyond the picture is as its border.
    ///
    /// # Panics
    ///
    /// If the camera is for pictures of another size.
    #[must_use]
    pub fn undistorted(&self, camera: &Pinhole, distortion: &Distortion) -> Self {
        assert_eq!(camera.size, self.size(), "the size of the camera's pictures");
        let levels = distortion.sources(camera).map(|place| self.between(place));
        Self { levels: levels.collect(), ..self.clone() }
    }

    /// The level at a place in pixels from the corner of the first: between the middles of four pixels bilinear, beyond the outermost theirs.
    fn between(&self, place: [f64; 2]) -> f32 {
        let (width, height) = (self.width, self.levels.len() / self.width);
        let along = |x: f64, count: usize| {
            let x = (x - 0.5).max(0.0).min((count - 1) as f64);
            let first = (x as usize).min(count - 1);
            (first, (first + 1).min(count - 1), (x - first as f64) as f32)
        };
        let ((left, right, across), (top, bottom, down)) =
            (along(place[0], width), along(place[1], height));
        let row = |y: usize| {
            let [a, b] = [left, right].map(|x| self.levels[y * width + x]);
            a + across * (b - a)
        };
        let (above, below) = (row(top), row(bottom));
        above + down * (below - above)
    }

    /// With black for white.
    #[must_use]
    pub fn inverted(self) -> Self {
        Self { levels: self.levels.iter().map(|level| 1.0 - level).collect(), ..self }
    }

    /// White from this level on, black below.
    #[must_use]
    pub fn thresholded(self, level: f64) -> Self {
        let levels =
            self.levels.iter().map(|&x| f32::from(u8::from(f64::from(x) >= level))).collect();
        Self { levels, ..self }
    }

    /// Without specks: a pixel that is white or black among mostly others becomes as they are.
    #[must_use]
    pub fn despeckled(&self) -> Self {
        let (width, height) = (self.width, self.levels.len() / self.width);
        let majority = |k: usize| {
            let (x, y) = (k % width, k / width);
            let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
            let all = around(y, height).flat_map(|y| around(x, width).map(move |x| y * width + x));
            let (sum, count) =
                all.fold((0.0, 0.0), |(sum, count), k| (sum + self.levels[k], count + 1.0));
            let most = sum >= 0.5 * count;
            if (self.levels[k] >= 0.5) == most { self.levels[k] } else { f32::from(u8::from(most)) }
        };
        Self { levels: (0..self.levels.len()).map(majority).collect(), ..self.clone() }
    }

    /// The least square around all that is at least half white, in the middle of it: its left, its top and its extent in pixels. None if
    /// there is nothing.
    ///
    /// A pixel counts if most of the nine around it are white too, unless none is like that: specks do not.
    pub fn square(&self) -> Option<[f64; 3]> {
        let height = self.levels.len() / self.width;
        let white = |x: usize, y: usize| {
            x < self.width && y < height && self.levels[y * self.width + x] >= 0.5
        };
        let firmly = |[x, y]: &[usize; 2]| {
            let around = (0..9).map(|k| ((x + k % 3).wrapping_sub(1), (y + k / 3).wrapping_sub(1)));
            around.filter(|&(x, y)| white(x, y)).count() >= 5
        };
        let all = || {
            let pixels = (0..self.levels.len()).map(|k| [k % self.width, k / self.width]);
            pixels.filter(|&[x, y]| white(x, y))
        };
        let [low, high] = bounds(all().filter(firmly)).or_else(|| bounds(all()))?;
        let extent = [0, 1].map(|k| (high[k] - low[k] + 1) as f64);
        let longest = extent[0].max(extent[1]);
        let corner = [0, 1].map(|k| low[k] as f64 + (extent[k] - longest) / 2.0);
        Some([corner[0], corner[1], longest])
    }

    /// The square of a mask that is looked at, one and a half times as large as [`Picture::square`]: its left, its top and its extent in
    /// pixels.
    ///
    /// # Errors
    ///
    /// If nothing or all of the mask is white.
    pub fn view_square(&self) -> anyhow::Result<[f64; 3]> {
        let [left, top, extent] =
            self.square().context("the mask is empty: no pixel is half white or more")?;
        ensure!(
            self.levels.iter().any(|&level| level < 0.5),
            "the mask is full: all pixels are white, and there is no outline to fit"
        );
        let margin = (MARGIN - 1.0) / 2.0 * extent;
        Ok([left - margin, top - margin, MARGIN * extent])
    }

    /// A square of it, given by its left, its top and its extent in pixels, on `side` × `side` pixels: the mean of the picture over the
    /// area of each, black outside, and how much of each the picture covers.
    pub fn part(&self, [left, top, extent]: [f64; 3], side: usize) -> [Vec<f64>; 2] {
        let (height, cell) = (self.levels.len() / self.width, extent / side as f64);
        let columns = shares(self.width, left, cell, side);
        let rows = shares(height, top, cell, side);
        let mean = |level: &dyn Fn(usize) -> f64| means(&columns, &rows, self.width, level);
        [mean(&|at| f64::from(self.levels[at])), mean(&|_| 1.0)]
    }

    fn of(file: &PictureFile, level: impl Fn(Pixel) -> f32) -> Self {
        let [picture] = Self::channels(file, |pixel| [level(pixel)]);
        picture
    }

    fn channels<const N: usize>(file: &PictureFile, of: impl Fn(Pixel) -> [f32; N]) -> [Self; N] {
        let (planes, size) = file.planes(MOST_PIXELS, of);
        planes.map(|levels| Self { whole: file.size(), ..Self::new(levels, size.width) })
    }

    /// The image `[size * size]`, top row first, 0 black to 1 white.
    ///
    /// The longer side of a picture takes up the whole image; the rest is black. Each pixel is the mean of the picture over its area.
    pub fn levels(&self, size: usize) -> Vec<f64> {
        let (width, height) = (self.width as f64, (self.levels.len() / self.width) as f64);
        let longest = width.max(height);
        let (left, top) = ((width - longest) / 2.0, (height - longest) / 2.0);
        let [levels, _] = self.part([left, top, longest], size);
        levels
    }

    /// The same as a tensor, `[1, size, size]`.
    pub fn tensor<B: Backend>(&self, size: usize, device: &B::Device) -> Tensor<B, 3> {
        tensor_on(self.levels(size), [1, size, size], device)
    }
}

/// The camera of a picture that is enlarged or reduced.
fn resized(camera: &Pinhole, from: ImageSize, to: ImageSize) -> Pinhole {
    camera.cropped([0.0; 2], [from.width as f64, from.height as f64], to)
}

/// Least and largest of places, along each axis.
fn bounds(mut places: impl Iterator<Item = [usize; 2]>) -> Option<[[usize; 2]; 2]> {
    let first = places.next()?;
    Some(places.fold([first; 2], |[low, high], at| {
        [[0, 1].map(|k| low[k].min(at[k])), [0, 1].map(|k| high[k].max(at[k]))]
    }))
}

/// Means over cells, row by row, of what a picture of this width has at each place.
fn means(
    columns: &[Shares],
    rows: &[Shares],
    width: usize,
    level: impl Fn(usize) -> f64,
) -> Vec<f64> {
    let cells = rows.iter().flat_map(|row| columns.iter().map(move |column| (row, column)));
    let mean = |(row, column): (&Shares, &Shares)| {
        let along = |&(y, share): &(usize, f64)| {
            share * column.iter().map(|&(x, part)| part * level(y * width + x)).sum::<f64>()
        };
        row.iter().map(along).sum()
    };
    cells.map(mean).collect()
}

/// Which picture elements a cell holds, and what share of it they fill.
type Shares = Vec<(usize, f64)>;

/// The shares of cells of this length, of which the first begins at `from`, in `count` picture elements of length 1 from 0 on.
fn shares(count: usize, from: f64, cell: f64, cells: usize) -> Vec<Shares> {
    let of_cell = |k: usize| {
        let (from, to) = (from + k as f64 * cell, from + (k + 1) as f64 * cell);
        let (first, last) = (from.max(0.0) as usize, (to.max(0.0).ceil() as usize).min(count));
        let share = |x: usize| ((x + 1) as f64).min(to) - (x as f64).max(from);
        (first..last).map(|x| (x, share(x) / cell)).filter(|&(_, share)| share > 0.0).collect()
    };
    (0..cells).map(of_cell).collect()
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, GrayImage, Luma, LumaA, Rgba};

    use super::*;

    fn luminance_of(picture: impl Into<image::DynamicImage>, size: usize) -> Vec<f64> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        picture.into().save(&path).unwrap();
        Picture::load_luminance(&path).unwrap().levels(size)
    }

    fn assert_close(found: &[f64], expected: &[f64]) {
        let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7);
        assert!(close && found.len() == expected.len(), "{found:?}");
    }

    #[test]
    fn smaller_is_the_mean_and_larger_repeats() {
        let picture = GrayImage::from_fn(2, 2, |x, y| Luma([if x + y == 1 { 255 } else { 0 }]));
        assert_close(&luminance_of(picture.clone(), 1), &[0.5]);
        assert_close(&luminance_of(picture.clone(), 2), &[0.0, 1.0, 1.0, 0.0]);
        let middle = 0.5;
        let expected = [0.0, middle, 1.0, middle, middle, middle, 1.0, middle, 0.0];
        assert_close(&luminance_of(picture, 3), &expected);
    }

    #[test]
    fn a_wide_picture_has_black_above_and_below() {
        let picture = GrayImage::from_pixel(4, 2, Luma([255]));
        let expected: Vec<f64> =
            (0..16).map(|k| f64::from(u8::from((4..12).contains(&k)))).collect();
        assert_close(&luminance_of(picture, 4), &expected);
    }

    #[test]
    fn a_part_is_black_where_it_leaves_the_picture_and_says_how_much_of_it_does() {
        let picture = Picture::new(vec![0.0, 0.0, 0.0, 1.0, 1.0, 0.0], 3);
        assert_eq!(picture.square(), Some([0.0, 0.5, 2.0]));
        let [levels, covered] = picture.part([0.0, 0.5, 2.0], 2);
        assert_close(&levels, &[0.5, 0.5, 0.5, 0.5]);
        assert_close(&covered, &[1.0, 1.0, 0.5, 0.5]);
        let speckled = |k: usize| {
            let (x, y) = (k % 9, k / 9);
            f32::from(u8::from(x * y == 36 || (x > 1 && x < 5 && y < 5)))
        };
        let speckled = Picture::new((0..81).map(speckled).collect(), 9);
        assert_eq!(speckled.square(), Some([1.0, 0.0, 5.0]));
        assert_eq!(picture.clone().thresholded(2.0).square(), None);
        assert!(
            picture
                .clone()
                .thresholded(2.0)
                .view_square()
                .unwrap_err()
                .to_string()
                .contains("empty")
        );
        assert!(
            picture
                .clone()
                .thresholded(0.0)
                .view_square()
                .unwrap_err()
                .to_string()
                .contains("full")
        );
        assert_eq!(picture.view_square().unwrap(), [-0.5, 0.0, 3.0]);
        assert_eq!(picture.inverted().square(), Some([0.0, -0.5, 3.0]));
    }

    #[test]
    fn a_mask_is_the_transparency_of_a_picture_that_has_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mask.png");
        let mask = |pixels: [[u8; 2]; 2]| {
            let picture = image::GrayAlphaImage::from_fn(2, 1, |x, _| LumaA(pixels[x as usize]));
            picture.save(&path).unwrap();
            Picture::load_mask(&path).unwrap().pixels().to_vec()
        };
        assert_eq!(mask([[0, 255], [255, 0]]), [1.0, 0.0]);
        assert_eq!(mask([[0, 255], [255, 255]]), [0.0, 1.0]);
    }

    #[test]
    fn a_file_with_a_wrong_bit_or_no_end_is_a_picture_or_one_line_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let picture = GrayImage::from_fn(5, 4, |x, y| Luma([(50 * x + y) as u8]));
        let seen = |name: &str| match Picture::load_luminance(path(name)) {
            Ok(picture) => {
                let levels = picture.levels(3);
                assert!(
                    levels.iter().all(|level| (0.0..=1.0 + 1e-6).contains(level)),
                    "{levels:?}"
                );
            }
            Err(error) => {
                let line = format!("{error:#}");
                assert!(line.contains(name) && line.lines().count() == 1, "{line}");
            }
        };
        for name in ["a.png", "a.gif"] {
            DynamicImage::from(picture.clone()).to_rgba8().save(path(name)).unwrap();
            let whole = std::fs::read(path(name)).unwrap();
            // Heads stand at both ends; the palette of a GIF lies between them.
            let ends = |&bit: &usize| bit / 8 < 40 || whole.len() - bit / 8 <= 40;
            for bit in (0..8 * whole.len()).filter(ends) {
                let mut bytes = whole.clone();
                bytes[bit / 8] ^= 1 << (bit % 8);
                std::fs::write(path(name), bytes).unwrap();
                seen(name);
            }
            for end in (0..whole.len()).step_by(7) {
                std::fs::write(path(name), &whole[..end]).unwrap();
                seen(name);
            }
        }
        // No width at all, and a folder.
        std::fs::write(path("b.gif"), b"GIF89a\0\0\0\0\0\0\0;").unwrap();
        seen("b.gif");
        std::fs::create_dir(path("c.png")).unwrap();
        seen("c.png");
    }

    #[test]
    fn transparent_is_black() {
        let picture = image::GrayAlphaImage::from_pixel(1, 1, LumaA([255, 0]));
        assert_close(&luminance_of(picture, 1), &[0.0]);
    }

    #[test]
    fn colours_are_three_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let colours = [[255, 51, 0, 255], [255, 255, 102, 0]];
        image::RgbaImage::from_fn(2, 1, |x, _| Rgba(colours[x as usize])).save(&path).unwrap();
        let channels = Picture::load_colours(&path).unwrap();
        let expected = [[1.0, 0.0], [0.2, 0.0], [0.0, 0.0]];
        for (channel, expected) in channels.iter().zip(expected) {
            assert_close(&channel.part([0.0, -0.5, 2.0], 2)[0][..2], &expected.map(|x| 0.5 * x));
        }
        let gray = GrayImage::from_pixel(1, 1, Luma([102]));
        gray.save(&path).unwrap();
        assert_eq!(Picture::load_colours(&path).unwrap().map(|c| c.pixels()[0]), [0.4; 3]);
    }
}
