//! A texture, sampled bilinearly at points of faces, as in `blend/texture.rs` of `kernel`.

use cubecl::prelude::*;

use super::{
    blend_inputs::{BlendInputs, BlendParams, BlendSpec},
    dual::Dual,
};
use softrast_kernel::blend::TEXEL_CHANNELS;

/// Numbers of a texel.
pub(super) const NUMBERS: u32 = TEXEL_CHANNELS as u32;

/// A position on a texture, between four texels.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Sample {
    pub(super) above_left: u32,
    pub(super) above_right: u32,
    pub(super) below_left: u32,
    pub(super) below_right: u32,
    /// Fractions from the left to the right texels, and from the upper to the lower ones, in [0, 1].
    right: Dual,
    down: Dual,
}

/// Two adjacent texels, and the fraction of a position between them.
#[derive(CubeType, Clone, Copy)]
struct Between {
    first: u32,
    second: u32,
    part: Dual,
}

/// A number of four texels: above left, above right, below left and below right of a position.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Four {
    pub(super) a: Dual,
    pub(super) b: Dual,
    pub(super) c: Dual,
    pub(super) d: Dual,
}

#[cube]
impl Between {
    /// `x` in texels from the centre of the first of `count`, which repeat.
    fn new(x: Dual, count: u32) -> Between {
        let floor = f32::floor(x.value);
        let size = f32::cast_from(count);
        let place = floor - size * f32::floor(floor / size);
        let place = select(place > 0.0f32, place, 0.0f32);
        let first = u32::cast_from(select(place < size, place, 0.0f32));
        // Neither rounding nor NaN leaves the texture; for floats a shader may assume that there is no NaN.
        let first = select(first < count, first, 0u32);
        let second = select(first + 1 == count, 0u32, first + 1);
        Between { first, second, part: x.sub(Dual::constant(floor)) }
    }
}

#[cube]
impl Sample {
    /// Samples the texture at `u` to the right and `v` up, from 0 to 1; it repeats beyond.
    pub(super) fn at(u: Dual, v: Dual, weights: BlendParams) -> Sample {
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
    pub(super) fn texels(
        self,
        drawn: &BlendInputs,
        channel: usize,
        #[comptime] kind: BlendSpec,
    ) -> Four {
        let first = drawn.weights.texture + channel as u32;
        Four {
            a: drawn.number((first + NUMBERS * self.above_left) as usize, kind),
            b: drawn.number((first + NUMBERS * self.above_right) as usize, kind),
            c: drawn.number((first + NUMBERS * self.below_left) as usize, kind),
            d: drawn.number((first + NUMBERS * self.below_right) as usize, kind),
        }
    }

    /// The weights of the four texels.
    pub(super) fn shares(self) -> Four {
        let one = Dual::constant(1.0f32);
        let (left, above) = (one.sub(self.right), one.sub(self.down));
        Four {
            a: left.mul(above),
            b: self.right.mul(above),
            c: left.mul(self.down),
            d: self.right.mul(self.down),
        }
    }

    /// Interpolates a number of the four texels.
    pub(super) fn between(self, four: Four) -> Dual {
        let shares = self.shares();
        let upper = shares.a.mul(four.a).add(shares.b.mul(four.b));
        upper.add(shares.c.mul(four.c)).add(shares.d.mul(four.d))
    }

    /// The derivative of the interpolated number with respect to u.
    pub(super) fn by_u(self, four: Four, weights: BlendParams) -> Dual {
        let above = Dual::constant(1.0f32).sub(self.down);
        let upper = four.b.sub(four.a).mul(above);
        let by_x = upper.add(four.d.sub(four.c).mul(self.down));
        by_x.scale(f32::cast_from(weights.columns))
    }

    /// The derivative of the interpolated number with respect to v.
    pub(super) fn by_v(self, four: Four, weights: BlendParams) -> Dual {
        let left = Dual::constant(1.0f32).sub(self.right);
        let on_the_left = four.a.sub(four.c).mul(left);
        let up = on_the_left.add(four.b.sub(four.d).mul(self.right));
        up.scale(f32::cast_from(weights.rows))
    }
}

#[cube]
impl Four {
    /// Four dual numbers from eight floats, values and tangents in turn.
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

    pub(super) fn times(self, factor: Dual) -> Four {
        Four {
            a: self.a.mul(factor),
            b: self.b.mul(factor),
            c: self.c.mul(factor),
            d: self.d.mul(factor),
        }
    }
}
