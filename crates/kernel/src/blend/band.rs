//! The colour pass of one band of one view: its sums, its image, and its gradient.
#![allow(clippy::needless_range_loop)]

use std::{ops::Range, sync::OnceLock};

use super::{
    pull::{CORNER_NUMBERS, Pull},
    quads::{QUAD, Quads},
    scene::{Band, of_type},
    sums::{Largest, Sums},
    texture::TexelSums,
    walk::{Visitor, Walk},
};
use crate::{
    float,
    lanes::{LANES, Lanes, Work, run},
    real::{Float, Real, splat},
    scene::BandRef,
};

/// Logarithm of the largest ratio of two weights whose sum keeps both, in f32 and in f64.
const RANGE: [f64; 2] = [60.0, 600.0];

/// Sums over the faces at the pixels of a band.
pub(super) struct BandSums<F> {
    /// Logarithms that weights are relative to, per pixel: close enough to the logarithm of the pixel's sum for the range of floats.
    largest: Vec<F>,
    /// Sums of the weights, then of each channel.
    sums: Quads<F>,
}

/// Results of a band.
#[derive(Default)]
pub(super) struct Walked<F> {
    /// The loss of its pixels, if they were judged.
    pub(super) loss: F,
    /// Rows of the image, plane by plane, in the layout of the image; empty if it is not wanted.
    pub(super) image: Vec<Vec<F>>,
    pub(super) faces: Vec<F>,
    pub(super) tables: [Vec<[F; 4]>; 2],
    pub(super) background: Vec<F>,
    pub(super) texels: TexelSums<F>,
}

/// The image of a band, or the gradient of `Σ upstream · image`, and of dual numbers both.
pub(super) struct Drawn<'a, 's, T: Real> {
    pub(super) of: Band<'a, 's, T>,
    pub(super) kept: Option<&'a OnceLock<BandSums<Float<T>>>>,
    /// `[views, channels + 1, height, width]`, and which gradients are wanted.
    pub(super) upstream: Option<(&'a [Float<T>], [bool; 5])>,
}

impl<T: Real> Work for Drawn<'_, '_, T> {
    type Output = Walked<Float<T>>;

    #[inline(always)]
    fn run(self) -> Walked<Float<T>> {
        let Self { of, kept, upstream } = self;
        // Cached sums have no tangents.
        let own;
        let sums = match kept {
            Some(kept) if !T::DUAL => {
                if kept.get().is_none() {
                    // Another walk may have set it first, with the same sums.
                    let _ = kept.set(of.summed());
                }
                kept.get().expect("it was set")
            }
            _ => {
                own = of.summed();
                &own
            }
        };
        let texels = of.blend.no_texels(upstream.map(|(_, wanted)| wanted));
        let mut walked = Walked { texels, ..Walked::default() };
        if upstream.is_none() || T::DUAL {
            walked.image = of.image(sums);
        }
        if let Some((upstream, wanted)) = upstream {
            let upstream = of.padded(of.own(upstream));
            of.pull(sums, &upstream, wanted, &mut walked, |pull| of.walk_from(0, pull));
        }
        walked
    }
}

impl<'a, 's, T: Real> Band<'a, 's, T> {
    pub(super) fn place(&self) -> BandRef<'a, T> {
        self.blend.scene.place(self.of_view, self.view, self.views, self.band)
    }

    /// Length of the buffers of its pixels.
    fn length(&self) -> usize {
        self.place().length(&self.blend.scene)
    }

    /// Walks over the pairs of the faces from list `first_list` on.
    #[inline(always)]
    pub(super) fn walk_from<V: Visitor<T>>(&self, first_list: usize, visitor: &mut V) {
        let place = BandRef { first_list, ..self.place() };
        run::<T::Lanes, _>(Walk { of: *self, place, visitor });
    }

    #[inline(always)]
    fn summed(&self) -> BandSums<Float<T>> {
        self.summed_by(|sums| self.walk_from(0, sums))
    }

    /// The sums over the faces that a walk visits.
    #[inline(always)]
    pub(super) fn summed_by(&self, walk: impl FnOnce(&mut Sums<T>)) -> BandSums<Float<T>> {
        let length = self.length();
        let largest = self.largest(length);
        let mut sums = Quads::new(1 + self.blend.channels, length, T::DUAL);
        walk(&mut Sums { largest: &largest, sums: &mut sums });
        BandSums { largest, sums }
    }

    /// The logarithm of the weight below which a face is culled at each pixel.
    #[inline(always)]
    fn limits(&self, of: &BandSums<Float<T>>) -> Vec<Float<T>> {
        let behind = self.blend.behind(self.blend.channels).value();
        let mut limits = of.largest.clone();
        for (k, limit) in limits.as_chunks_mut().0.iter_mut().enumerate() {
            let largest = T::Lanes::of(limit);
            let [sum, ..] = of.sums.vector::<T>(0, k);
            let total = sum.value() + (behind - largest).exp();
            *limit = (total.ln() + largest + splat(self.least)).array();
        }
        limits
    }

    /// See [`BandSums`].
    #[inline(always)]
    fn largest(&self, length: usize) -> Vec<Float<T>> {
        let blend = self.blend;
        let behind = blend.background[0][blend.channels];
        let number = <Float<T> as float::Float>::from_f64;
        let length = length.next_multiple_of(LANES);
        // Upper bound of all weights; the background is always there. If the two are close enough, one number serves all pixels.
        let faces = self.of_view.faces(self.band).iter();
        let highest = faces.map(|&face| self.logs[face as usize]).fold(f32::MIN, f32::max);
        let highest = number(f64::from(highest));
        if highest <= behind + number(of_type::<Float<T>>(RANGE)) {
            return vec![if highest > behind { highest } else { behind }; length];
        }
        let mut largest = vec![behind; length];
        self.walk_from(0, &mut Largest { largest: &mut largest });
        largest
    }

    /// One over the sum of all weights at vector `k` of the pixels, and the background's share; sets `seen` to the channels of the image and
    /// the faces' share.
    #[inline(always)]
    fn seen(&self, of: &BandSums<Float<T>>, k: usize, seen: &mut [T]) -> [T; 2] {
        let (blend, channels) = (self.blend, self.blend.channels);
        let largest = T::Lanes::of(&of.largest.as_chunks().0[k]);
        let behind = T::exponential(blend.behind(channels) - T::constant(largest));
        let (mut per_total, mut rest) = (T::constant(splat(0.0)), T::constant(splat(0.0)));
        for (number, quad) in (0..channels + 1).step_by(QUAD).zip(0..) {
            for (number, own) in (number..=channels).zip(of.sums.vector::<T>(quad, k)) {
                if number == 0 {
                    per_total = T::inverse(own + behind);
                    rest = behind * per_total;
                    seen[channels] = own * per_total;
                } else {
                    seen[number - 1] = own * per_total + rest * blend.behind(number - 1);
                }
            }
        }
        [per_total, rest]
    }

    /// The image from its sums, plane by plane.
    #[inline(always)]
    pub(super) fn image(&self, of: &BandSums<Float<T>>) -> Vec<Vec<Float<T>>> {
        let (planes, padded) = (self.blend.channels + 1, of.largest.len());
        let mut image = vec![<Float<T> as float::Float>::ZERO; planes * padded];
        let mut seen = vec![T::constant(splat(0.0)); planes];
        for k in 0..padded / LANES {
            self.seen(of, k, &mut seen);
            for (plane, seen) in image.chunks_exact_mut(padded).zip(&seen) {
                plane[k * LANES..(k + 1) * LANES].copy_from_slice(&seen.output().array());
            }
        }
        image.chunks_exact(padded).map(|plane| self.trimmed(plane)).collect()
    }

    /// Sets the gradients, those of the faces by a walk.
    #[inline(always)]
    pub(super) fn pull(
        &self,
        of: &BandSums<Float<T>>,
        upstream: &Quads<Float<T>>,
        [_, of_attributes, of_tables, _, of_texels]: [bool; 5],
        walked: &mut Walked<Float<T>>,
        walk: impl FnOnce(&mut Pull<T>),
    ) {
        let zero = <Float<T> as float::Float>::ZERO;
        let limits = self.limits(of);
        let (pixels, background) = self.pulled(of, &limits, upstream);
        let numbers = if of_attributes { self.blend.numbers } else { 0 };
        let stride = CORNER_NUMBERS + 3 * numbers;
        walked.faces = vec![zero; self.of_view.faces(self.band).len() * stride];
        let rows = [self.blend.scene.grid.rows(), self.blend.depth.rows()];
        let mut tables = rows.map(|rows| vec![[zero; 4]; if of_tables { rows } else { 0 }]);
        walk(&mut Pull {
            pixels: &pixels,
            limits: &limits,
            upstream,
            faces: &mut walked.faces,
            stride,
            tables: of_tables.then_some(&mut tables),
            corners: [splat(0.0); CORNER_NUMBERS],
            attributes: vec![[splat(0.0); 3]; numbers],
            texels: of_texels.then_some(&mut walked.texels),
            owner: None,
        });
        (walked.tables, walked.background) = (tables, background);
    }

    /// Numbers of the pixels that [`Pull`] needs, and the gradient of the background.
    #[inline(always)]
    fn pulled(
        &self,
        of: &BandSums<Float<T>>,
        limits: &[Float<T>],
        upstream: &Quads<Float<T>>,
    ) -> (Quads<Float<T>>, Vec<Float<T>>) {
        let (blend, channels) = (self.blend, self.blend.channels);
        let mut pixels = Quads::new(QUAD, limits.len(), T::DUAL);
        let mut background = vec![splat::<T::Lanes>(0.0); channels + 1];
        let mut seen = vec![T::constant(splat(0.0)); channels + 1];
        for (k, limit) in limits.as_chunks().0.iter().enumerate() {
            let [per_total, rest] = self.seen(of, k, &mut seen);
            let mut whole = T::constant(splat(0.0));
            let (mut alone, mut of_share) = (whole, splat(0.0));
            for (first, quad) in (0..channels + 1).step_by(QUAD).zip(0..) {
                for (channel, upstream) in (first..=channels).zip(upstream.vector::<T>(quad, k)) {
                    let upstream = upstream.value();
                    whole = whole + seen[channel].scale(upstream);
                    if channel == channels {
                        of_share = upstream;
                    } else {
                        alone = alone + blend.behind(channel).scale(upstream);
                        background[channel] += rest.scale(upstream).output();
                    }
                }
            }
            background[channels] += (rest * (alone - whole)).output();
            let image = whole - T::constant(of_share);
            let largest = T::Lanes::of(&of.largest.as_chunks().0[k]);
            let limit = T::Lanes::of(limit);
            pixels.set(k, [T::constant(largest), per_total, image, T::constant(limit)]);
        }
        (pixels, background.into_iter().map(Lanes::sum).collect())
    }

    /// The rows of the image that the band holds, as pixels of a view.
    pub(super) fn pixels(&self) -> Range<usize> {
        let (width, rows) = (self.blend.scene.size.width, self.of_view.rows(self.band));
        rows.start * width..rows.end * width
    }

    /// The band's rows of each plane of an image `[views, channels + 1, height, width]`.
    fn own<'u>(&self, image: &'u [Float<T>]) -> impl Iterator<Item = &'u [Float<T>]> {
        let (of_plane, pixels) = (self.blend.scene.size.pixels(), self.pixels());
        let planes = image.chunks_exact(of_plane).skip(self.view * (self.blend.channels + 1));
        planes.take(self.blend.channels + 1).map(move |plane| &plane[pixels.clone()])
    }

    /// The band's rows of an upstream, plane by plane, followed by zeros.
    pub(super) fn padded<'u>(
        &self,
        planes: impl Iterator<Item = &'u [Float<T>]>,
    ) -> Quads<Float<T>> {
        let scene = &self.blend.scene;
        let mut padded = Quads::new(self.blend.channels + 1, self.length(), false);
        for (number, own) in planes.enumerate() {
            for (row, own) in own.chunks(scene.size.width).enumerate() {
                padded.set_values(number, row * scene.stride(), own);
            }
        }
        padded
    }

    /// The band's rows in the layout of the image.
    fn trimmed(&self, padded: &[Float<T>]) -> Vec<Float<T>> {
        let scene = &self.blend.scene;
        let (width, rows) = (scene.size.width, self.of_view.rows(self.band).len());
        let padded = padded.chunks(scene.stride()).take(rows);
        padded.flat_map(|row| &row[..width]).copied().collect()
    }
}
