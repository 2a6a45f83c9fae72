//! The visitor of a walk that accumulates gradients.
#![allow(clippy::needless_range_loop)]

use super::{
    block::{BLOCK, Block},
    depth::pull_row,
    quads::{QUAD, Quads},
    scene::Blend,
    shown::{FaceAttributes, Shown},
    sums::{between, place_on_texture},
    texture::{TEXEL_CHANNELS, TexelSums},
    walk::Visitor,
};
use crate::{
    float::Float as _,
    lanes::Lanes,
    list::{LISTED, of_pixels},
    real::{Float, Real, splat},
    scene::Scene,
};

/// Numbers per face of a gradient in addition to those of its attributes: x and y of three corners, then their depths.
pub(super) const CORNER_NUMBERS: usize = 9;

/// Gradients of `Σ upstream · image` with respect to a band's faces and to the tables.
pub(super) struct Pull<'a, T: Real> {
    /// Four numbers per pixel. 0: the logarithm that weights are relative to; 1: one over the sum of all weights; 2: `Σ upstream · image`
    /// over the channels, minus the upstream of the faces' share; 3: the logarithm of the weight below which a face is culled.
    pub(super) pixels: &'a Quads<Float<T>>,
    /// Number 3 of the pixels, contiguous: each chunk reads it to decide whether it counts.
    pub(super) limits: &'a [Float<T>],
    /// The upstream by channels, without tangents.
    pub(super) upstream: &'a Quads<Float<T>>,
    /// For each face of the band [`CORNER_NUMBERS`] numbers, then three per number of an attribute if the attributes' gradient is wanted.
    pub(super) faces: &'a mut [Float<T>],
    pub(super) stride: usize,
    /// Gradients of the tables of edge and depth, if they are wanted.
    pub(super) tables: Option<&'a mut [Vec<[Float<T>; 4]>; 2]>,
    pub(super) corners: [T::Lanes; CORNER_NUMBERS],
    pub(super) attributes: Vec<[T::Lanes; 3]>,
    /// Gradient of the texels, if it is wanted.
    pub(super) texels: Option<&'a mut TexelSums<Float<T>>>,
    /// The face of the list whose pairs are being summed.
    pub(super) owner: Option<usize>,
}

impl<T: Real> Pull<'_, T> {
    /// Whether weights of this logarithm count at some of these pixels.
    #[inline(always)]
    pub(super) fn counts(&self, at: [u32; 2], log: T::Lanes) -> bool {
        T::Lanes::bits(of_pixels::<T>(self.limits, at).less(log)) != 0
    }

    /// Adds to the gradient of a number of the attributes; `by_number` is the derivative with respect to it at the point of a pair.
    #[inline(always)]
    fn pull_attribute(&mut self, number: usize, by_number: T, weights: [T; 3]) {
        if let Some(sums) = self.attributes.get_mut(number) {
            for k in 0..3 {
                sums[k] += (by_number * weights[k]).output();
            }
        }
    }

    /// Adds the sums over the pairs of a face to its gradient.
    #[inline(always)]
    fn flush(&mut self, scene: &Scene<T>, shown: &Shown<T>, first: usize) {
        let Some(owner) = self.owner else { return };
        // From pixels, with y down, to NDC.
        let [right, down] = [scene.half, -scene.half].map(Float::<T>::from_f64);
        let own = &mut self.faces[(first + owner) * self.stride..(first + owner + 1) * self.stride];
        for k in 0..3 {
            let corner = shown.faces[owner % LISTED].order[k];
            own[2 * corner] += self.corners[2 * k].sum() * right;
            own[2 * corner + 1] += self.corners[2 * k + 1].sum() * down;
            own[6 + corner] += self.corners[6 + k].sum();
            for (number, sums) in self.attributes.iter_mut().enumerate() {
                own[CORNER_NUMBERS + 3 * number + corner] += sums[k].sum();
                sums[k] = splat(0.0);
            }
        }
        self.corners = [splat(0.0); CORNER_NUMBERS];
    }
}

impl<T: Real> Visitor<T> for Pull<'_, T> {
    const PULLS: bool = true;

    #[inline(always)]
    fn skips(&self, face: &FaceAttributes<T>, at: [u32; 2]) -> bool {
        // The sums are known now, and with them the faces that nearer faces hide.
        !self.counts(at, T::Lanes::splat(face.log))
    }

    #[inline(always)]
    fn take(&mut self, blend: &Blend<T>, shown: &Shown<T>, block: &Block<T>, first: usize) {
        let zero = T::constant(splat(0.0));
        let count = block.count.min(BLOCK);
        // The pairs that count at some pixel.
        let (mut live, mut some) = ([0; BLOCK], 0);
        for k in 0..count {
            let log = block.log_edge[k].value() + block.log_depth[k].value();
            live[some % BLOCK] = k;
            some += usize::from(self.counts(block.at[k], log));
        }
        let live = &live[..some.min(BLOCK)];
        // Shares of the image: of the weight, and of its part before the floor of the edge softness is subtracted.
        let (mut shares, mut images) = ([[zero; 2]; BLOCK], [zero; BLOCK]);
        for &k in live {
            let k = k % BLOCK;
            let log = block.log_edge[k].value() + block.log_depth[k].value();
            let [largest, per_total, image, limit] = self.pixels.groups::<T>(0, block.at[k]);
            let counts = limit.value().less(log);
            let weights = blend.weight(block.log_edge[k], block.log_depth[k], largest.value());
            shares[k] =
                [weights[0].masked(counts) * per_total, weights[1].masked(counts) * per_total];
            images[k] = image;
        }
        for &k in live {
            let k = k % BLOCK;
            let (at, weights, depth) = (block.at[k], block.weights[k], block.depth[k]);
            let [share, of_edge] = shares[k];
            let owner = block.owner[k];
            if self.owner != Some(owner) {
                self.flush(&blend.scene, shown, first);
                self.owner = Some(owner);
            }
            let face = &shown.faces[owner % LISTED];
            let attributes = shown.attributes(owner);
            // The derivatives with respect to the attributes of the corners, as if the point were there, and the value at the point.
            let mut at_corners = [zero; 3];
            let (here, there);
            if let Some(texture) = &blend.texture {
                let sample = texture.sample(place_on_texture(weights, attributes));
                let [a, b, c, d] = self.upstream.groups::<T>(0, at);
                let mut upstream = [a.value(), b.value(), c.value(), d.value()];
                for channel in blend.channels..TEXEL_CHANNELS {
                    upstream[channel % TEXEL_CHANNELS] = splat(0.0);
                }
                let [seen, by_u, by_v] = sample.pulled(upstream);
                for k in 0..3 {
                    let [u, v] = [attributes[0][k].lanes(), attributes[1][k].lanes()];
                    at_corners[k] = by_u * u + by_v * v;
                }
                for (number, by_place) in [by_u, by_v].into_iter().enumerate() {
                    self.pull_attribute(number, share * by_place, weights);
                }
                if let Some(texels) = &mut self.texels {
                    sample.pull_texels(share, upstream, texels);
                }
                (here, there) = (seen, between(weights, at_corners));
            } else {
                for (quad, attributes) in attributes.chunks(QUAD).enumerate() {
                    let upstream = self.upstream.groups::<T>(quad, at);
                    for (number, values) in attributes.iter().enumerate() {
                        let upstream = upstream[number % QUAD].value();
                        for k in 0..3 {
                            at_corners[k] = at_corners[k] + values[k].lanes().scale(upstream);
                        }
                        self.pull_attribute(QUAD * quad + number, share.scale(upstream), weights);
                    }
                }
                there = between(weights, at_corners);
                here = there;
            }
            // A share moves the image from its value towards that of the face.
            let draw = here - images[k];
            let (by_edge, by_depth) = (of_edge * draw, share * draw);
            let by_place = by_depth * block.by_depth[k].slope();
            // The nearness decreases with depth.
            let by_z = by_place.scale(T::Lanes::splat(blend.per_range).neg());
            // d z / d λₖ = -z² / zₖ, and the weights on the face are λₖ z / zₖ: both depend on λₖ through its share of 1 / z.
            let mut by_part = [zero; 3];
            for k in 0..3 {
                by_part[k] = depth * (share * (at_corners[k] - there) - depth * by_z);
            }
            let per_depth =
                [face.per_depth[0].lanes(), face.per_depth[1].lanes(), face.per_depth[2].lanes()];
            let by_barycentric =
                [by_part[0] * per_depth[0], by_part[1] * per_depth[1], by_part[2] * per_depth[2]];
            let [_, x, y] = &face.planes;
            let planes = [
                [x[0].lanes(), x[1].lanes(), x[2].lanes()],
                [y[0].lanes(), y[1].lanes(), y[2].lanes()],
            ];
            let point = &block.point[k];
            let moved = point.pulled(planes, by_edge * block.edge_slope[k], by_barycentric);
            for j in 0..6 {
                self.corners[j] += moved[j].output();
            }
            for j in 0..3 {
                let by_depth = by_barycentric[j] * point.barycentric[j] * per_depth[j];
                self.corners[6 + j] += (zero - by_depth).output();
            }
            if let Some(tables) = &mut self.tables {
                let [edge, depth] = &mut **tables;
                pull_row(zero - by_edge, block.edge_t[k], &block.edge_row[k], edge);
                block.by_depth[k].pull(by_depth, depth);
            }
        }
    }

    #[inline(always)]
    fn ends(&mut self, scene: &Scene<T>, shown: &Shown<T>, first: usize) {
        self.flush(scene, shown, first);
        self.owner = None;
    }
}
