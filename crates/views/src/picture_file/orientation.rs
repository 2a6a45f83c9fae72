//! Rotation of a picture for display.

use softrast_raster::ImageSize;

/// The orientation in Exif, from 1 to 8: whether rows and columns are exchanged, and the direction of both afterwards.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Orientation {
    /// Rows of the file are columns of the picture.
    swapped: bool,
    /// Columns of the file count from the right.
    from_right: bool,
    /// Rows of the file count from the bottom.
    from_bottom: bool,
}

/// The tag of the orientation, and the allowed types of its number: 8, 16 or 32 bits.
const TAG: u16 = 0x112;
const TYPES: [u16; 3] = [1, 3, 4];
/// Bytes of an entry of a directory.
const ENTRY: usize = 12;

impl Orientation {
    /// The orientation in Exif data; the default if there is no readable one.
    pub(super) fn of(exif: &[u8]) -> Self {
        number(exif).and_then(Self::from_exif).unwrap_or_default()
    }

    fn from_exif(number: u32) -> Option<Self> {
        let [swapped, from_right, from_bottom] = match number {
            1 => [false, false, false],
            2 => [false, true, false],
            3 => [false, true, true],
            4 => [false, false, true],
            5 => [true, false, false],
            6 => [true, false, true],
            7 => [true, true, true],
            8 => [true, true, false],
            _ => return None,
        };
        Some(Self { swapped, from_right, from_bottom })
    }

    /// The displayed size of a picture with this size in the file.
    pub(super) fn size(self, ImageSize { width, height }: ImageSize) -> ImageSize {
        if self.swapped { [width, height].into() } else { [height, width].into() }
    }

    /// Rotates a channel, row by row, of a picture with this size in the file.
    pub(super) fn turned(self, channel: Vec<f32>, in_file: ImageSize) -> Vec<f32> {
        if self == Self::default() {
            return channel;
        }
        let ImageSize { width, height } = self.size(in_file);
        let pixels = (0..width * height).map(|k| {
            let (x, y) = (k % width, k / width);
            let (x, y) = if self.swapped { (y, x) } else { (x, y) };
            let x = if self.from_right { in_file.width - 1 - x } else { x };
            let y = if self.from_bottom { in_file.height - 1 - y } else { y };
            channel[y * in_file.width + x]
        });
        pixels.collect()
    }
}

/// The number of the orientation in the first directory of Exif data.
fn number(exif: &[u8]) -> Option<u32> {
    // Some programs write the marker of JPEG files before it.
    let exif = exif.strip_prefix(b"Exif\0\0").unwrap_or(exif);
    let big = match exif.get(..4)? {
        [b'I', b'I', 42, 0] => false,
        [b'M', b'M', 0, 42] => true,
        _ => return None,
    };
    let short = |at: usize| {
        let bytes = exif.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    };
    let long = |at: usize| {
        let bytes = exif.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    };
    let directory = long(4)? as usize;
    let count = usize::from(short(directory)?);
    let entries = (0..count).map(|k| directory + 2 + k * ENTRY);
    let mut found = entries.take_while(|&at| at < exif.len()).filter(|&at| short(at) == Some(TAG));
    let at = found.next()?;
    let kind = short(at + 2).filter(|kind| TYPES.contains(kind))?;
    match kind {
        1 => exif.get(at + 8).map(|&byte| byte.into()),
        3 => short(at + 8).map(u32::from),
        _ => long(at + 8),
    }
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, GrayImage, Luma};

    use super::*;

    /// Exif data in either byte order, whose orientation has type `kind`.
    fn exif(number: u8, big: bool, kind: u16) -> Vec<u8> {
        let short = |x: u16| if big { x.to_be_bytes() } else { x.to_le_bytes() };
        let long = |x: u32| if big { x.to_be_bytes() } else { x.to_le_bytes() };
        let value = match kind {
            3 => [short(number.into()), [0; 2]].concat(),
            4 => long(number.into()).to_vec(),
            _ => vec![number, 0, 0, 0],
        };
        let head = if big { *b"MM\0*" } else { *b"II*\0" };
        // Another entry comes first.
        let other = [&short(0x100)[..], &short(3), &long(1), &short(7), &[0; 2]].concat();
        let entry = [&short(TAG)[..], &short(kind), &long(1), &value].concat();
        [&head[..], &long(8), &short(2), &other, &entry, &long(0)].concat()
    }

    #[test]
    fn all_eight_orientations_turn_a_picture_as_other_programs_do() {
        let in_file = GrayImage::from_fn(3, 2, |x, y| Luma([(10 * y + x) as u8]));
        let channel: Vec<f32> = in_file.pixels().map(|p| f32::from(p.0[0])).collect();
        for number in 1..=8 {
            let mut expected = DynamicImage::from(in_file.clone());
            expected.apply_orientation(image::metadata::Orientation::from_exif(number).unwrap());
            for (big, kind) in [(false, 3), (true, 3), (false, 4), (true, 4), (true, 1)] {
                let orientation = Orientation::of(&exif(number, big, kind));
                let turned = orientation.turned(channel.clone(), [2, 3].into());
                let size = orientation.size([2, 3].into());
                assert_eq!(
                    [size.width as u32, size.height as u32],
                    [expected.width(), expected.height()]
                );
                let expected: Vec<f32> =
                    expected.to_luma8().pixels().map(|p| f32::from(p.0[0])).collect();
                assert_eq!(turned, expected, "orientation {number}");
            }
        }
        let prefixed = [b"Exif\0\0", &exif(6, true, 3)[..]].concat();
        assert_eq!(Orientation::of(&prefixed), Orientation::of(&exif(6, false, 3)));
    }

    #[test]
    fn data_that_say_nothing_turn_nothing() {
        let whole = exif(6, true, 3);
        for end in 0..20 {
            assert_eq!(Orientation::of(&whole[..end]), Orientation::default());
        }
        for number in [0, 9, 255] {
            assert_eq!(Orientation::of(&exif(number, false, 3)), Orientation::default());
        }
        let far = [&b"II*\0"[..], &[255; 4], &whole].concat();
        assert_eq!(Orientation::of(&far), Orientation::default());
    }
}
