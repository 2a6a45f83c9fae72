use std::{io, iter};

use anyhow::Context;
use base64::{Engine, engine::general_purpose::STANDARD};
use gif::{Encoder, Frame, Repeat};
use image::{DynamicImage, GrayImage, Luma, Rgb, RgbImage, imageops};
use serde::{Deserialize, Serialize};

use crate::Pictures;

const SEPARATOR: u32 = 2;
const SEPARATOR_COLOUR: Rgb<u8> = Rgb([170; 3]);
const WHITE: Rgb<u8> = Rgb([255; 3]);

/// A gray image as RGB: `values` `[height * width]`, row by row from the top, 0 black to 1 white.
///
/// Values outside [0, 1] are clamped, NaN becomes black.
///
/// # Panics
///
/// If the number of values is not `width * height`.
pub fn rgb_from_gray(values: &[f64], width: usize, height: usize) -> RgbImage {
    rgb_from_planes(&values.repeat(3), width, height)
}

/// A coloured image as RGB: `values` `[3 * height * width]`, first all of red, then green, then
/// blue, each row by row from the top, 0 dark to 1 bright.
///
/// Values outside [0, 1] are clamped, NaN becomes dark.
///
/// # Panics
///
/// If the number of values is not `3 * width * height`.
pub fn rgb_from_planes(values: &[f64], width: usize, height: usize) -> RgbImage {
    let pixels = width * height;
    assert_eq!(
        values.len(),
        3 * pixels,
        "{width} x {height} pixels need three times as many values"
    );
    RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let pixel = y as usize * width + x as usize;
        Rgb([0, 1, 2].map(|channel| level(values[channel * pixels + pixel])))
    })
}

/// The byte of a value in [0, 1].
fn level(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// The signed difference of two images of the same size.
///
/// White where they agree, red where the target is brighter, blue where the result is brighter;
/// the deeper the colour, the larger the difference of the channel that differs most.
///
/// # Panics
///
/// If the sizes differ.
pub fn difference(target: &RgbImage, result: &RgbImage) -> RgbImage {
    assert_eq!(target.dimensions(), result.dimensions(), "a difference needs images of one size");
    RgbImage::from_fn(target.width(), target.height(), |x, y| {
        let channels = target.get_pixel(x, y).0.into_iter().zip(result.get_pixel(x, y).0);
        let differences = channels.map(|(target, result)| i16::from(target) - i16::from(result));
        let largest = differences.max_by_key(|d| d.abs()).unwrap_or(0);
        let faded = 255 - largest.unsigned_abs() as u8;
        if largest > 0 { Rgb([255, faded, faded]) } else { Rgb([faded, faded, 255]) }
    })
}

/// Images side by side in rows of `columns`, with a thin gray line around each.
///
/// Cells have the size of the largest image; smaller ones sit at the top left of theirs, on white.
///
/// # Panics
///
/// If there is no image or no column.
pub fn contact_sheet(images: &[RgbImage], columns: usize) -> RgbImage {
    assert!(!images.is_empty() && columns > 0, "a contact sheet needs images and columns");
    let columns = columns.min(images.len()) as u32;
    let rows = (images.len() as u32).div_ceil(columns);
    let width = images.iter().map(RgbImage::width).max().unwrap_or(0);
    let height = images.iter().map(RgbImage::height).max().unwrap_or(0);
    let (pitch_x, pitch_y) = (width + SEPARATOR, height + SEPARATOR);
    let size = (columns * pitch_x + SEPARATOR, rows * pitch_y + SEPARATOR);
    let mut sheet = RgbImage::from_fn(size.0, size.1, |x, y| {
        let line = x % pitch_x < SEPARATOR || y % pitch_y < SEPARATOR;
        if line { SEPARATOR_COLOUR } else { WHITE }
    });
    for (k, image) in images.iter().enumerate() {
        let (column, row) = (k as u32 % columns, k as u32 / columns);
        let (x, y) = (column * pitch_x + SEPARATOR, row * pitch_y + SEPARATOR);
        imageops::replace(&mut sheet, image, x.into(), y.into());
    }
    sheet
}

/// The picture files of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Encoded {
    /// PNG: from left to right the target, the start, the result and the difference of target and result.
    #[serde(with = "as_base64")]
    pub before_after: Vec<u8>,
    /// GIF: the target on the left, the run on the right.
    #[serde(with = "as_base64")]
    pub animation: Vec<u8>,
    /// SVG of the result, if the task draws one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drawing: Option<String>,
}

/// Small pictures are enlarged to at least these widths, in pixels: in the row of four, and in the animation.
const WIDTHS: [u32; 2] = [256, 192];
/// Quality of a palette, 1 best to 30 fastest, for pictures that are not enlarged. Up to 256 colours are always exact.
const SPEED: u32 = 10;
/// Durations of the frames, and of the last frame, in hundredths of a second.
const DELAYS: [u16; 2] = [8, 200];

impl Encoded {
    /// Encodes the pictures of a run.
    ///
    /// # Errors
    ///
    /// If an encoder fails, or a side of the animation has more than 65,535 pixels.
    ///
    /// # Panics
    ///
    /// If the pictures have different sizes.
    pub fn new(pictures: &Pictures) -> anyhow::Result<Self> {
        let Pictures { target, start, result, frames, drawing } = pictures;
        let difference = difference(target, result);
        let four = [target.clone(), start.clone(), result.clone(), difference];
        let before_after = row(&four, WIDTHS[0]);
        let animation = gif(target, frames).context("cannot encode an animation")?;
        let before_after = png(&before_after)?;
        Ok(Self { before_after, animation, drawing: drawing.clone() })
    }
}

/// An image as a PNG file.
///
/// # Errors
///
/// If the encoder fails.
pub fn png(image: &RgbImage) -> anyhow::Result<Vec<u8>> {
    let mut png = io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).context("cannot encode a picture")?;
    Ok(png.into_inner())
}

/// Widths and heights of pictures on a page, in pixels: small ones are enlarged to about the first, larger ones reduced to the second.
const ON_PAGE: [u32; 2] = [320, 640];

/// A mask, row by row from 0 to 1, as a gray PNG for a page: large masks are reduced.
///
/// # Errors
///
/// If the encoder fails.
///
/// # Panics
///
/// If the mask has no pixels, or no whole rows.
pub fn mask_png(mask: &[f32], width: usize) -> anyhow::Result<Vec<u8>> {
    assert!(width > 0 && mask.len().is_multiple_of(width), "a mask of whole rows");
    let image = GrayImage::from_fn(width as u32, (mask.len() / width) as u32, |x, y| {
        Luma([level(mask[y as usize * width + x as usize].into())])
    });
    let mut png = io::Cursor::new(Vec::new());
    let image = reduced(DynamicImage::from(image));
    image.write_to(&mut png, image::ImageFormat::Png).context("cannot encode a picture")?;
    Ok(png.into_inner())
}

/// A picture for a page: small ones are enlarged to show their pixels, large ones reduced, by their longer side.
pub fn for_page(image: RgbImage) -> RgbImage {
    match image.width().max(image.height()) < ON_PAGE[1] {
        true => enlarged(&image, ON_PAGE[0]),
        false => reduced(DynamicImage::from(image)).into_rgb8(),
    }
}

fn reduced(image: DynamicImage) -> DynamicImage {
    let most = ON_PAGE[1];
    if image.width().max(image.height()) > most { image.thumbnail(most, most) } else { image }
}

/// An endless GIF: the target on the left, the frames on the right.
fn gif(target: &RgbImage, frames: &[RgbImage]) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let [columns, rows] = stretched(target, 2, WIDTHS[1]);
    let side = |length: usize| {
        u16::try_from(length)
            .with_context(|| format!("{length} pixels a side are too many for a GIF"))
    };
    let (width, height) = (side(columns.len())?, side(rows.len())?);
    // The palette takes as many samples as on the enlarged picture: fewer make it worse.
    let larger = factor(target, WIDTHS[1]).pow(2);
    let (speed, times) = ((SPEED / larger).max(1), (larger / SPEED).max(1));
    let mut encoder = Encoder::new(&mut bytes, width, height, &[])?;
    encoder.set_repeat(Repeat::Infinite)?;
    for (k, frame) in frames.iter().enumerate() {
        // The small picture has every colour of the large one.
        let small = sheet(&[target.clone(), frame.clone()]);
        let (small_width, small_height) = (small.width() as u16, (times * small.height()) as u16);
        let small = small.repeat(times as usize);
        let small = Frame::from_rgb_speed(small_width, small_height, &small, speed as i32);
        let at = |x: u32, y: u32| small.buffer[y as usize * usize::from(small_width) + x as usize];
        let buffer = rows.iter().flat_map(|&y| columns.iter().map(move |&x| at(x, y))).collect();
        let delay = DELAYS[usize::from(k + 1 == frames.len())];
        let palette = small.palette;
        encoder.write_frame(&Frame {
            width,
            height,
            delay,
            palette,
            buffer,
            ..Frame::default()
        })?;
    }
    drop(encoder);
    Ok(bytes)
}

/// Images of one size in one row; small ones are enlarged to show their pixels.
fn row(images: &[RgbImage], width_at_least: u32) -> RgbImage {
    let small = sheet(images);
    let [columns, rows] = stretched(&images[0], images.len(), width_at_least);
    RgbImage::from_fn(columns.len() as u32, rows.len() as u32, |x, y| {
        *small.get_pixel(columns[x as usize], rows[y as usize])
    })
}

/// Images of one size in one row.
fn sheet(images: &[RgbImage]) -> RgbImage {
    let same = images.iter().all(|image| image.dimensions() == images[0].dimensions());
    assert!(same, "pictures of a run have one size");
    contact_sheet(images, images.len())
}

/// Column and row in a [`sheet`] of `images` pictures, for each column and row of the same sheet with enlarged images.
fn stretched(image: &RgbImage, images: usize, width_at_least: u32) -> [Vec<u32>; 2] {
    let factor = factor(image, width_at_least);
    [(image.width(), images as u32), (image.height(), 1)].map(|(side, cells)| {
        let pitch = side + SEPARATOR;
        let times = |at: u32| if at % pitch < SEPARATOR { 1 } else { factor };
        (0..cells * pitch + SEPARATOR)
            .flat_map(|at| iter::repeat_n(at, times(at) as usize))
            .collect()
    })
}

/// Repeats pixels.
fn enlarged(image: &RgbImage, width_at_least: u32) -> RgbImage {
    let factor = factor(image, width_at_least);
    let (width, height) = image.dimensions();
    RgbImage::from_fn(width * factor, height * factor, |x, y| {
        *image.get_pixel(x / factor, y / factor)
    })
}

/// The smallest whole factor that reaches the width and leaves both sides within twice that.
fn factor(image: &RgbImage, width_at_least: u32) -> u32 {
    let longest = image.width().max(image.height()).max(1);
    let room = 2 * width_at_least / longest;
    width_at_least.div_ceil(image.width().max(1)).min(room).max(1)
}

mod as_base64 {
    use serde::{Deserializer, Serializer, de::Error as _};

    use super::{Deserialize, Engine, STANDARD};

    pub(super) fn serialize<S: Serializer>(bytes: &[u8], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(&STANDARD.encode(bytes))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<u8>, D::Error> {
        STANDARD.decode(String::deserialize(from)?).map_err(D::Error::custom)
    }
}

/// A silhouette over a mask of the same shape, row by row, from 0 to 1: grey in both, orange in the
/// mask only, blue in the silhouette only.
///
/// # Panics
///
/// If they have no pixels or differ in number.
pub fn overlay(silhouette: &[f64], mask: &[f32], width: usize) -> RgbImage {
    const BOTH: [f64; 3] = [150.0, 160.0, 170.0];
    const MASK: [f64; 3] = [240.0, 130.0, 20.0];
    const SILHOUETTE: [f64; 3] = [30.0, 110.0, 220.0];
    assert_eq!(silhouette.len(), mask.len(), "a silhouette and a mask of different size");
    RgbImage::from_fn(width as u32, (mask.len() / width) as u32, |x, y| {
        let pixel = y as usize * width + x as usize;
        let [drawn, mask] =
            [silhouette[pixel], f64::from(mask[pixel])].map(|level| level.clamp(0.0, 1.0));
        Rgb([0, 1, 2].map(|k| {
            let with = drawn * BOTH[k] + (1.0 - drawn) * MASK[k];
            let without = drawn * SILHOUETTE[k] + (1.0 - drawn) * 250.0;
            (mask * with + (1.0 - mask) * without).round() as u8
        }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_overlay_tells_apart_what_both_and_what_only_one_of_them_has() {
        let image = overlay(&[1.0, 1.0, 0.0, 0.0], &[1.0, 0.0, 1.0, 0.0], 2);
        let at = |x, y| image.get_pixel(x, y).0;
        assert_eq!([at(0, 0), at(1, 0)], [[150, 160, 170], [30, 110, 220]]);
        assert_eq!([at(0, 1), at(1, 1)], [[240, 130, 20], [250; 3]]);
    }

    #[test]
    fn pictures_on_a_page_are_neither_small_nor_large() {
        let sizes = |bytes: Vec<u8>| {
            let image = image::load_from_memory(&bytes).unwrap();
            (image.width(), image.height(), image.to_luma8().pixels().map(|p| p.0[0]).max())
        };
        assert_eq!(sizes(mask_png(&[0.0, 1.0, 0.5, 0.2], 2).unwrap()), (2, 2, Some(255)));
        assert_eq!(sizes(mask_png(&[1.0; 1280 * 320], 1280).unwrap()), (640, 160, Some(255)));
        assert_eq!(for_page(plain(1280, 320, 7)).dimensions(), (640, 160));
        assert_eq!(for_page(plain(400, 2, 7)), plain(400, 2, 7));
        assert_eq!(for_page(plain(120, 90, 7)).dimensions(), (360, 270));
        assert_eq!(for_page(plain(2, 90, 7)).dimensions(), (14, 630));
        assert_eq!(for_page(plain(1, 20_000, 7)).dimensions(), (1, 640));
        assert_eq!(for_page(plain(9, 40_000, 7)).dimensions(), (1, 640));
        assert_eq!(for_page(plain(40_000, 9, 7)).dimensions(), (640, 1));
    }

    fn plain(width: u32, height: u32, level: u8) -> RgbImage {
        RgbImage::from_pixel(width, height, Rgb([level; 3]))
    }

    #[test]
    fn gray_values_are_rounded_and_clamped() {
        let image = rgb_from_gray(&[0.0, 0.5, 1.0, 7.0, -1.0, f64::NAN], 3, 2);
        let levels: Vec<u8> = image.pixels().map(|p| p.0[0]).collect();
        assert_eq!(levels, [0, 128, 255, 255, 0, 0]);
    }

    #[test]
    fn planes_become_the_channels_of_each_pixel() {
        let image = rgb_from_planes(&[1.0, 0.0, 0.5, 2.0, f64::NAN, 0.2], 2, 1);
        let pixels: Vec<_> = image.pixels().map(|p| p.0).collect();
        assert_eq!(pixels, [[255, 128, 0], [0, 255, 51]]);
    }

    #[test]
    fn difference_is_white_red_or_blue() {
        let pixel = |target, result| {
            difference(&plain(1, 1, target), &plain(1, 1, result)).get_pixel(0, 0).0
        };
        assert_eq!(pixel(90, 90), [255; 3]);
        assert_eq!(pixel(255, 0), [255, 0, 0]);
        assert_eq!(pixel(0, 100), [155, 155, 255]);
    }

    #[test]
    fn contact_sheet_has_lines_around_every_cell() {
        let sheet = contact_sheet(&[plain(4, 3, 1), plain(4, 3, 2), plain(2, 2, 3)], 2);
        assert_eq!(sheet.dimensions(), (2 * 4 + 3 * SEPARATOR, 2 * 3 + 3 * SEPARATOR));
        let at = |x, y| sheet.get_pixel(x, y).0;
        let second = (2 * SEPARATOR + 4, 2 * SEPARATOR + 3);
        assert_eq!(at(SEPARATOR, SEPARATOR), [1; 3]);
        assert_eq!(at(second.0, SEPARATOR), [2; 3]);
        assert_eq!(at(SEPARATOR, second.1), [3; 3]);
        assert_eq!(at(second.0, second.1), WHITE.0, "a cell without image");
        assert_eq!(at(SEPARATOR + 2, second.1), WHITE.0, "beside a smaller image");
        for line in [0, second.0 - 1, sheet.width() - 1] {
            assert_eq!(at(line, SEPARATOR), SEPARATOR_COLOUR.0);
        }
    }

    #[test]
    fn an_animation_shows_target_and_frame_enlarged() {
        let few = RgbImage::from_fn(5, 4, |x, y| Rgb([(50 * x) as u8, (60 * y) as u8, 9]));
        // More colours than a palette can hold.
        let many = RgbImage::from_fn(24, 16, |x, y| Rgb([(10 * x) as u8, (15 * y) as u8, 99]));
        for target in [few, many] {
            let frame = difference(&target, &plain(target.width(), target.height(), 200));
            let bytes = gif(&target, &[target.clone(), frame.clone()]).unwrap();
            let decoder = image::codecs::gif::GifDecoder::new(io::Cursor::new(bytes)).unwrap();
            let found = image::AnimationDecoder::into_frames(decoder).collect_frames().unwrap();
            let delays: Vec<_> = found.iter().map(|it| it.delay().numer_denom_ms()).collect();
            assert_eq!(delays, [(80, 1), (2000, 1)]);
            for (found, shown) in found.iter().zip([&target, &frame]) {
                let expected = row(&[target.clone(), shown.clone()], WIDTHS[1]);
                assert_eq!(found.buffer().dimensions(), expected.dimensions());
                // Mean difference of the colours to those of the row, over pixels and channels.
                let off = |colours: &mut dyn Iterator<Item = [u8; 3]>| {
                    let pairs = colours.zip(expected.pixels());
                    let apart = pairs.map(|(a, b)| {
                        (0..3).map(|k| f64::from(a[k].abs_diff(b.0[k]))).sum::<f64>()
                    });
                    apart.sum::<f64>() / (3 * expected.width() * expected.height()) as f64
                };
                let ours = off(&mut found.buffer().pixels().map(|it| [it.0[0], it.0[1], it.0[2]]));
                let (width, height) = (expected.width() as u16, expected.height() as u16);
                let whole = Frame::from_rgb_speed(width, height, &expected, SPEED as i32);
                let palette = whole.palette.as_ref().unwrap();
                let colour = |&k: &u8| [0, 1, 2].map(|c| palette[3 * usize::from(k) + c]);
                let theirs = off(&mut whole.buffer.iter().map(colour));
                assert!(
                    ours <= 1.25 * theirs,
                    "{ours} where the palette of the large picture has {theirs}"
                );
            }
        }
    }

    #[test]
    fn a_row_enlarges_by_whole_factors() {
        let row = row(&[plain(3, 3, 0), plain(3, 3, 0)], 10);
        assert_eq!(row.dimensions(), (2 * 12 + 3 * SEPARATOR, 12 + 2 * SEPARATOR));
    }
}
