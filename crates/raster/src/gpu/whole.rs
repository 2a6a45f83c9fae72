//! Sums of numbers as integers of 64 bits, by atomic operations, whose order does not matter.

use cubecl::prelude::*;

/// 2³², and the largest sum of all terms as integers: a quarter of the range.
pub(super) const WORD: f32 = 4_294_967_296.0;
pub(super) const MOST: f32 = 2_305_843_009_213_693_952.0;
/// Bits of a float without its sign, and those of infinity. Comparisons use bits, since floats of one sign have the order of their bits,
/// and a shader may assume that no float is NaN.
pub(super) const SIZE: u32 = 0x7fff_ffff;
pub(super) const INFINITE: u32 = 0x7f80_0000;

/// Added to the bits of a non-negative number, so that those of negative numbers are lower.
pub(super) const NEGATIVE: u32 = 0x8000_0000;
/// Words per pixel of colours in addition to its sums: see [`find_largest`](super::blend::find_largest) and
/// [`add_shares`](super::blend::add_shares).
pub(super) const MARKS: u32 = 3;
/// Magnitudes below this are 0.
const NOTHING: f32 = 1e-37;

/// The magnitude of a number as bits, in the order of magnitudes; NaN has the largest.
#[cube]
pub(super) fn mark(number: f32) -> u32 {
    u32::reinterpret(number) & SIZE
}

/// Writes zeros to the first words of three arrays.
#[cube(launch)]
pub(super) fn zero(
    first: &mut Array<u32>,
    second: &mut Array<u32>,
    third: &mut Array<u32>,
    first_words: u32,
    second_words: u32,
    third_words: u32,
) {
    let own = ABSOLUTE_POS;
    if own < first_words as usize {
        first[own] = 0u32;
    }
    if own < second_words as usize {
        second[own] = 0u32;
    }
    if own < third_words as usize {
        third[own] = 0u32;
    }
}

/// Adds a term relative to the largest, whose [`mark`] is `size`, for at most as many terms as faces: sums keep their digits however small
/// all terms are.
#[cube]
pub(super) fn add_relative(
    sums: &mut Array<Atomic<u32>>,
    place: usize,
    term: f32,
    size: u32,
    face_count: u32,
) {
    let size = f32::reinterpret(size);
    if size > NOTHING {
        add(sums, place, term / size * (MOST / f32::cast_from(face_count)));
    }
}

/// A sum of terms added by [`add_relative`].
#[cube]
pub(super) fn relative_sum(sums: &Array<u32>, place: usize, size: u32, face_count: u32) -> f32 {
    let part = sum(sums, place) / (MOST / f32::cast_from(face_count));
    // One NaN term makes all of them NaN.
    or_nan(size < INFINITE, part * f32::reinterpret(size))
}

/// `number` if `holds`, else NaN, from bits combined at run time: WGSL rejects a constant that is NaN.
#[cube]
pub(super) fn or_nan(holds: bool, number: f32) -> f32 {
    f32::reinterpret(select(holds, u32::reinterpret(number), SIZE))
}

/// Adds a number, rounded to an integer, to the two words at `place`, with the carry from the lower to the upper word.
#[cube]
pub(super) fn add(sums: &mut Array<Atomic<u32>>, place: usize, number: f32) {
    let size = f32::round(f32::abs(number));
    let upper = f32::floor(size * (1.0f32 / WORD));
    let mut low = u32::cast_from(size - upper * WORD);
    let mut high = u32::cast_from(upper);
    if number < 0.0f32 {
        high = select(low == 0u32, 0u32 - high, u32::MAX - high);
        low = 0u32 - low;
    }
    if low != 0u32 {
        let before = sums[place].fetch_add(low);
        high += select(before > u32::MAX - low, 1u32, 0u32);
    }
    if high != 0u32 {
        sums[place + 1].fetch_add(high);
    }
}

/// The sum in the two words at `place`.
#[cube]
pub(super) fn sum(sums: &Array<u32>, place: usize) -> f32 {
    let mut low = sums[place];
    let mut high = sums[place + 1];
    let negative = high > u32::MAX / 2u32;
    if negative {
        high = select(low == 0u32, 0u32 - high, u32::MAX - high);
        low = 0u32 - low;
    }
    let size = f32::cast_from(high) * WORD + f32::cast_from(low);
    select(negative, -size, size)
}
