use std::{path::PathBuf, str::FromStr};

use anyhow::Context;
use image::{ImageReader, imageops};

/// What the silhouettes should look like.
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

impl Target {
    /// Values `[size, size]` in [0, 1], top row first.
    pub(crate) fn pixels(&self, size: usize) -> anyhow::Result<Vec<f64>> {
        match self {
            &Self::Disk { x, y, radius } => Ok(disk(x, y, radius, size)),
            Self::Picture(path) => picture(path, size),
        }
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

fn picture(path: &PathBuf, size: usize) -> anyhow::Result<Vec<f64>> {
    let read = || -> anyhow::Result<_> {
        Ok(ImageReader::open(path)?.with_guessed_format()?.decode()?.into_luma8())
    };
    let mut image = read().with_context(|| format!("cannot read the target {}", path.display()))?;
    let (width, height) = image.dimensions();
    if (width, height) != (size as u32, size as u32) {
        eprintln!("the target is {width} x {height} pixels: resized to {size} x {size}");
        image = imageops::resize(&image, size as u32, size as u32, imageops::FilterType::Triangle);
    }
    Ok(image.pixels().map(|pixel| f64::from(pixel.0[0]) / 255.0).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_has_its_area_and_its_place() {
        let pixels = Target::Disk { x: 0.5, y: 0.5, radius: 0.25 }.pixels(200).unwrap();
        let area = pixels.iter().sum::<f64>() * 4.0 / 200.0 / 200.0;
        assert!((area - std::f64::consts::PI / 16.0).abs() < 2e-3, "{area}");
        assert_eq!([pixels[50 * 200 + 150], pixels[150 * 200 + 150]], [1.0, 0.0], "y points up");
    }

    #[test]
    fn a_broken_disk_is_refused() {
        for text in ["disk:", "disk:1,2", "disk:0,0,0", "disk:0,0,-1", "disk:a,0,1", "disk:0,0,nan"]
        {
            assert!(text.parse::<Target>().is_err(), "{text}");
        }
    }
}
