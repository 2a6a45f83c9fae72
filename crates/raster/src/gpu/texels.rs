//! The gradient of a texture.
//!
//! Pairs all over the image may sample a texel, so its gradient is summed by atomic operations on integers, independent of their order.
//! They have 64 bits, and a first walk computes the largest term and the number of pairs, so that no sum overflows.

use cubecl::prelude::*;

use super::{
    blend::UNITS,
    blend_inputs::{BlendInputs, BlendSpec},
    face_attributes::FaceAttributes,
    of_pixel::OfPixel,
    texture::NUMBERS,
    whole::{INFINITE, MOST, add, mark, or_nan, sum},
};

/// Lower bound of the largest term, so that floats can represent the scale.
const LEAST: f32 = 1e-19;
/// Words before the sums: the bits of the largest magnitude of a term, and the number of pairs.
pub(super) const MEASURED: usize = 2;

/// Sums the gradient of the texels, one cube per part of a face: with `measure` only computes the first [`MEASURED`] words of `sums`, else
/// adds all terms to the words after them, two for each number of the texels.
///
/// `pixels` is written by [`finish_pixels`](super::blend::finish_pixels).
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

/// The larger of `bits` and the [`mark`] of a number, whose order is that of magnitudes; NaN has the largest.
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

/// The factor from terms to integers, given the bits of the largest term and the number of pairs. A pair has at most four terms per number.
#[cube]
fn scale_of(largest: u32, pairs: u32) -> f32 {
    let size = f32::reinterpret(largest);
    let size = select(size > LEAST, size, LEAST);
    MOST / (4.0f32 * f32::cast_from(pairs) + 1.0f32) / size
}

/// Converts the sums of [`sum_texels`] to floats, one unit per number.
#[cube(launch)]
pub(super) fn texel_floats(sums: &Array<u32>, gradient: &mut Array<f32>, count: u32) {
    let number = ABSOLUTE_POS as u32;
    if number >= count {
        terminate!();
    }
    let total = sum(sums, MEASURED + (2u32 * number) as usize) / scale_of(sums[0], sums[1]);
    // One NaN term makes all of them NaN.
    gradient[number as usize] = or_nan(sums[0] < INFINITE, total);
}
