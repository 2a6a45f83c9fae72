use std::path::Path;

use anyhow::Context;
use softrast_cli::Variant;

use crate::Logo;

/// A picture to cover, at any size.
pub(crate) struct Target {
    name: String,
    source: Source,
}

enum Source {
    Logo(Logo),
    /// Luminance from 0 to 1, row by row, and the width.
    Picture(Vec<f64>, usize),
}

impl Target {
    /// The project's own logo of a variant.
    pub(crate) fn logo(variant: Variant) -> Self {
        let name = match variant {
            Variant::Original => "letters",
            Variant::Transfer => "skyline",
        };
        Self { name: name.to_owned(), source: Source::Logo(Logo::of(variant)) }
    }

    /// The luminance of a picture file; what is transparent is black.
    ///
    /// # Errors
    ///
    /// If the file is missing or no picture.
    pub(crate) fn load(path: &Path) -> anyhow::Result<Self> {
        let picture = image::ImageReader::open(path)
            .with_context(|| format!("cannot open the target {}", path.display()))?
            .with_guessed_format()?
            .decode()
            .with_context(|| format!("{} is no picture that can be read", path.display()))?;
        let picture = picture.into_luma_alpha16();
        let full = f64::from(u16::MAX);
        let level = |p: &image::LumaA<u16>| f64::from(p.0[0]) / full * (f64::from(p.0[1]) / full);
        let levels = picture.pixels().map(level).collect();
        let source = Source::Picture(levels, picture.width() as usize);
        Ok(Self { name: path.display().to_string(), source })
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// The image `[size * size]`, top row first, 0 black to 1 white.
    ///
    /// The longer side of a picture takes up the whole image; the rest is black. Each pixel is the mean of the picture over its area.
    pub(crate) fn image(&self, size: usize) -> Vec<f64> {
        match &self.source {
            Source::Logo(logo) => logo.image(size),
            Source::Picture(levels, width) => resized(levels, *width, size),
        }
    }
}

fn resized(levels: &[f64], width: usize, size: usize) -> Vec<f64> {
    let height = levels.len() / width;
    let longest = width.max(height) as f64;
    let (columns, rows) = (shares(width, longest, size), shares(height, longest, size));
    let pixel = |pixel: usize| {
        let (column, row) = (&columns[pixel % size], &rows[pixel / size]);
        let along = |&(y, share): &(usize, f64)| {
            share * column.iter().map(|&(x, part)| part * levels[y * width + x]).sum::<f64>()
        };
        row.iter().map(along).sum()
    };
    (0..size * size).map(pixel).collect()
}

/// For each of `size` cells which of `count` picture elements it holds, and what share of the cell
/// they fill. The elements sit in the middle of `longest`, which the cells share evenly.
fn shares(count: usize, longest: f64, size: usize) -> Vec<Vec<(usize, f64)>> {
    let cell = longest / size as f64;
    let margin = (longest - count as f64) / 2.0;
    let of_cell = |k: usize| {
        let (from, to) = (k as f64 * cell - margin, (k + 1) as f64 * cell - margin);
        let (first, last) = (from.max(0.0) as usize, (to.max(0.0).ceil() as usize).min(count));
        let share = |x: usize| ((x + 1) as f64).min(to) - (x as f64).max(from);
        (first..last).map(|x| (x, share(x) / cell)).filter(|&(_, share)| share > 0.0).collect()
    };
    (0..size).map(of_cell).collect()
}

#[cfg(test)]
mod tests {
    use image::{GrayImage, Luma, LumaA};

    use super::*;

    fn luminance_of(picture: impl Into<image::DynamicImage>, size: usize) -> Vec<f64> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        picture.into().save(&path).unwrap();
        Target::load(&path).unwrap().image(size)
    }

    fn assert_close(found: &[f64], expected: &[f64]) {
        let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
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
    fn transparent_is_black() {
        let picture = image::GrayAlphaImage::from_pixel(1, 1, LumaA([255, 0]));
        assert_close(&luminance_of(picture, 1), &[0.0]);
    }
}
