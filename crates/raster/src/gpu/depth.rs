//! Depth weights of points, as in `blend/depth.rs` of `kernel`.

use cubecl::prelude::*;

use super::{
    blend_inputs::{BlendInputs, BlendSpec},
    dual::Dual,
    table::add_powers,
};

/// The logarithm of a depth weight, and its derivative with respect to the nearness.
#[derive(CubeType, Clone, Copy)]
pub(super) struct ByDepth {
    pub(super) log: Dual,
    pub(super) slope: Dual,
}

#[cube]
impl ByDepth {
    /// The depth weight of a point at `x`, its nearness less 1.
    pub(super) fn at(x: Dual, drawn: &BlendInputs, #[comptime] kind: BlendSpec) -> ByDepth {
        let weights = drawn.weights;
        let zero = Dual::constant(0.0f32);
        let at = 4 * weights.depth_row as usize;
        if kind.is_line {
            let nearness = x.add(Dual::constant(1.0f32));
            let (a, c) = (drawn.number(at, kind), drawn.number(at + 1, kind));
            let slope = Dual::select(nearness.value > 0.0f32, a, zero.sub(c));
            let weight = slope.mul(nearness);
            let some = weight.value > weights.least;
            let held = Dual::select(some, weight, Dual::constant(weights.least));
            let per_weight = Dual::select(some, held.recip(), zero);
            ByDepth { log: held.ln(), slope: slope.mul(per_weight) }
        } else if kind.is_exponential {
            let slope = drawn.number(at, kind);
            let log = slope.mul(x).add(drawn.number(at + 1, kind));
            let (above, below) = (log.value > weights.least, log.value < 0.0f32);
            let log = Dual::select(above, log, Dual::constant(weights.least));
            ByDepth {
                log: Dual::select(below, log, zero),
                slope: Dual::select(above && below, slope, zero),
            }
        } else {
            let place = weights.depth.place(x.mul(x), x.value <= 0.0f32, kind.far_depth);
            let cubic = drawn.cubic(weights.depth_row + place.row, kind);
            let slope = place.slope(cubic).mul(x.scale(-2.0f32));
            ByDepth { log: zero.sub(place.value(cubic)), slope }
        }
    }
}

/// Adds to the gradient of the depth table, which starts at `first`; `by_log` is the derivative with respect to the logarithm at `x`.
#[cube]
pub(super) fn pull_depth(
    x: Dual,
    by_log: Dual,
    drawn: &BlendInputs,
    partial: &mut Array<f32>,
    first: u32,
    #[comptime] kind: BlendSpec,
) {
    let weights = drawn.weights;
    let zero = Dual::constant(0.0f32);
    if kind.is_line || kind.is_exponential {
        let at = 4 * weights.depth_row as usize;
        let (a, c) = (drawn.number(at, kind), drawn.number(at + 1, kind));
        let (by_a, by_c) = if kind.is_line {
            let nearness = x.add(Dual::constant(1.0f32));
            let near = nearness.value > 0.0f32;
            let weight = Dual::select(near, a, zero.sub(c)).mul(nearness);
            let some = weight.value > weights.least;
            let held = Dual::select(some, weight, Dual::constant(1.0f32));
            let by_slope = Dual::select(some, by_log.mul(nearness).mul(held.recip()), zero);
            (Dual::select(near, by_slope, zero), Dual::select(near, zero, zero.sub(by_slope)))
        } else {
            let log = a.mul(x).add(c).value;
            let by_constant = Dual::select(log > weights.least && log < 0.0f32, by_log, zero);
            (by_constant.mul(x), by_constant)
        };
        let first = first as usize;
        partial[first] = partial[first] + by_a.stored(kind.second);
        partial[first + 1] = partial[first + 1] + by_c.stored(kind.second);
    } else {
        let place = weights.depth.place(x.mul(x), x.value <= 0.0f32, kind.far_depth);
        let row = first + 4u32 * place.row;
        add_powers(partial, row, place.place, zero.sub(by_log), kind.second);
    }
}
