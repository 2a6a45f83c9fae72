//! Pictures and masks from files.

use std::{collections::BTreeSet, path::Path};

use anyhow::{Context, anyhow, ensure};

use super::Picture;
use crate::{
    MaskRules, PictureFile,
    mask_rules::{LevelRange, Looks},
    picture_file::{Pixel, luminance},
};

/// Most labels in an error.
const MOST_CLASSES: usize = 12;
/// Most pixels of a picture, 2048 × 2048: larger files are reduced to means over equal rectangles.
const MOST_PIXELS: usize = 1 << 22;

impl Picture {
    /// The mask in a picture file: its alpha, or if it is opaque its luminance; see [`Picture::mask_of`].
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or not a picture, or the errors of [`Picture::mask_of`].
    pub fn load_mask(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        Self::load_mask_by(&MaskRules::default(), path)
    }

    /// The mask in a picture file, with rules.
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or not a picture, or the errors of [`Picture::mask_of`].
    pub fn load_mask_by(rules: &MaskRules, path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let (path, file) = (path.as_ref(), PictureFile::load(path.as_ref())?);
        Self::mask_of(&file, rules).with_context(|| path.display().to_string())
    }

    /// The mask of a picture: its alpha, or if it is opaque its luminance.
    ///
    /// If there is a single level above 0, as in masks of 0 and 1, it becomes white, and [`Picture::only_level`] returns it. A threshold
    /// applies to unchanged levels, and a label selects the pixels of one class.
    ///
    /// # Errors
    ///
    /// If no pixel would be half white: with the brightest level, and a threshold that includes it. If there is neither alpha nor a
    /// threshold nor a label, and the picture looks like a photograph.
    pub fn mask_of(file: &PictureFile, rules: &MaskRules) -> anyhow::Result<Self> {
        if let Some(label) = rules.label {
            return Self::of_class(file, label, rules.invert);
        }
        let opaque = file.is_opaque();
        let level = |pixel: Pixel| if opaque { luminance(pixel) } else { pixel[3] };
        let (mut levels, mut looks) = (LevelRange::default(), Looks::default());
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
        let (mut found, mut classes) = (false, BTreeSet::new());
        file.each(|pixel| {
            let class = file.class_of(pixel);
            found |= class == Some(label);
            if classes.len() < MOST_CLASSES {
                classes.extend(class);
            }
        });
        let classes: Vec<String> = classes.iter().map(u32::to_string).collect();
        ensure!(
            found,
            "no pixel has the label {label}: labels of the picture are {}",
            if classes.is_empty() { "none, it has colours".to_owned() } else { classes.join(", ") }
        );
        let level = |pixel| f32::from(u8::from((file.class_of(pixel) == Some(label)) != invert));
        Ok(Self::of(file, level))
    }

    /// The luminance of a picture file; transparent pixels are black.
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or not a picture.
    pub fn load_luminance(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        Ok(Self::of(&PictureFile::load(path)?, |pixel| luminance(pixel) * pixel[3]))
    }

    /// Red, green and blue of a picture file, as stored; transparent pixels are black.
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or not a picture.
    pub fn load_colours(path: impl AsRef<Path>) -> anyhow::Result<[Self; 3]> {
        Ok(Self::channels(&PictureFile::load(path)?, |[r, g, b, a]| [r * a, g * a, b * a]))
    }

    /// Red, green and blue of a picture file, as stored regardless of alpha, and its opacity. In a reduced picture colours are weighted by
    /// opacity.
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or not a picture.
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

    fn of(file: &PictureFile, level: impl Fn(Pixel) -> f32) -> Self {
        let [picture] = Self::channels(file, |pixel| [level(pixel)]);
        picture
    }

    fn channels<const N: usize>(file: &PictureFile, of: impl Fn(Pixel) -> [f32; N]) -> [Self; N] {
        let (planes, size) = file.planes(MOST_PIXELS, of);
        planes.map(|levels| Self { whole: file.size(), ..Self::new(levels, size.width) })
    }
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, GrayImage, Luma, LumaA, Rgba};

    use super::*;

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
            // Headers are at both ends; the palette of a GIF is between them.
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
        // A width of 0, and a folder.
        std::fs::write(path("b.gif"), b"GIF89a\0\0\0\0\0\0\0;").unwrap();
        seen("b.gif");
        std::fs::create_dir(path("c.png")).unwrap();
        seen("c.png");
    }

    #[test]
    fn transparent_is_black() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        image::GrayAlphaImage::from_pixel(1, 1, LumaA([255, 0])).save(&path).unwrap();
        assert_eq!(Picture::load_luminance(&path).unwrap().pixels(), [0.0]);
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
            assert_eq!(channel.pixels(), expected);
        }
        let gray = GrayImage::from_pixel(1, 1, Luma([102]));
        gray.save(&path).unwrap();
        assert_eq!(Picture::load_colours(&path).unwrap().map(|c| c.pixels()[0]), [0.4; 3]);
    }
}
