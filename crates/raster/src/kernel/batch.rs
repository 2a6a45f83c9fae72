//! Pixels against one face, as a structure of arrays.
//!
//! The pixels of a face's rows are lined up so that every loop here runs over contiguous numbers
//! with no branch: the compiler turns each into vector code for the instruction set in force.

use super::{
    face::Face,
    pair::closest,
    real::{Float, Real},
    table::Lookup,
};

/// Pixels computed together: one vector of f32 on most machines. The inner loops over them have
/// this constant length, which the compiler turns into straight vector code.
pub(crate) const LANES: usize = 8;
/// Most pixels in a batch, in units of [`LANES`].
const CHUNKS: usize = 16;
/// Neighbours of a row that always come together. A row that is not a multiple as long takes a few
/// pixels more, which are as good as the others: rows are padded to hold them, and no lane needs a
/// mask or an address of its own.
pub(crate) const GROUP: usize = 4;
/// Batches are filled up to whole chunks with pixels that stand here, in NDC: beyond every image
/// and support, finite when squared in f32.
const NOWHERE: f64 = 1e15;

/// Largest rate at which a place in a cell moves with the squared distance, in NDC⁻². Reached only
/// next to the edge under a softness narrower than f32 can tell from a step.
const STEEPEST: f64 = 1e30;

type Chunk<N> = [N; LANES];

/// Pixels waiting for one face. Reused from face to face.
pub(crate) struct Batch<T: Real> {
    len: usize,
    /// Position of the first pixel of each group in the band.
    at: [u32; CHUNKS * LANES / GROUP],
    px: [Chunk<T::Float>; CHUNKS],
    py: [Chunk<T::Float>; CHUNKS],
    /// What the pixels give to the gradient.
    upstream: [Chunk<T::Float>; CHUNKS],
    /// From the closest point to the pixel.
    dx: [Chunk<T>; CHUNKS],
    dy: [Chunk<T>; CHUNKS],
    /// Barycentric weights of the closest point.
    weights: [[Chunk<T>; 3]; CHUNKS],
    /// Row of the table.
    row: [Chunk<u32>; CHUNKS],
    /// Place within the cell, in [0, 1], and its derivative by the squared distance.
    t: [Chunk<T>; CHUNKS],
    rate: [Chunk<T::Float>; CHUNKS],
    /// Coefficients of the cells, pixel by pixel and then coefficient by coefficient.
    fetched: [Chunk<[T; 4]>; CHUNKS],
    cubics: [[Chunk<T>; 4]; CHUNKS],
    /// The profile without its tail.
    values: [Chunk<T>; CHUNKS],
}

impl<T: Real> Batch<T> {
    pub(crate) fn new() -> Self {
        Self {
            len: 0,
            at: [0; CHUNKS * LANES / GROUP],
            px: [[T::Float::ZERO; LANES]; CHUNKS],
            py: [[T::Float::ZERO; LANES]; CHUNKS],
            upstream: [[T::Float::ZERO; LANES]; CHUNKS],
            dx: [[T::ZERO; LANES]; CHUNKS],
            dy: [[T::ZERO; LANES]; CHUNKS],
            weights: [[[T::ZERO; LANES]; 3]; CHUNKS],
            row: [[0; LANES]; CHUNKS],
            t: [[T::ZERO; LANES]; CHUNKS],
            rate: [[T::Float::ZERO; LANES]; CHUNKS],
            fetched: [[[T::ZERO; 4]; LANES]; CHUNKS],
            cubics: [[[T::ZERO; LANES]; 4]; CHUNKS],
            values: [[T::ZERO; LANES]; CHUNKS],
        }
    }

    /// Adds a group of pixels. `centres` starts with their x; `at` is the position of the first in
    /// the band, to which `upstream` (if the gradient is wanted) belongs.
    #[inline(always)]
    pub(crate) fn push<const GRADIENT: bool>(
        &mut self,
        centres: &[T::Float],
        py: T::Float,
        at: usize,
        upstream: &[T::Float],
    ) {
        let range = self.len..self.len + GROUP;
        self.px.as_flattened_mut()[range.clone()].copy_from_slice(&centres[..GROUP]);
        self.py.as_flattened_mut()[range.clone()].copy_from_slice(&[py; GROUP]);
        if GRADIENT {
            let group = &upstream[at..at + GROUP];
            self.upstream.as_flattened_mut()[range].copy_from_slice(group);
        }
        self.at[self.len / GROUP] = at as u32;
        self.len += GROUP;
    }

    /// Whether there is no room for another group.
    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.len == CHUNKS * LANES
    }

    /// Whether no pixel waits.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Forgets the pixels.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    #[inline(always)]
    fn chunks(&self) -> usize {
        self.len.div_ceil(LANES)
    }

    /// Closest points of the waiting pixels and their places in the profile table; `GRADIENT`
    /// keeps what the gradient needs of them.
    #[inline(always)]
    pub(crate) fn places<const GRADIENT: bool>(
        &mut self,
        face: &Face<T>,
        lookup: &Lookup<T::Float>,
    ) {
        if lookup.has_far_cells() {
            self.places_in::<GRADIENT, true>(face, lookup);
        } else {
            self.places_in::<GRADIENT, false>(face, lookup);
        }
    }

    #[inline(always)]
    fn places_in<const GRADIENT: bool, const FAR: bool>(
        &mut self,
        face: &Face<T>,
        lookup: &Lookup<T::Float>,
    ) {
        // Fills up the last chunk.
        let rest = self.len..self.chunks() * LANES;
        self.px.as_flattened_mut()[rest.clone()].fill(T::Float::from_f64(NOWHERE));
        self.py.as_flattened_mut()[rest.clone()].fill(T::Float::from_f64(NOWHERE));
        self.upstream.as_flattened_mut()[rest].fill(T::Float::ZERO);
        for c in 0..self.chunks() {
            for i in 0..LANES {
                let point = closest(face, self.px[c][i], self.py[c][i]);
                let inside = point.inside >= T::Float::ZERO;
                let inverse = lookup.inverse(inside);
                let y = point.distance2.scale(inverse);
                let place = lookup.place::<FAR>(y.value(), inside);
                self.row[c][i] = place.row;
                // In the tail the cubic is constant; a place of 0 keeps overflow out of it.
                let start = T::constant(place.start);
                let along = if FAR && place.far { start - (T::ONE - y) } else { y - start };
                let t = along.scale(place.rate);
                self.t[c][i] = if y.value() < T::Float::ONE { t } else { T::ZERO };
                if GRADIENT {
                    let rate = place.rate * inverse;
                    let steepest = T::Float::from_f64(STEEPEST);
                    self.rate[c][i] = if rate < steepest { rate } else { steepest };
                    self.dx[c][i] = point.dx;
                    self.dy[c][i] = point.dy;
                    self.weights[c][0][i] = point.weights[0];
                    self.weights[c][1][i] = point.weights[1];
                    self.weights[c][2][i] = point.weights[2];
                }
            }
        }
    }

    /// Fetches the cubics of the cells.
    #[inline(always)]
    pub(crate) fn fetch(&mut self, table: &[[T; 4]]) {
        let padded = self.chunks() * LANES;
        let rows = &self.row.as_flattened()[..padded];
        for (cubic, &row) in self.fetched.as_flattened_mut().iter_mut().zip(rows) {
            *cubic = table[row as usize];
        }
        // A loop of its own: all four columns are turned at once, in vectors.
        let chunks = self.chunks();
        for (columns, rows) in self.cubics.iter_mut().zip(&self.fetched).take(chunks) {
            for i in 0..LANES {
                columns[0][i] = rows[i][0];
                columns[1][i] = rows[i][1];
                columns[2][i] = rows[i][2];
                columns[3][i] = rows[i][3];
            }
        }
    }

    /// Adds `profile - tail` to the pixels of the band.
    #[inline(always)]
    pub(crate) fn add_values(&mut self, image: &mut [T], tail: T) {
        for chunk in 0..self.chunks() {
            let ([a, b, c, d], t) = (&self.cubics[chunk], &self.t[chunk]);
            let values = &mut self.values[chunk];
            for i in 0..LANES {
                values[i] = a[i] + t[i] * (b[i] + t[i] * (c[i] + t[i] * d[i])) - tail;
            }
        }
        let values = self.values.as_flattened().chunks_exact(GROUP);
        for (at, values) in self.at[..self.len / GROUP].iter().zip(values) {
            let pixels = &mut image[*at as usize..*at as usize + GROUP];
            for i in 0..GROUP {
                pixels[i] += values[i];
            }
        }
    }

    /// Adds the gradient to x and y of the three corners, without its factor -2.
    #[inline(always)]
    pub(crate) fn add_corners(&self, sums: &mut [T; 6]) {
        let two = T::Float::from_f64(2.0);
        let three = T::Float::from_f64(3.0);
        let mut lanes = [[T::ZERO; LANES]; 6];
        for chunk in 0..self.chunks() {
            let ([_, b, c, d], weights) = (&self.cubics[chunk], &self.weights[chunk]);
            for i in 0..LANES {
                let t = self.t[chunk][i];
                let slope = b[i] + t * (c[i].scale(two) + t * d[i].scale(three));
                let pull = slope.scale(self.rate[chunk][i] * self.upstream[chunk][i]);
                let (x, y) = (pull * self.dx[chunk][i], pull * self.dy[chunk][i]);
                lanes[0][i] += x * weights[0][i];
                lanes[1][i] += y * weights[0][i];
                lanes[2][i] += x * weights[1][i];
                lanes[3][i] += y * weights[1][i];
                lanes[4][i] += x * weights[2][i];
                lanes[5][i] += y * weights[2][i];
            }
        }
        for (sum, lanes) in sums.iter_mut().zip(lanes) {
            *sum += tree_sum(lanes);
        }
    }

    /// Adds the gradient to the coefficients of the cells, and the sum of `upstream` to `visited`.
    #[inline(always)]
    pub(crate) fn add_table(&self, table: &mut [[T; 4]], visited: &mut T::Float) {
        let (row, t) = (&self.row.as_flattened()[..self.len], self.t.as_flattened());
        for ((row, &t), &g) in row.iter().zip(t).zip(self.upstream.as_flattened()) {
            let mut power = T::constant(g);
            for coefficient in &mut table[*row as usize] {
                *coefficient += power;
                power = power * t;
            }
            *visited += g;
        }
    }
}

/// Sum in a fixed order that vectorises.
#[inline(always)]
fn tree_sum<T: Real>(mut lanes: Chunk<T>) -> T {
    let mut width = LANES / 2;
    while width > 0 {
        for i in 0..width {
            let other = lanes[i + width];
            lanes[i] += other;
        }
        width /= 2;
    }
    lanes[0]
}
