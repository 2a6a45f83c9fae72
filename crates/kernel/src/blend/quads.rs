//! Numbers of the pixels of a band, in quads of four per pixel: a visit reads or updates a quad at once.

use crate::{
    float::Float,
    lanes::{GROUP, LANES, Lanes},
    real::Real,
};

/// Numbers of a pixel that lie side by side.
pub(super) const QUAD: usize = 4;

/// Some numbers per pixel, in quads, with tangents if the numbers have any. Has the length of a band, padded to whole vectors.
pub(super) struct Quads<F> {
    values: Vec<[F; QUAD]>,
    tangents: Vec<[F; QUAD]>,
    length: usize,
}

impl<F: Float> Quads<F> {
    /// Zeros: `numbers` numbers for each pixel of a band of length `length`, with tangents or without.
    pub(super) fn new(numbers: usize, length: usize, tangents: bool) -> Self {
        let length = length.next_multiple_of(LANES);
        let count = numbers.div_ceil(QUAD) * length;
        let zeros = |there: bool| vec![[F::ZERO; QUAD]; if there { count } else { 0 }];
        Self { values: zeros(true), tangents: zeros(tangents), length }
    }

    /// Sets number `number` of the pixels from `first` on.
    pub(super) fn set_values(&mut self, number: usize, first: usize, values: &[F]) {
        let quads = &mut self.values[number / QUAD * self.length + first..];
        for (quad, &value) in quads.iter_mut().zip(values) {
            quad[number % QUAD] = value;
        }
    }

    /// Number of quads per pixel.
    pub(super) fn count(&self) -> usize {
        self.values.len() / self.length
    }

    /// Quad `quad` of two groups of pixels.
    #[inline(always)]
    pub(super) fn groups<T>(&self, quad: usize, at: [u32; 2]) -> [T; QUAD]
    where
        T: Real,
        T::Lanes: Lanes<Float = F>,
    {
        let start = (quad * self.length) as u32;
        let at = [start + at[0], start + at[1]];
        let [a, b, c, d] = T::Lanes::quads(&self.values, at);
        if !T::DUAL || self.tangents.is_empty() {
            return [T::constant(a), T::constant(b), T::constant(c), T::constant(d)];
        }
        let [da, db, dc, dd] = T::Lanes::quads(&self.tangents, at);
        [T::new(a, da), T::new(b, db), T::new(c, dc), T::new(d, dd)]
    }

    /// Adds to quad `quad` of two groups of pixels.
    #[inline(always)]
    pub(super) fn add<T>(&mut self, quad: usize, at: [u32; 2], [a, b, c, d]: [T; QUAD])
    where
        T: Real,
        T::Lanes: Lanes<Float = F>,
    {
        let start = (quad * self.length) as u32;
        let at = [start + at[0], start + at[1]];
        let values = [a.value(), b.value(), c.value(), d.value()];
        T::Lanes::add_to_quads(&mut self.values, at, values);
        if T::DUAL {
            let tangents = [a.output(), b.output(), c.output(), d.output()];
            T::Lanes::add_to_quads(&mut self.tangents, at, tangents);
        }
    }

    /// Quad `quad` of vector `k` of the pixels.
    #[inline(always)]
    pub(super) fn vector<T>(&self, quad: usize, k: usize) -> [T; QUAD]
    where
        T: Real,
        T::Lanes: Lanes<Float = F>,
    {
        self.groups(quad, [(k * LANES) as u32, (k * LANES + GROUP) as u32])
    }

    /// Sets vector `k` of the pixels, which are 0, in the first quad.
    #[inline(always)]
    pub(super) fn set<T>(&mut self, k: usize, numbers: [T; QUAD])
    where
        T: Real,
        T::Lanes: Lanes<Float = F>,
    {
        self.add(0, [(k * LANES) as u32, (k * LANES + GROUP) as u32], numbers);
    }
}
