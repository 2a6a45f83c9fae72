use softrast_views::Picture;

/// The mask of a picture of `[height, width, 4]` bytes, red, green, blue and opacity: its
/// transparency, or its luminance if it is opaque.
///
/// # Panics
///
/// If there are no pixels, or no whole rows of this width.
pub fn mask(rgba: &[u8], width: usize) -> Picture {
    let opaque = rgba.chunks_exact(4).all(|pixel| pixel[3] == u8::MAX);
    let level =
        |pixel: &[u8]| if opaque { luminance_of(pixel) } else { f32::from(pixel[3]) / 255.0 };
    Picture::new(rgba.chunks_exact(4).map(level).collect(), width)
}

/// The luminance of such a picture; transparent pixels are black.
///
/// # Panics
///
/// If there are no pixels, or no whole rows of this width.
pub fn luminance(rgba: &[u8], width: usize) -> Picture {
    let level = |pixel: &[u8]| luminance_of(pixel) * f32::from(pixel[3]) / 255.0;
    Picture::new(rgba.chunks_exact(4).map(level).collect(), width)
}

/// Source: ITU-R BT.709, on the encoded values, as in the image library of the other programs.
fn luminance_of(pixel: &[u8]) -> f32 {
    let [red, green, blue] = [0, 1, 2].map(|k| f32::from(pixel[k]));
    (0.2126 * red + 0.7152 * green + 0.0722 * blue) / 255.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_is_the_transparency_unless_all_is_opaque() {
        let [black, white, clear] = [[0, 0, 0, 255], [255, 255, 255, 255], [255, 255, 255, 0]];
        let near = |picture: Picture, expected: [f32; 2]| {
            picture.pixels().iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6)
        };
        assert!(near(mask(&[black, white].concat(), 2), [0.0, 1.0]));
        assert!(near(mask(&[black, clear].concat(), 2), [1.0, 0.0]));
        assert!(near(luminance(&[white, clear].concat(), 2), [1.0, 0.0]));
    }
}
