//! The gradient of a texture.
//!
//! A texel is visible to pairs all over the image, so its gradient is added up by atomic operations: on whole numbers, whose sums do not depend
//! on their order. They have 64 bits, and a first walk finds how large terms are and how many, so that no sum leaves these.

use cubecl::prelude::*;

use super::{
    blend::UNITS,
    blend_inputs::{BlendInputs, BlendSpec},
    face_attributes::FaceAttributes,
    of_pixel::OfPixel,
    texture::NUMBERS,
    whole::{INFINITE, MOST, add, mark, or_nan, sum},
};

/// Terms are taken as if the largest were not less than this, so that floats can hold their scale.
const LEAST: f32 = 1e-19;
/// Words before the sums: the bits of the largest size of a term, and how many pairs there are.
pub(super) const MEASURED: usize = 2;

/// Adds up the gradient of the texels, a cube for each part of a face: with `measure` only finds the first [`MEASURED`] words of `sums`, else adds
/// all terms to those behind them, two for each number of the texels.
///
/// `pixels` is what [`finish_pixels`](super::blend::finish_pixels) has written.
#[cube(launch)]
pub(super) fn sum_texels(
    drawn: &BlendInputs,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    sums: &mut Array<Atomic<u32>>,
    #[comptime] kind: BlendSpec,
    #[comptime] measure: bool,
) {
    let part = drawn.part(CUBE_POS as u32);
    let (view, face) = (part.job / drawn.face_count, part.job % drawn.face_count);
    let shown = FaceAttributes::of(drawn, view, face, kind);
    let channels = comptime!(kind.channels);
    let mut scale = 0.0f32;
    if !measure {
        scale = scale_of(sums[0].load(), sums[1].load());
    }
    let mut largest = 0u32;
    let mut pairs = 0u32;
    let mut pixel = part.start + UNIT_POS;
    while pixel < part.end {
        let (column, row) = (part.column(pixel), part.row(pixel));
        let pair = shown.pair(column, row, drawn, kind);
        if pair.counts(drawn.weights) {
            let first = drawn.in_image(view, row, column, kind);
            let log = OfPixel::load(pixels, OfPixel::at(drawn, view, row, column, kind)).log;
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
                    add(sums, place_of(sample.above_left, channel), a * scale);
                    add(sums, place_of(sample.above_right, channel), b * scale);
                    add(sums, place_of(sample.below_left, channel), c * scale);
                    add(sums, place_of(sample.below_right, channel), d * scale);
                }
            }
        }
        pixel += UNITS;
    }
    if measure && pairs > 0 {
        sums[0].fetch_max(largest);
        sums[1].fetch_add(pairs);
    }
}

/// The larger of these bits and those of the size of a number: larger sizes have larger bits, and what is no number has the largest.
#[cube]
fn larger(bits: u32, number: f32) -> u32 {
    let other = mark(number);
    select(bits > other, bits, other)
}

/// The first word of the sum of a channel of a texel.
#[cube]
fn place_of(texel: u32, channel: u32) -> usize {
    MEASURED + (2u32 * (NUMBERS * texel + channel)) as usize
}

/// What a term is multiplied by to become a whole number, from the bits of the largest and the number of pairs. A pair has at most four terms
/// in a number.
#[cube]
fn scale_of(largest: u32, pairs: u32) -> f32 {
    let size = f32::reinterpret(largest);
    let size = select(size > LEAST, size, LEAST);
    MOST / (4.0f32 * f32::cast_from(pairs) + 1.0f32) / size
}

/// Turns the sums of [`sum_texels`] into floats, one unit a number.
#[cube(launch)]
pub(super) fn texel_floats(sums: &Array<u32>, gradient: &mut Array<f32>, count: u32) {
    let number = ABSOLUTE_POS as u32;
    if number >= count {
        terminate!();
    }
    let total = sum(sums, MEASURED + (2u32 * number) as usize) / scale_of(sums[0], sums[1]);
    // One term that is no number makes all of them none.
    gradient[number as usize] = or_nan(sums[0] < INFINITE, total);
}
