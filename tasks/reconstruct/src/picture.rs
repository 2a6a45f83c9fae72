use std::path::Path;

use anyhow::{Context, ensure};
use image::{ImageReader, imageops};

use crate::SIZE;

/// A picture file as the network takes it: planes of red, green, blue and alpha, `[4 * 64 * 64]`.
///
/// Others than 64×64 pixels are scaled. Colours are multiplied by alpha, because pictures that are
/// learned from are black where nothing is.
///
/// # Errors
///
/// If the file is no picture, not square, or empty: alpha 0 everywhere.
pub(crate) fn read_picture(path: &Path) -> anyhow::Result<Vec<u8>> {
    let name = path.display();
    let reader = ImageReader::open(path).with_context(|| format!("cannot read {name}"))?;
    let reader = reader.with_guessed_format().with_context(|| format!("cannot read {name}"))?;
    let image = reader.decode().with_context(|| format!("{name} is no PNG picture"))?;
    let (width, height) = (image.width(), image.height());
    ensure!(width == height, "{name} is {width} x {height} pixels, expected a square");
    if !image.color().has_alpha() {
        eprintln!(
            "warning: {name} has no alpha, so all of it counts as the object; the network expects \
             alpha 0 around it"
        );
    }
    let mut image = image.to_rgba8();
    if width as usize != SIZE {
        let side = SIZE as u32;
        image = imageops::resize(&image, side, side, imageops::FilterType::Triangle);
    }
    ensure!(image.pixels().any(|p| p.0[3] > 0), "{name} shows nothing: its alpha is 0 everywhere");
    let level = |p: &image::Rgba<u8>, k: usize| match k {
        3 => p.0[3],
        k => (u16::from(p.0[k]) * u16::from(p.0[3]) / 255) as u8,
    };
    Ok((0..4).flat_map(|k| image.pixels().map(move |p| level(p, k))).collect())
}
