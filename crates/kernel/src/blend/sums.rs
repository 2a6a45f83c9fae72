//! Visitors of a walk that compute the largest weight of each pixel, and the sums of weights.
#![allow(clippy::needless_range_loop)]

use super::{
    block::{BLOCK, Block},
    quads::{QUAD, Quads},
    scene::Blend,
    shown::{Number, Shown},
    texture::TEXEL_CHANNELS,
    walk::Visitor,
};
use crate::{
    lanes::{GROUP, Lanes},
    list::of_pixels,
    real::{Float, Real, splat},
};

/// The logarithm used for a weight of 0.
const HIDDEN: f64 = -1e30;

/// Interpolates a number at a point from its values at the corners.
#[inline(always)]
pub(super) fn between<T: Real>([w0, w1, w2]: [T; 3], [c0, c1, c2]: [T; 3]) -> T {
    w0 * c0 + w1 * c1 + w2 * c2
}

/// Coordinates of a point on the texture.
#[inline(always)]
pub(super) fn place_on_texture<T: Real>(weights: [T; 3], attributes: &[[Number<T>; 3]]) -> [T; 2] {
    let [[u0, u1, u2], [v0, v1, v2], ..] = attributes else {
        unreachable!("places have two numbers");
    };
    [
        between(weights, [u0.lanes(), u1.lanes(), u2.lanes()]),
        between(weights, [v0.lanes(), v1.lanes(), v2.lanes()]),
    ]
}

/// Computes the logarithm of the largest weight of each pixel.
pub(super) struct Largest<'a, T: Real> {
    pub(super) largest: &'a mut [Float<T>],
}

impl<T: Real> Visitor<T> for Largest<'_, T> {
    const PULLS: bool = false;

    #[inline(always)]
    fn take(&mut self, blend: &Blend<T>, _: &Shown<T>, block: &Block<T>, _: usize) {
        for k in 0..block.count.min(BLOCK) {
            let log_edge = block.log_edge[k].value();
            let log = log_edge + block.log_depth[k].value();
            // A face that does not count must not make others vanish.
            let some = T::Lanes::splat(blend.counts_from).less(log_edge);
            let logs = <T::Lanes as Lanes>::pick(some, log, splat(HIDDEN)).array();
            for (half, at) in block.at[k].into_iter().enumerate() {
                for i in 0..GROUP {
                    let (place, log) = (&mut self.largest[at as usize + i], logs[half * GROUP + i]);
                    *place = if log > *place { log } else { *place };
                }
            }
        }
    }
}

/// Sums weights, and weights times attributes.
pub(super) struct Sums<'a, T: Real> {
    pub(super) largest: &'a [Float<T>],
    /// The sum of the weights, then that of each channel.
    pub(super) sums: &'a mut Quads<Float<T>>,
}

impl<T: Real> Sums<'_, T> {
    /// Adds the weight, and the weighted channels.
    #[inline(always)]
    fn add(&mut self, at: [u32; 2], weight: T, weights: [T; 3], attributes: &[[Number<T>; 3]]) {
        let first = attribute(attributes, 0, weights);
        let (second, third) =
            (attribute(attributes, 1, weights), attribute(attributes, 2, weights));
        self.sums.add(0, at, [weight, weight * first, weight * second, weight * third]);
        for quad in 1..self.sums.count() {
            let mut numbers = [weight; QUAD];
            for k in 0..QUAD {
                numbers[k] = weight * attribute(attributes, QUAD * quad + k - 1, weights);
            }
            self.sums.add(quad, at, numbers);
        }
    }
}

/// Number `number` of the attributes at a point, 0 beyond the last.
#[inline(always)]
fn attribute<T: Real>(attributes: &[[Number<T>; 3]], number: usize, weights: [T; 3]) -> T {
    match attributes.get(number) {
        Some([a, b, c]) => between(weights, [a.lanes(), b.lanes(), c.lanes()]),
        None => T::constant(splat(0.0)),
    }
}

impl<T: Real> Visitor<T> for Sums<'_, T> {
    const PULLS: bool = false;

    #[inline(always)]
    fn take(&mut self, blend: &Blend<T>, shown: &Shown<T>, block: &Block<T>, _: usize) {
        let count = block.count.min(BLOCK);
        let zero = T::constant(splat(0.0));
        let mut weights = [zero; BLOCK];
        for k in 0..count {
            let largest = of_pixels::<T>(self.largest, block.at[k]);
            let [weight, _] = blend.weight(block.log_edge[k], block.log_depth[k], largest);
            // Products of denormal numbers take a hundred times as long.
            weights[k] = weight.masked(T::Lanes::splat(blend.vanishing).less(weight.value()));
        }
        for k in 0..count {
            let (at, weight) = (block.at[k], weights[k]);
            let attributes = shown.attributes(block.owner[k]);
            let Some(texture) = &blend.texture else {
                self.add(at, weight, block.weights[k], attributes);
                continue;
            };
            let mut seen =
                texture.sample(place_on_texture(block.weights[k], attributes)).channels();
            // A texel has as many channels as a quad, the image may have fewer.
            for channel in blend.channels..TEXEL_CHANNELS {
                seen[channel % TEXEL_CHANNELS] = zero;
            }
            let [a, b, c, d] = seen;
            self.sums.add(0, at, [weight, weight * a, weight * b, weight * c]);
            if self.sums.count() > 1 {
                self.sums.add(1, at, [weight * d, zero, zero, zero]);
            }
        }
    }
}
