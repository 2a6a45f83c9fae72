//! Sums of numbers as whole ones of 64 bits, by atomic operations: these give the same in every order.

use cubecl::prelude::*;

/// 2³², and what all terms may add up to as whole numbers: a quarter of what has room.
pub(super) const WORD: f32 = 4_294_967_296.0;
pub(super) const MOST: f32 = 2_305_843_009_213_693_952.0;
/// Bits of a float without its sign, and of the least that is not finite. Floats of one sign are ordered as their bits are, and a shader may
/// assume that no float is NaN, but not that no integer is.
pub(super) const SIZE: u32 = 0x7fff_ffff;
pub(super) const INFINITE: u32 = 0x7f80_0000;

/// Added to the bits of a number that is not negative, so that those of negative ones lie below.
pub(super) const NEGATIVE: u32 = 0x8000_0000;
/// Words of a pixel in colours beside its sums: see [`find_largest`](super::blend::find_largest) and [`add_shares`](super::blend::add_shares).
pub(super) const MARKS: u32 = 3;
/// Sizes below this are nothing.
const NOTHING: f32 = 1e-37;

/// The size of a number in bits, which are ordered as sizes are; what is no number has the largest.
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

/// Adds a term as a part of the largest one, the [`mark`] of which is `size`, where there are as many as faces at most: so sums keep their
/// digits however small all terms are.
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

/// A sum of such terms.
#[cube]
pub(super) fn relative_sum(sums: &Array<u32>, place: usize, size: u32, face_count: u32) -> f32 {
    let part = sum(sums, place) / (MOST / f32::cast_from(face_count));
    // One term that is no number makes all of them none.
    or_nan(size < INFINITE, part * f32::reinterpret(size))
}

/// A number, or none where it does not hold. From bits that are put together at run time: WGSL refuses a constant that is no number.
#[cube]
pub(super) fn or_nan(holds: bool, number: f32) -> f32 {
    f32::reinterpret(select(holds, u32::reinterpret(number), SIZE))
}

/// Adds a number, rounded to a whole one, to the two words at `place`: to the lower one, and with what that carries to the upper one.
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
