//! Picture files within bounds: the size is checked before anything is decoded, and no file ends the program.

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

/// Largest picture file, in bytes.
const LARGEST_FILE: u64 = 1 << 28;
/// Most bytes of decoded pixels: 23,170 × 23,170 pixels of grey, 11,585 × 11,585 with colours and alpha.
const MOST_DECODED: u64 = 1 << 29;
/// Most bytes of decoded pixels of a JPEG file, whose decoder may use two more bytes for each of them: 10,922 × 10,922 pixels in colours.
const MOST_DECODED_JPEG: u64 = (1 << 30) / 3;
/// Most pixels along a side, as in JPEG and GIF files.
const LONGEST_SIDE: u32 = 65_535;

/// The content of a PNG, JPEG or GIF file, decoded.
///
/// A picture has at most 65,535 pixels along a side, and 512 MiB of decoded pixels (341 MiB for a JPEG file), which is checked in its
/// header before anything is decoded. Its file has at most 256 MiB.
///
/// ```
/// use softrast_views::PictureFile;
///
/// let grey = image::GrayImage::from_raw(2, 1, vec![0, 255]).unwrap();
/// let mut png = std::io::Cursor::new(Vec::new());
/// grey.write_to(&mut png, image::ImageFormat::Png)?;
/// let file = PictureFile::decode(png.get_ref())?;
/// assert_eq!(file.size(), [1, 2].into());
/// assert_eq!(file.texels(2).into_raw(), [0, 0, 0, 255, 255, 255]);
/// assert_eq!(file.texels(1).dimensions(), (1, 1));
/// # anyhow::Ok(())
/// ```
#[derive(Clone, Debug)]
pub struct PictureFile {
    image: DynamicImage,
    orientation: Orientation,
    /// Colours of the classes, if pixels of the file are indices of them.
    palette: Option<Vec<[u8; 3]>>,
}

/// Red, green, blue and opacity of a pixel, from 0 to 1.
pub(crate) type Pixel = [f32; 4];

impl PictureFile {
    /// The picture in a file.
    ///
    /// # Errors
    ///
    /// If the path is not a regular file or cannot be read, or for the reasons of [`PictureFile::decode`]: one line with the file.
    pub fn load(path: impl AsRef<Path>) -> anyhow::Result<Self> {
        let path = path.as_ref();
        let bytes = read_bounded(path, LARGEST_FILE)
            .with_context(|| format!("cannot read the picture {}", path.display()))?;
        Self::decode(&bytes).with_context(|| path.display().to_string())
    }

    /// Decodes the content of a picture file.
    ///
    /// # Errors
    ///
    /// If it is not a PNG, JPEG or GIF file, is invalid, has no pixels or too many.
    pub fn decode(bytes: &[u8]) -> anyhow::Result<Self> {
        let decoded = guarded(|| decoded(bytes)).unwrap_or_else(|| {
            Err(anyhow!("the picture cannot be decoded: save it anew with another program"))
        });
        // Messages of a decoder stay on one line.
        decoded.map_err(|error| anyhow!(format!("{error:#}").replace(char::is_control, " ")))
    }

    /// Height and width in pixels, after the rotation that the file declares.
    pub fn size(&self) -> ImageSize {
        self.orientation.size(self.in_file())
    }

    /// Red, green and blue for a texture: not rotated, and without alpha. More than `most` texels are reduced to means over equal
    /// rectangles.
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

    /// The class of a pixel: its index in the palette, or without a palette its level as an integer.
    pub(crate) fn class_of(&self, [red, green, blue, _]: Pixel) -> Option<u32> {
        let most = if self.has_16_bits() { f32::from(u16::MAX) } else { f32::from(u8::MAX) };
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

    /// Calls `show` for all pixels, in the order of the file.
    pub(crate) fn each(&self, mut show: impl FnMut(Pixel)) {
        let mut row = Vec::new();
        for y in 0..self.image.height() as usize {
            self.row(y, &mut row);
            row.iter().copied().for_each(&mut show);
        }
    }

    /// Channels of the pixels as pictures of at most `most` pixels: means over equal rectangles if there are more. Rotated, row by row from
    /// the top; and the size.
    pub(crate) fn planes<const N: usize>(
        &self,
        most: usize,
        of: impl Fn(Pixel) -> [f32; N],
    ) -> ([Vec<f32>; N], ImageSize) {
        let size = reduce::within(self.in_file(), most);
        let planes = reduce::means(self.in_file(), size, |y, row| self.row(y, row), of);
        (planes.map(|plane| self.orientation.turned(plane, size)), self.orientation.size(size))
    }

    /// The size before rotation.
    fn in_file(&self) -> ImageSize {
        [self.image.height() as usize, self.image.width() as usize].into()
    }

    /// Whether samples have 16 bits, and not 8: decoders of PNG, JPEG and GIF produce no others.
    fn has_16_bits(&self) -> bool {
        let colour = self.image.color();
        colour.bytes_per_pixel() == 2 * colour.channel_count()
    }

    /// Fills `row` with the pixels of a row of the file.
    fn row(&self, y: usize, row: &mut Vec<Pixel>) {
        let channels = usize::from(self.image.color().channel_count());
        let samples = self.image.width() as usize * channels;
        let bytes = self.image.as_bytes();
        row.clear();
        if self.has_16_bits() {
            let line = &bytes.as_chunks().0[y * samples..(y + 1) * samples];
            let level = |sample| f32::from(u16::from_ne_bytes(sample)) / f32::from(u16::MAX);
            row.extend(line.chunks_exact(channels).map(|pixel| rgba(pixel, level)));
        } else {
            let line = &bytes[y * samples..(y + 1) * samples];
            let level = |sample| f32::from(sample) / f32::from(u8::MAX);
            row.extend(line.chunks_exact(channels).map(|pixel| rgba(pixel, level)));
        }
    }
}

/// The luminance of a pixel, from 0 to 1; for grey exactly its level.
pub(crate) fn luminance([red, green, blue, _]: Pixel) -> f32 {
    green + 0.2126 * (red - green) + 0.0722 * (blue - green)
}

/// Grey, or colours, with or without alpha.
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
        // Unreadable data are ignored.
        _ => decoder.exif_metadata().unwrap_or_default(),
    };
    let orientation = orientation.map_or_else(Orientation::default, |exif| Orientation::of(&exif));
    let image = DynamicImage::from_decoder(decoder).with_context(broken)?;
    Ok(PictureFile { image, orientation, palette })
}
