use image::{Rgb, RgbImage};

/// Height of the strip that holds a label, in pixels.
pub(crate) const HEIGHT: u32 = 22;

/// Side of one dot of a letter, in pixels.
const DOT: u32 = 2;
const LEFT: u32 = 4;
const TOP: u32 = 4;
const INK: Rgb<u8> = Rgb([40; 3]);

/// Writes a word at the top left of the image, cut where the image ends.
pub(crate) fn draw(image: &mut RgbImage, word: &str) {
    for (k, letter) in word.chars().enumerate() {
        for (row, dots) in glyph(letter).into_iter().enumerate() {
            for column in (0..5).filter(|column| dots >> (4 - column) & 1 == 1) {
                let x = LEFT + (k as u32 * 6 + column) * DOT;
                let y = TOP + row as u32 * DOT;
                square(image, x, y);
            }
        }
    }
}

fn square(image: &mut RgbImage, x: u32, y: u32) {
    for (x, y) in (0..DOT * DOT).map(|k| (x + k % DOT, y + k / DOT)) {
        if let Some(pixel) = image.get_pixel_mut_checked(x, y) {
            *pixel = INK;
        }
    }
}

/// Seven rows of five dots, the leftmost in bit 4. Only the letters of the labels in use.
fn glyph(letter: char) -> [u8; 7] {
    match letter {
        'a' => [0x00, 0x00, 0x0e, 0x01, 0x0f, 0x11, 0x0f],
        'c' => [0x00, 0x00, 0x0e, 0x10, 0x10, 0x11, 0x0e],
        'd' => [0x01, 0x01, 0x0d, 0x13, 0x11, 0x11, 0x0f],
        'e' => [0x00, 0x00, 0x0e, 0x11, 0x1f, 0x10, 0x0e],
        'f' => [0x06, 0x09, 0x08, 0x1c, 0x08, 0x08, 0x08],
        'g' => [0x00, 0x0f, 0x11, 0x11, 0x0f, 0x01, 0x0e],
        'i' => [0x04, 0x00, 0x0c, 0x04, 0x04, 0x04, 0x0e],
        'l' => [0x0c, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0e],
        'n' => [0x00, 0x00, 0x16, 0x19, 0x11, 0x11, 0x11],
        'r' => [0x00, 0x00, 0x16, 0x19, 0x10, 0x10, 0x10],
        's' => [0x00, 0x00, 0x0f, 0x10, 0x0e, 0x01, 0x1e],
        't' => [0x08, 0x08, 0x1c, 0x08, 0x08, 0x09, 0x06],
        'u' => [0x00, 0x00, 0x11, 0x11, 0x11, 0x13, 0x0d],
        _ => [0; 7],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_label_in_use_has_its_letters() {
        for letter in "targetstartresultdifference".chars() {
            assert_ne!(glyph(letter), [0; 7], "{letter}");
        }
    }

    #[test]
    fn a_label_is_cut_at_the_edge() {
        let mut image = RgbImage::new(9, 9);
        draw(&mut image, "target");
        assert_eq!(*image.get_pixel(LEFT + 2, TOP), INK);
    }
}
