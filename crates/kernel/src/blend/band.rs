//! The colour pass of one band of one view: its sums, its image, and its gradient.
#![allow(clippy::needless_range_loop)]

use std::sync::OnceLock;

use super::{
    pull::{CORNER_NUMBERS, Pull},
    quads::{QUAD, Quads},
    scene::{Blend, of_type},
    sums::{Largest, Sums},
    texture::TexelSums,
    walk::{Visitor, Walk},
};
use crate::{
    bands::View,
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
pub(super) struct Walked<F> {
    /// Rows of the image, plane by plane, in the layout of the image.
    pub(super) image: Vec<Vec<F>>,
    pub(super) faces: Vec<F>,
    pub(super) tables: [Vec<[F; 4]>; 2],
    pub(super) background: Vec<F>,
    pub(super) texels: TexelSums<F>,
}

/// One band of one view.
pub(super) struct Band<'a, 's, T: Real> {
    pub(super) blend: &'a Blend<'s, T>,
    pub(super) of_view: &'a View,
    pub(super) views: usize,
    pub(super) view: usize,
    pub(super) band: usize,
    /// Logarithm of the largest depth weight of each face.
    pub(super) logs: &'a [f32],
    /// Logarithm of the relative weight below which a face is culled at a pixel.
    pub(super) least: f64,
    pub(super) kept: Option<&'a OnceLock<BandSums<Float<T>>>>,
    /// `[channels + 1, height, width]`, and which gradients are wanted.
    pub(super) upstream: Option<(&'a [Float<T>], [bool; 5])>,
}

impl<T: Real> Work for Band<'_, '_, T> {
    type Output = Walked<Float<T>>;

    #[inline(always)]
    fn run(self) -> Walked<Float<T>> {
        let blend = self.blend;
        let (scene, channels) = (&blend.scene, blend.channels);
        let zero = <Float<T> as float::Float>::ZERO;
        let length = self.place().length(scene);
        let padded = length.next_multiple_of(LANES);
        // Cached sums have no tangents.
        let kept = self.kept.filter(|_| !T::DUAL);
        let own;
        let BandSums { largest, sums } = match kept {
            Some(kept) => {
                if kept.get().is_none() {
                    // Another walk may have set it first, with the same sums.
                    let _ = kept.set(self.summed(length));
                }
                kept.get().expect("it was set")
            }
            None => {
                own = self.summed(length);
                &own
            }
        };
        let upstream = self.upstream.map(|(upstream, _)| self.padded(upstream, length));
        let with_image = self.upstream.is_none() || T::DUAL;
        let mut image = vec![zero; if with_image { (channels + 1) * largest.len() } else { 0 }];
        let of_pixels = if upstream.is_some() { length } else { 0 };
        let mut pixels = Quads::new(QUAD, of_pixels, T::DUAL);
        let mut limits = vec![zero; of_pixels.next_multiple_of(LANES)];
        // Gradient of each channel of the background.
        let mut background = vec![splat::<T::Lanes>(0.0); channels + 1];
        let mut seen = vec![T::constant(splat(0.0)); channels + 1];
        let log_weight = blend.behind(channels);
        for (k, largest) in largest.as_chunks().0.iter().enumerate() {
            let largest = T::Lanes::of(largest);
            let behind = T::exponential(log_weight - T::constant(largest));
            let mut sum = T::constant(splat(0.0));
            let (mut per_total, mut rest) = (sum, sum);
            for (number, quad) in (0..channels + 1).step_by(QUAD).zip(0..) {
                for (number, own) in (number..=channels).zip(sums.vector(quad, k)) {
                    if number == 0 {
                        sum = own;
                        per_total = T::inverse(sum + behind);
                        rest = behind * per_total;
                        seen[channels] = sum * per_total;
                    } else {
                        seen[number - 1] = own * per_total + rest * blend.behind(number - 1);
                    }
                }
            }
            if with_image {
                for (plane, seen) in image.chunks_exact_mut(padded).zip(&seen) {
                    plane[k * LANES..(k + 1) * LANES].copy_from_slice(&seen.output().array());
                }
            }
            let Some(upstream) = &upstream else { continue };
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
            let total = (sum + behind).value().ln();
            let total = total + largest + splat(self.least);
            pixels.set(k, [T::constant(largest), per_total, image, T::constant(total)]);
            limits[k * LANES..(k + 1) * LANES].copy_from_slice(&total.array());
        }
        let mut walked = Walked {
            image: image.chunks_exact(padded).map(|plane| self.trimmed(plane)).collect(),
            faces: Vec::new(),
            tables: [Vec::new(), Vec::new()],
            background: background.into_iter().map(Lanes::sum).collect(),
            texels: blend.no_texels(self.upstream.is_some_and(|(_, wanted)| wanted[4])),
        };
        if let (Some(upstream), Some((_, wanted))) = (&upstream, self.upstream) {
            self.pull(&pixels, &limits, upstream, wanted, &mut walked);
        }
        walked
    }
}

impl<T: Real> Band<'_, '_, T> {
    fn place(&self) -> BandRef<'_, T> {
        self.blend.scene.place(self.of_view, self.view, self.views, self.band)
    }

    #[inline(always)]
    fn walk<V: Visitor<T>>(&self, visitor: &mut V) {
        let place = self.place();
        run::<T::Lanes, _>(Walk {
            blend: self.blend,
            place,
            view: self.view,
            logs: self.logs,
            visitor,
        });
    }

    #[inline(always)]
    fn summed(&self, length: usize) -> BandSums<Float<T>> {
        let largest = self.largest(length);
        let mut sums = Quads::new(1 + self.blend.channels, length, T::DUAL);
        self.walk(&mut Sums { largest: &largest, sums: &mut sums });
        BandSums { largest, sums }
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
        self.walk(&mut Largest { largest: &mut largest });
        largest
    }

    #[inline(always)]
    fn pull(
        &self,
        pixels: &Quads<Float<T>>,
        limits: &[Float<T>],
        upstream: &Quads<Float<T>>,
        [_, of_attributes, of_tables, _, of_texels]: [bool; 5],
        walked: &mut Walked<Float<T>>,
    ) {
        let zero = <Float<T> as float::Float>::ZERO;
        let numbers = if of_attributes { self.blend.numbers } else { 0 };
        let stride = CORNER_NUMBERS + 3 * numbers;
        walked.faces = vec![zero; self.of_view.faces(self.band).len() * stride];
        let rows = [self.blend.scene.grid.rows(), self.blend.depth.rows()];
        let mut tables = rows.map(|rows| vec![[zero; 4]; if of_tables { rows } else { 0 }]);
        self.walk(&mut Pull {
            pixels,
            limits,
            upstream,
            faces: &mut walked.faces,
            stride,
            tables: of_tables.then_some(&mut tables),
            corners: [splat(0.0); CORNER_NUMBERS],
            attributes: vec![[splat(0.0); 3]; numbers],
            texels: of_texels.then_some(&mut walked.texels),
            owner: None,
        });
        walked.tables = tables;
    }

    /// The band's rows of an upstream, followed by zeros.
    fn padded(&self, upstream: &[Float<T>], length: usize) -> Quads<Float<T>> {
        let scene = &self.blend.scene;
        let (width, rows) = (scene.size.width, self.of_view.rows(self.band));
        let mut padded = Quads::new(self.blend.channels + 1, length, false);
        for (number, upstream) in upstream.chunks_exact(scene.size.pixels()).enumerate() {
            let own = &upstream[rows.start * width..rows.end * width];
            for (row, own) in own.chunks(width).enumerate() {
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
