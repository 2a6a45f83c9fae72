use image::{Rgb, RgbImage, imageops};

use crate::label;

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
    assert_eq!(values.len(), width * height, "an image of {width} x {height} needs as many values");
    RgbImage::from_fn(width as u32, height as u32, |x, y| {
        let value = values[y as usize * width + x as usize];
        Rgb([level(value); 3])
    })
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

/// Where two images of the same size differ, and in which direction.
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

/// Images in one row, each below its name; small ones enlarged so that their pixels show.
pub(crate) fn labelled_row(images: &[(&str, &RgbImage)], width_at_least: u32) -> RgbImage {
    let cells: Vec<_> = images
        .iter()
        .map(|(name, image)| {
            let image = enlarged(image, width_at_least);
            let mut cell =
                RgbImage::from_pixel(image.width(), image.height() + label::HEIGHT, WHITE);
            label::draw(&mut cell, name);
            imageops::replace(&mut cell, &image, 0, label::HEIGHT.into());
            cell
        })
        .collect();
    contact_sheet(&cells, cells.len())
}

/// Repeats pixels, by the smallest whole factor that reaches the width.
fn enlarged(image: &RgbImage, width_at_least: u32) -> RgbImage {
    let factor = width_at_least.div_ceil(image.width().max(1)).max(1);
    let size = (image.width() * factor, image.height() * factor);
    imageops::resize(image, size.0, size.1, imageops::FilterType::Nearest)
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_row_enlarges_by_whole_factors() {
        let row = labelled_row(&[("start", &plain(3, 3, 0)), ("result", &plain(3, 3, 0))], 10);
        let height = 12 + label::HEIGHT + 2 * SEPARATOR;
        assert_eq!(row.dimensions(), (2 * 12 + 3 * SEPARATOR, height));
    }
}
