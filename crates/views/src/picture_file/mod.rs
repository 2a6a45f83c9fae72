//! Picture files within bounds: nothing is decoded before its size is known, and no file ends the program.

mod chunks;
mod guard;
mod orientation;
mod reduce;

use std::{io::Cursor, path::Path};

use anyhow::{Context, anyhow, ensure};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits, RgbImage};
use softrast_mesh::read_bounded;
use softrast_raster::ImageSize;

use self::{guard::guarded, orientation::Orientation};

/// Bytes of a picture file at most.
const LARGEST_FILE: u64 = 1 << 28;
/// Bytes of decoded pixels at most: 23,170 × 23,170 pixels of grey, 11,585 × 11,585 with colours and transparency.
const MOST_DECODED: u64 = 1 << 29;
/// The same of a JPEG file, whose decoder may keep two bytes more for each of them: 10,922 × 10,922 pixels in colours.
const MOST_DECODED_JPEG: u64 = (1 << 30) / 3;
/// Pixels along a side at most, as in JPEG and GIF files.
const LONGEST_SIDE: u32 = 65_535;

/// The content of a PNG, JPEG or GIF file, decoded.
///
/// A picture has at most 65,535 pixels along a side, and 512 MiB of decoded pixels (341 MiB of a JPEG file): that is known from its head,
/// before anything is decoded. Its file has at most 256 MiB.
#[derive(Clone, Debug)]
pub struct PictureFile {
    image: DynamicImage,
    orientation: Orientation,
    /// Colours of the classes, where pixels of the file are numbers of them.
    palette: Option<Vec<[u8; 3]>>,
}

/// Red, green, blue and opacity of a pixel, from 0 to 1.
pub(crate) type Pixel = [f32; 4];

impl PictureFile {
    /// The picture in a file.
    ///
    /// # Errors
    ///
    /// If the path is no regular file or cannot be read, or for the reasons of [`PictureFile::decode`]: one line that names the file.
    pub fn load(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let path = path.as_ref();
        let bytes = read_bounded(path, LARGEST_FILE)
            .with_context(|| format!("cannot read the picture {}", path.display()))?;
        Self::decode(&bytes).with_context(|| path.display().to_string())
    }

    /// The picture whose file has this content.
    ///
    /// # Errors
    ///
    /// If it is no PNG, JPEG or GIF file, is broken, has no pixels or more than are read.
    pub fn decode(bytes: &[u8]) -> anyhow::Result<Self> {
        let decoded = guarded(|| decoded(bytes)).unwrap_or_else(|| {
            Err(anyhow!("the picture cannot be decoded: save it anew with another program"))
        });
        // Words of a decoder stay on one line.
        decoded.map_err(|error| anyhow!(format!("{error:#}").replace(char::is_control, " ")))
    }

    /// Height and width in pixels, turned as the file asks for: as everyone sees it.
    pub fn size(&self) -> ImageSize {
        self.orientation.size(self.in_file())
    }

    /// Red, green and blue as a texture has them: not turned, and without transparency. Of more than so many texels the means over equal
    /// rectangles remain.
    pub fn texels(&self, most: usize) -> RgbImage {
        let (whole, size) = (self.in_file(), reduce::within(self.in_file(), most));
        if size == whole {
            return self.image.to_rgb8();
        }
        let planes =
            reduce::means(whole, size, |y, row| self.row(y, row), |[r, g, b, _]| [r, g, b]);
        let byte = |level: f32| (255.0 * level).round() as u8;
        RgbImage::from_fn(size.width as u32, size.height as u32, |x, y| {
            let pixel = y as usize * size.width + x as usize;
            image::Rgb([0, 1, 2].map(|k| byte(planes[k][pixel])))
        })
    }

    /// The class of a pixel: its number in the palette, or where there is none its level as a whole number.
    pub(crate) fn class_of(&self, [red, green, blue, _]: Pixel) -> Option<u32> {
        let most = match &self.image {
            DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_) => f32::from(u16::MAX),
            _ => f32::from(u8::MAX),
        };
        let colour = [red, green, blue].map(|x| (x * most).round() as u32);
        match &self.palette {
            Some(palette) => {
                let number = palette.iter().position(|entry| entry.map(u32::from) == colour);
                number.map(|number| number as u32)
            }
            None => (colour[0] == colour[1] && colour[1] == colour[2]).then_some(colour[0]),
        }
    }

    /// Whether all pixels are opaque.
    pub(crate) fn is_opaque(&self) -> bool {
        let mut opaque = true;
        if self.image.color().has_alpha() {
            self.each(|[.., opacity]| opaque &= opacity >= 1.0);
        }
        opaque
    }

    /// Shows all pixels, in the order of the file.
    pub(crate) fn each(&self, mut show: impl FnMut(Pixel)) {
        let mut row = Vec::new();
        for y in 0..self.image.height() as usize {
            self.row(y, &mut row);
            row.iter().copied().for_each(&mut show);
        }
    }

    /// Numbers of pixels as pictures of at most so many pixels: the means over equal rectangles where there are more. Turned, row by row
    /// from the top; and the size.
    pub(crate) fn planes<const N: usize>(
        &self,
        most: usize,
        of: impl Fn(Pixel) -> [f32; N],
    ) -> ([Vec<f32>; N], ImageSize) {
        let size = reduce::within(self.in_file(), most);
        let planes = reduce::means(self.in_file(), size, |y, row| self.row(y, row), of);
        (planes.map(|plane| self.orientation.turned(plane, size)), self.orientation.size(size))
    }

    /// The size before it is turned.
    fn in_file(&self) -> ImageSize {
        [self.image.height() as usize, self.image.width() as usize].into()
    }

    /// Fills `row` with the pixels of a row, as they lie in the file.
    fn row(&self, y: usize, row: &mut Vec<Pixel>) {
        let width = self.image.width() as usize;
        row.clear();
        match &self.image {
            DynamicImage::ImageLuma16(_)
            | DynamicImage::ImageLumaA16(_)
            | DynamicImage::ImageRgb16(_)
            | DynamicImage::ImageRgba16(_) => {
                let channels = usize::from(self.image.color().channel_count());
                let samples: &[u16] = match &self.image {
                    DynamicImage::ImageLuma16(image) => image.as_raw(),
                    DynamicImage::ImageLumaA16(image) => image.as_raw(),
                    DynamicImage::ImageRgb16(image) => image.as_raw(),
                    DynamicImage::ImageRgba16(image) => image.as_raw(),
                    _ => &[],
                };
                let samples = &samples[y * width * channels..(y + 1) * width * channels];
                let level = |sample: u16| f32::from(sample) / f32::from(u16::MAX);
                row.extend(samples.chunks_exact(channels).map(|pixel| rgba(pixel, level)));
            }
            image => {
                // Decoders of PNG, JPEG and GIF make nothing but whole numbers of 8 or 16 bits.
                let channels = usize::from(image.color().channel_count());
                let samples = image.as_bytes();
                let samples = &samples[y * width * channels..(y + 1) * width * channels];
                let level = |sample: u8| f32::from(sample) / f32::from(u8::MAX);
                row.extend(samples.chunks_exact(channels).map(|pixel| rgba(pixel, level)));
            }
        }
    }
}

/// The luminance of a pixel, from 0 to 1; of grey exactly its level.
pub(crate) fn luminance([red, green, blue, _]: Pixel) -> f32 {
    green + 0.2126 * (red - green) + 0.0722 * (blue - green)
}

/// Grey, or colours, with or without opacity.
fn rgba<T: Copy>(pixel: &[T], level: impl Fn(T) -> f32) -> Pixel {
    match *pixel {
        [grey] => [level(grey), level(grey), level(grey), 1.0],
        [grey, opacity] => [level(grey), level(grey), level(grey), level(opacity)],
        [red, green, blue] => [level(red), level(green), level(blue), 1.0],
        [red, green, blue, opacity, ..] => [level(red), level(green), level(blue), level(opacity)],
        [] => [0.0; 4],
    }
}

fn decoded(bytes: &[u8]) -> anyhow::Result<PictureFile> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let format = reader.format();
    let format = format.context("it is no picture that can be read: PNG, JPEG and GIF are")?;
    let palette = match format {
        ImageFormat::Png => chunks::palette(bytes)?,
        _ => None,
    };
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MOST_DECODED);
    reader.limits(limits);
    let broken = || "it is no picture that can be read";
    let mut decoder = reader.into_decoder().with_context(broken)?;
    let ((width, height), bytes_decoded) = (decoder.dimensions(), decoder.total_bytes());
    ensure!(width > 0 && height > 0, "it has no pixels: {width} x {height}");
    let most = if format == ImageFormat::Jpeg { MOST_DECODED_JPEG } else { MOST_DECODED };
    ensure!(
        width.max(height) <= LONGEST_SIDE && bytes_decoded <= most,
        "it has {width} x {height} pixels, which take {} MiB: a picture has at most {LONGEST_SIDE} along a side and {} MiB, so make it smaller",
        bytes_decoded >> 20,
        most >> 20
    );
    let orientation = match format {
        ImageFormat::Png => chunks::find(bytes, *b"eXIf").map(<[u8]>::to_vec),
        // What cannot be read of it says nothing.
        _ => decoder.exif_metadata().unwrap_or_default(),
    };
    let orientation = orientation.map_or_else(Orientation::default, |exif| Orientation::of(&exif));
    let image = DynamicImage::from_decoder(decoder).with_context(broken)?;
    Ok(PictureFile { image, orientation, palette })
}
