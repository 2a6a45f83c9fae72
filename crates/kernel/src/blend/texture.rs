//! A texture, sampled bilinearly at points of faces.

use crate::{
    float::Float as _,
    lanes::{LANES, Lanes, Places, lanes},
    real::{Float, Real, Table, splat},
};

/// Numbers of a texel in memory; a texture may have fewer channels.
pub const TEXEL_CHANNELS: usize = 4;

/// Texels per allocation of a gradient.
const RUN: usize = 64;

/// Texels in row-major order, the top row first.
pub(super) struct Texture<'a, T: Real> {
    /// Rows and columns.
    pub(super) size: [usize; 2],
    pub(super) texels: Table<'a, T>,
}

/// Positions on a texture, between four texels: above left, above right, below left and below right.
pub(super) struct Sample<T: Real> {
    rows: [[u32; LANES]; 4],
    texels: [[T; TEXEL_CHANNELS]; 4],
    /// Fractions from the left to the right texels, and from the upper to the lower ones, in [0, 1].
    right: T,
    down: T,
    size: [usize; 2],
}

impl<T: Real> Texture<'_, T> {
    /// Samples the texture at `u` to the right and `v` up, from 0 to 1; it repeats beyond.
    #[inline(always)]
    pub(super) fn sample(&self, [u, v]: [T; 2]) -> Sample<T> {
        let [height, width] = self.size;
        let half = T::constant(splat(0.5));
        let x = u.scale(splat(width as f64)) - half;
        let y = (T::constant(splat(1.0)) - v).scale(splat(height as f64)) - half;
        let (left, [lefts, rights]) = around(x.value(), width);
        let (above, [aboves, belows]) = around(y.value(), height);
        let row = width as u32;
        let rows = [
            lanes!(I => aboves[I] * row + lefts[I]),
            lanes!(I => aboves[I] * row + rights[I]),
            lanes!(I => belows[I] * row + lefts[I]),
            lanes!(I => belows[I] * row + rights[I]),
        ];
        let mut texels = [[half; TEXEL_CHANNELS]; 4];
        for k in 0..4 {
            let places: Places = T::Lanes::numbered(&rows[k], height * width);
            texels[k] = T::rows(self.texels, &places);
        }
        let (right, down) = (x - T::constant(left), y - T::constant(above));
        Sample { rows, texels, right, down, size: self.size }
    }
}

/// The floor of each number, and the indices of the two texels around it, modulo `count`.
#[inline(always)]
fn around<L: Lanes>(x: L, count: usize) -> (L, [[u32; LANES]; 2]) {
    let numbers = x.array();
    let floors = lanes!(I => numbers[I].to_f64().floor());
    let last = count as i64 - 1;
    let places = lanes!(I => {
        let at = floors[I] as i64;
        if at < 0 || at > last { at.rem_euclid(count as i64) } else { at }
    });
    let next = lanes!(I => if places[I] == last { 0 } else { places[I] as u32 + 1 });
    (L::of(&lanes!(I => L::Float::from_f64(floors[I]))), [lanes!(I => places[I] as u32), next])
}

impl<T: Real> Sample<T> {
    /// The weights of the four texels.
    #[inline(always)]
    fn shares(&self) -> [T; 4] {
        let one = T::constant(splat(1.0));
        let (left, above) = (one - self.right, one - self.down);
        [left * above, self.right * above, left * self.down, self.right * self.down]
    }

    /// The interpolated channels.
    #[inline(always)]
    pub(super) fn channels(&self) -> [T; TEXEL_CHANNELS] {
        let [s0, s1, s2, s3] = self.shares();
        let [a, b, c, d] = &self.texels;
        let mut channels = [s0; TEXEL_CHANNELS];
        for k in 0..TEXEL_CHANNELS {
            channels[k] = s0 * a[k] + s1 * b[k] + s2 * c[k] + s3 * d[k];
        }
        channels
    }

    /// `Σ upstream · channels`, and its derivatives with respect to u and v.
    #[inline(always)]
    pub(super) fn pulled(&self, upstream: [T::Lanes; TEXEL_CHANNELS]) -> [T; 3] {
        let zero = T::constant(splat(0.0));
        let mut sums = [zero; 4];
        for texel in 0..4 {
            for k in 0..TEXEL_CHANNELS {
                sums[texel] = sums[texel] + self.texels[texel][k].scale(upstream[k]);
            }
        }
        let [a, b, c, d] = sums;
        let one = T::constant(splat(1.0));
        let (left, above) = (one - self.right, one - self.down);
        let by_x = (b - a) * above + (d - c) * self.down;
        let by_y = (a - c) * left + (b - d) * self.right;
        let here = (a * left + b * self.right) * above + (c * left + d * self.right) * self.down;
        let [height, width] = self.size;
        [here, by_x.scale(splat(width as f64)), by_y.scale(splat(height as f64))]
    }

    /// Adds the gradient of `share · Σ upstream · channels` to that of the texels.
    #[inline(always)]
    pub(super) fn pull_texels(
        &self,
        share: T,
        upstream: [T::Lanes; TEXEL_CHANNELS],
        gradient: &mut TexelSums<Float<T>>,
    ) {
        let shares = self.shares();
        for texel in 0..4 {
            let own = share * shares[texel];
            let mut columns = [[Float::<T>::ZERO; LANES]; TEXEL_CHANNELS];
            for k in 0..TEXEL_CHANNELS {
                columns[k] = own.scale(upstream[k]).output().array();
            }
            for i in 0..LANES {
                let [a, b, c, d] = columns;
                gradient.add(self.rows[texel][i], [a[i], b[i], c[i], d[i]]);
            }
        }
    }
}

/// A gradient of texels, allocated sparsely.
#[derive(Default)]
pub(super) struct TexelSums<F> {
    runs: Vec<Option<Box<[[F; TEXEL_CHANNELS]; RUN]>>>,
    texels: usize,
}

impl<F: crate::Float> TexelSums<F> {
    /// A gradient of `texels` texels, all 0.
    pub(super) fn new(texels: usize) -> Self {
        Self { runs: (0..texels.div_ceil(RUN)).map(|_| None).collect(), texels }
    }

    /// Adds to one texel.
    #[inline(always)]
    fn add(&mut self, texel: u32, numbers: [F; TEXEL_CHANNELS]) {
        let texel = texel as usize;
        let run = self.runs[texel / RUN]
            .get_or_insert_with(|| Box::new([[F::ZERO; TEXEL_CHANNELS]; RUN]));
        let sums = &mut run[texel % RUN];
        for k in 0..TEXEL_CHANNELS {
            sums[k] += numbers[k];
        }
    }

    /// Adds the gradient of another part of the same image.
    pub(super) fn add_all(&mut self, other: Self) {
        for (own, other) in self.runs.iter_mut().zip(other.runs) {
            let (Some(sums), Some(more)) = (&mut *own, &other) else {
                if other.is_some() {
                    *own = other;
                }
                continue;
            };
            let more = more.as_flattened();
            sums.as_flattened_mut().iter_mut().zip(more).for_each(|(sum, &more)| *sum += more);
        }
    }

    /// The gradient of all texels, `[texels, 4]`.
    pub(super) fn dense(&self) -> Vec<F> {
        let mut all = Vec::with_capacity(self.runs.len() * RUN * TEXEL_CHANNELS);
        for run in &self.runs {
            match run {
                Some(sums) => all.extend_from_slice(sums.as_flattened()),
                None => all.resize(all.len() + RUN * TEXEL_CHANNELS, F::ZERO),
            }
        }
        all.truncate(self.texels * TEXEL_CHANNELS);
        all
    }
}
