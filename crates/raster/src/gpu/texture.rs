//! A texture, sampled between its texels at the points of faces, as `kernel/blend/texture.rs` has it; and its gradient.
//!
//! A texel is seen by pairs all over the image, so its gradient is added up by atomic operations: on whole numbers, whose sums do not depend
//! on their order. They have 64 bits, and a first walk finds how large terms are and how many, so that no sum leaves these.

use cubecl::prelude::*;

use super::{
    TILE,
    blend::OfPixel,
    drawn::{Drawn, Kind, Weights},
    dual::Dual,
};
use crate::kernel::blend::OF_TEXEL;

/// Numbers of a texel.
const NUMBERS: u32 = OF_TEXEL as u32;
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

/// A place on a texture, between four texels.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Sample {
    above_left: u32,
    above_right: u32,
    below_left: u32,
    below_right: u32,
    /// From the left texels to the right ones, and from the upper to the lower ones, in [0, 1].
    right: Dual,
    down: Dual,
}

/// Two texels side by side, and how far a place is from the first to the second.
#[derive(CubeType, Clone, Copy)]
struct Between {
    first: u32,
    second: u32,
    part: Dual,
}

/// A number of four texels: above left, above right, below left and below right of a place.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Four {
    a: Dual,
    b: Dual,
    c: Dual,
    d: Dual,
}

#[cube]
impl Between {
    /// `x` counted in texels from the middle of the first of `count`, which repeat.
    fn new(x: Dual, count: u32) -> Between {
        let floor = f32::floor(x.value);
        let size = f32::cast_from(count);
        let place = floor - size * f32::floor(floor / size);
        let place = select(place > 0.0f32, place, 0.0f32);
        let first = u32::cast_from(select(place < size, place, 0.0f32));
        // Neither rounding nor a place that is not a number leaves the texture; of floats a shader may assume that there is no such number.
        let first = select(first < count, first, 0u32);
        let second = select(first + 1 == count, 0u32, first + 1);
        Between { first, second, part: x.sub(Dual::constant(floor)) }
    }
}

#[cube]
impl Sample {
    /// The texture at `u` to the right and `v` up, each from 0 to 1, and again and again beyond.
    pub(super) fn at(u: Dual, v: Dual, weights: Weights) -> Sample {
        let half = Dual::constant(0.5f32);
        let x = u.scale(f32::cast_from(weights.columns)).sub(half);
        let y = Dual::constant(1.0f32).sub(v).scale(f32::cast_from(weights.rows)).sub(half);
        let across = Between::new(x, weights.columns);
        let down = Between::new(y, weights.rows);
        let (above, below) = (down.first * weights.columns, down.second * weights.columns);
        Sample {
            above_left: above + across.first,
            above_right: above + across.second,
            below_left: below + across.first,
            below_right: below + across.second,
            right: across.part,
            down: down.part,
        }
    }

    /// A channel of the four texels.
    pub(super) fn texels(self, drawn: &Drawn, channel: usize, #[comptime] kind: Kind) -> Four {
        let first = drawn.weights.texture + channel as u32;
        Four {
            a: drawn.number((first + NUMBERS * self.above_left) as usize, kind),
            b: drawn.number((first + NUMBERS * self.above_right) as usize, kind),
            c: drawn.number((first + NUMBERS * self.below_left) as usize, kind),
            d: drawn.number((first + NUMBERS * self.below_right) as usize, kind),
        }
    }

    /// What the four texels count.
    fn shares(self) -> Four {
        let one = Dual::constant(1.0f32);
        let (left, above) = (one.sub(self.right), one.sub(self.down));
        Four {
            a: left.mul(above),
            b: self.right.mul(above),
            c: left.mul(self.down),
            d: self.right.mul(self.down),
        }
    }

    /// A number of the four texels, between them.
    pub(super) fn between(self, four: Four) -> Dual {
        let shares = self.shares();
        let upper = shares.a.mul(four.a).add(shares.b.mul(four.b));
        upper.add(shares.c.mul(four.c)).add(shares.d.mul(four.d))
    }

    /// The derivative of that by u.
    pub(super) fn by_u(self, four: Four, weights: Weights) -> Dual {
        let above = Dual::constant(1.0f32).sub(self.down);
        let upper = four.b.sub(four.a).mul(above);
        let by_x = upper.add(four.d.sub(four.c).mul(self.down));
        by_x.scale(f32::cast_from(weights.columns))
    }

    /// The derivative of that by v.
    pub(super) fn by_v(self, four: Four, weights: Weights) -> Dual {
        let left = Dual::constant(1.0f32).sub(self.right);
        let on_the_left = four.a.sub(four.c).mul(left);
        let up = on_the_left.add(four.b.sub(four.d).mul(self.right));
        up.scale(f32::cast_from(weights.rows))
    }
}

#[cube]
impl Four {
    /// Of eight numbers, values and tangents.
    pub(super) fn load(numbers: &Array<f32>) -> Four {
        Four {
            a: Dual { value: numbers[0], tangent: numbers[1] },
            b: Dual { value: numbers[2], tangent: numbers[3] },
            c: Dual { value: numbers[4], tangent: numbers[5] },
            d: Dual { value: numbers[6], tangent: numbers[7] },
        }
    }

    pub(super) fn store(self, numbers: &mut Array<f32>) {
        numbers[0] = self.a.value;
        numbers[1] = self.a.tangent;
        numbers[2] = self.b.value;
        numbers[3] = self.b.tangent;
        numbers[4] = self.c.value;
        numbers[5] = self.c.tangent;
        numbers[6] = self.d.value;
        numbers[7] = self.d.tangent;
    }

    /// `self + factor · other`.
    pub(super) fn plus(self, factor: f32, other: Four) -> Four {
        Four {
            a: self.a.add(other.a.scale(factor)),
            b: self.b.add(other.b.scale(factor)),
            c: self.c.add(other.c.scale(factor)),
            d: self.d.add(other.d.scale(factor)),
        }
    }

    fn times(self, factor: Dual) -> Four {
        Four {
            a: self.a.mul(factor),
            b: self.b.mul(factor),
            c: self.c.mul(factor),
            d: self.d.mul(factor),
        }
    }
}

/// Adds up the gradient of the texels, one unit a pixel: with `measure` only finds the first [`MEASURED`] words of `sums`, else adds all terms to
/// those behind them, two for each number of the texels.
///
/// `pixels` is what [`blend_pixels`](super::blend::blend_pixels) has written.
#[cube(launch)]
pub(super) fn sum_texels(
    drawn: &Drawn,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    sums: &mut Array<Atomic<u32>>,
    #[comptime] kind: Kind,
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
                let shown = drawn.face(view, face, kind);
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
