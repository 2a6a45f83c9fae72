//! The gradient of a texture.
//!
//! A texel is visible to pairs all over the image, so its gradient is added up by atomic operations: on whole numbers, whose sums do not depend
//! on their order. They have 64 bits, and a first walk finds how large terms are and how many, so that no sum leaves these.

use cubecl::prelude::*;

use super::{
    blend_inputs::{BlendInputs, BlendSpec},
    face_attributes::FaceAttributes,
    of_pixel::OfPixel,
    texture::NUMBERS,
    tile::TILE,
};

/// What all terms may add up to as whole numbers, a quarter of what has room, and 2³².
const MOST: f32 = 2_305_843_009_213_693_952.0;
const WORD: f32 = 4_294_967_296.0;
/// Terms are taken as if the largest were not less than this, so that floats can hold their scale.
const LEAST: f32 = 1e-19;
/// Bits of a float without its sign, and of the least that is not finite.
const SIZE: u32 = 0x7fff_ffff;
const INFINITE: u32 = 0x7f80_0000;
/// Words before the sums: the bits of the largest size of a term, and how many pairs there are.
pub(super) const MEASURED: usize = 2;

/// Adds up the gradient of the texels, one unit a pixel: with `measure` only finds the first [`MEASURED`] words of `sums`, else adds all terms to
/// those behind them, two for each number of the texels.
///
/// `pixels` is what [`blend_pixels`](super::blend::blend_pixels) has written.
#[cube(launch)]
pub(super) fn sum_texels(
    drawn: &BlendInputs,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    sums: &mut Array<Atomic<u32>>,
    #[comptime] kind: BlendSpec,
    #[comptime] measure: bool,
) {
    let column = CUBE_POS_X * TILE + UNIT_POS_X;
    let row = CUBE_POS_Y * TILE + UNIT_POS_Y;
    let view = CUBE_POS_Z;
    let (frame, of_cells) = (drawn.frame, drawn.of_cells);
    if column >= frame.width || row >= frame.height {
        terminate!();
    }
    let channels = comptime!(kind.channels);
    let px = frame.column_centre(column);
    let py = frame.row_centre(row);
    let first = drawn.in_image(view, row, column, kind);
    let own = OfPixel::at(drawn, view, row, column, kind);
    let log = OfPixel::load(pixels, own).log;
    let mut scale = 0.0f32;
    if !measure {
        scale = scale_of(sums[0].load(), sums[1].load());
    }
    let mut largest = 0u32;
    let mut pairs = 0u32;
    let first_word = of_cells.first_word(view, column, row);
    for word in 0..of_cells.words {
        let mut bits = drawn.cells[(first_word + word) as usize];
        while bits != 0 {
            let face = 32 * word + bits.trailing_zeros();
            bits &= bits - 1u32;
            if drawn.reaches(view, face, column, row) {
                let shown = FaceAttributes::of(drawn, view, face, kind);
                let pair = shown.pair(px, py, drawn, kind);
                if pair.counts(drawn.weights) {
                    let share = pair.share(log, drawn.weights).whole;
                    let sample = shown.sample(pair, drawn, kind);
                    let shares = sample.shares().times(share);
                    pairs += 1u32;
                    for channel in 0..channels {
                        let u = upstream[first + channel * drawn.plane()];
                        let a = shares.a.scale(u).stored(kind.second);
                        let b = shares.b.scale(u).stored(kind.second);
                        let c = shares.c.scale(u).stored(kind.second);
                        let d = shares.d.scale(u).stored(kind.second);
                        if measure {
                            largest = larger(largest, a);
                            largest = larger(largest, b);
                            largest = larger(largest, c);
                            largest = larger(largest, d);
                        } else {
                            let channel = channel as u32;
                            add(sums, NUMBERS * sample.above_left + channel, a * scale);
                            add(sums, NUMBERS * sample.above_right + channel, b * scale);
                            add(sums, NUMBERS * sample.below_left + channel, c * scale);
                            add(sums, NUMBERS * sample.below_right + channel, d * scale);
                        }
                    }
                }
            }
        }
    }
    if measure {
        sums[0].fetch_max(largest);
        sums[1].fetch_add(pairs);
    }
}

/// The larger of these bits and those of the size of a number: larger sizes have larger bits, and what is no number has the largest.
#[cube]
fn larger(bits: u32, number: f32) -> u32 {
    let other = u32::reinterpret(number) & SIZE;
    select(bits > other, bits, other)
}

/// What a term is multiplied by to become a whole number, from the bits of the largest and the number of pairs. A pair has at most four terms
/// in a number.
#[cube]
fn scale_of(largest: u32, pairs: u32) -> f32 {
    let size = f32::reinterpret(largest);
    let size = select(size > LEAST, size, LEAST);
    MOST / (4.0f32 * f32::cast_from(pairs) + 1.0f32) / size
}

/// Adds a number to number `at`, cut to a whole one: to its lower word, and with what that carries to its upper one.
#[cube]
fn add(sums: &mut Array<Atomic<u32>>, at: u32, number: f32) {
    let size = f32::abs(number);
    let upper = f32::floor(size * (1.0f32 / WORD));
    let mut low = u32::cast_from(size - upper * WORD);
    let mut high = u32::cast_from(upper);
    if number < 0.0f32 {
        high = select(low == 0u32, 0u32 - high, u32::MAX - high);
        low = 0u32 - low;
    }
    let place = MEASURED + (2u32 * at) as usize;
    if low != 0u32 {
        let before = sums[place].fetch_add(low);
        high += select(before > u32::MAX - low, 1u32, 0u32);
    }
    if high != 0u32 {
        sums[place + 1].fetch_add(high);
    }
}

/// Turns the sums of [`sum_texels`] into floats, one unit a number.
#[cube(launch)]
pub(super) fn texel_floats(sums: &Array<u32>, gradient: &mut Array<f32>, count: u32) {
    let number = ABSOLUTE_POS as u32;
    if number >= count {
        terminate!();
    }
    let at = MEASURED + (2u32 * number) as usize;
    let mut low = sums[at];
    let mut high = sums[at + 1];
    let negative = high > u32::MAX / 2u32;
    if negative {
        high = select(low == 0u32, 0u32 - high, u32::MAX - high);
        low = 0u32 - low;
    }
    let size = f32::cast_from(high) * WORD + f32::cast_from(low);
    let sum = size / scale_of(sums[0], sums[1]);
    let sum = select(negative, -sum, sum);
    // One term that is no number makes all of them none.
    gradient[number as usize] = select(sums[0] < INFINITE, sum, f32::reinterpret(SIZE));
}
