//! The walk over the pixel-face pairs of a band. Silhouettes, their gradients and their losses are its visitors.

use super::{
    face::Face,
    lanes::{Lanes, Places, Work, run},
    list::{AHEAD, Chunk, LISTED, List, of_pixels},
    pair::{CornerSums, closest},
    real::{Float, Real, splat},
    scene::{BandRef, Scene},
    table::TablePosition as Cell,
};

/// Capacity for chunks whose geometry is known: a power of two. Visits follow [`AHEAD`] chunks behind, so that arithmetic overlaps the
/// latency of table look-ups.
const RING: usize = 8;

/// Chunks whose gradients are accumulated per lane: shorter sums keep more digits.
pub(crate) const TOGETHER: usize = 16;

/// A face and eight pixels.
pub(crate) struct Pair<T: Real> {
    /// Positions of the two groups of pixels in the band.
    pub(crate) at: [u32; 2],
    /// Number of the face in the band.
    pub(crate) face: usize,
    /// Offset from the closest point to the pixel.
    pub(crate) offset: [T; 2],
    /// Weights of the closest point on the second and the third corner.
    pub(crate) weights: [T; 2],
    /// Position in the cell of the table, its derivative with respect to the squared distance, the row of the cell, and its cubic.
    pub(crate) t: T,
    pub(crate) rate: T::Lanes,
    pub(crate) row: Places,
    pub(crate) cubic: [T; 4],
}

impl<T: Real> Pair<T> {
    /// The value of the profile.
    #[inline(always)]
    pub(crate) fn value(&self) -> T {
        let [a, b, c, d] = self.cubic;
        a + self.t * (b + self.t * (c + self.t * d))
    }

    /// The derivative of the profile with respect to the squared distance, times a factor that depends on no input.
    #[inline(always)]
    pub(crate) fn slope(&self, factor: T::Lanes) -> T {
        let [_, b, c, d] = self.cubic;
        let by_place = b + self.t * (c.scale(splat(2.0)) + self.t * d.scale(splat(3.0)));
        by_place.scale(self.rate * factor)
    }
}

/// An operation on the pairs of a band.
pub(crate) trait Visitor<T: Real> {
    /// Whether the visitor uses offsets, weights, rates and faces; if not, the walk sets the numbers to 0 and calls no [`Visitor::face`].
    const MOVES: bool;

    /// Whether the chunks of this list are visited; if not, the walk ends before it.
    #[inline(always)]
    fn begins(&mut self, list: &List<T>) -> bool {
        let _ = list;
        true
    }

    /// Visits a pair. Pairs of a face are consecutive.
    fn pair(&mut self, pair: &Pair<T>);

    /// Called after all pairs of a face, or up to [`TOGETHER`] of them; `number` is that of the face in the band.
    #[inline(always)]
    fn face(&mut self, number: usize, face: Face<T>) {
        let _ = (number, face);
    }
}

/// Two visitors, one after the other.
impl<T: Real, A: Visitor<T>, B: Visitor<T>> Visitor<T> for (A, B) {
    const MOVES: bool = A::MOVES || B::MOVES;

    #[inline(always)]
    fn pair(&mut self, pair: &Pair<T>) {
        self.0.pair(pair);
        self.1.pair(pair);
    }

    #[inline(always)]
    fn face(&mut self, number: usize, face: Face<T>) {
        self.0.face(number, face);
        self.1.face(number, face);
    }
}

/// Walks over the pairs of a band; returns the number of lists of faces visited, counted from the first of the band.
pub(crate) fn walk<T: Real>(
    scene: &Scene<T>,
    place: BandRef<T>,
    visitor: &mut impl Visitor<T>,
) -> usize {
    run::<T::Lanes, _>(Walk { scene, place, visitor })
}

/// A [`walk`], compiled for the vectors at hand.
struct Walk<'a, 's, T: Real, V> {
    scene: &'a Scene<'s, T>,
    place: BandRef<'a, T>,
    visitor: &'a mut V,
}

impl<T: Real, V: Visitor<T>> Work for Walk<'_, '_, T, V> {
    type Output = usize;

    #[inline(always)]
    fn run(mut self) -> usize {
        let mut list = List::new();
        let mut visited = self.place.first_list;
        let lists = self.place.numbers.chunks(LISTED);
        for numbers in lists.skip(self.place.first_list) {
            list.fill(self.scene, &self.place, numbers);
            if !self.visitor.begins(&list) {
                break;
            }
            let first = visited * LISTED;
            match (self.scene.lookup.has_far_cells(), list.slivers) {
                (false, false) => self.take::<false, false>(&list, first),
                (false, true) => self.take::<false, true>(&list, first),
                (true, _) => self.take::<true, true>(&list, first),
            }
            visited += 1;
        }
        visited
    }
}

/// Chunks whose geometry is known: closest points, their weights, and their positions in the table.
struct Ring<T: Real> {
    at: [[u32; 2]; RING],
    owner: [usize; RING],
    offset: [[T; 2]; RING],
    weights: [[T; 2]; RING],
    t: [T; RING],
    row: [Places; RING],
    rate: [T::Lanes; RING],
}

impl<T: Real, V: Visitor<T>> Walk<'_, '_, T, V> {
    /// Walks over the chunks of a list, whose first face is number `first` of the band.
    #[inline(always)]
    fn take<const FAR: bool, const SLIVERS: bool>(&mut self, list: &List<T>, first: usize) {
        // Copies that nothing can write to; otherwise they would be read again for each chunk, since visitors write.
        let (lookup, table) = (self.scene.lookup, self.place.table);
        let zero = T::constant(splat(0.0));
        let mut ring = Ring {
            at: [[0; 2]; RING],
            owner: [0; RING],
            offset: [[zero; 2]; RING],
            weights: [[zero; 2]; RING],
            t: [zero; RING],
            row: [Places::FIRST; RING],
            rate: [splat(0.0); RING],
        };
        let mut last = None;
        for (ahead, Chunk { places, at, owner }) in list.chunks(AHEAD).enumerate() {
            let slot = ahead % RING;
            (ring.at[slot], ring.owner[slot]) = (at, owner);
            let (px, py) = T::Lanes::pixels(places);
            let point = closest::<T, SLIVERS>(list.face(owner), px, py);
            let Cell { row, t, rate } = lookup.place::<T, FAR>(point.distance2, point.inside);
            (ring.row[slot], ring.t[slot]) = (row, t);
            if V::MOVES {
                let [_, second, third] = point.weights;
                (ring.offset[slot], ring.weights[slot]) = ([point.dx, point.dy], [second, third]);
                ring.rate[slot] = rate;
            }
            if ahead < AHEAD {
                continue;
            }
            let slot = (ahead - AHEAD) % RING;
            let owner = ring.owner[slot];
            if V::MOVES
                && let Some(face) = last
                && (face != owner || ahead % TOGETHER == 0)
            {
                self.visitor.face(first + face, list.face(face));
            }
            last = Some(owner);
            let (offset, weights, rate) = match V::MOVES {
                true => (ring.offset[slot], ring.weights[slot], ring.rate[slot]),
                false => ([zero; 2], [zero; 2], splat(0.0)),
            };
            self.visitor.pair(&Pair {
                at: ring.at[slot],
                face: first + owner,
                offset,
                weights,
                t: ring.t[slot],
                rate,
                row: ring.row[slot],
                cubic: T::rows(table, &ring.row[slot]),
            });
        }
        if V::MOVES
            && let Some(face) = last
        {
            self.visitor.face(first + face, list.face(face));
        }
    }
}

/// Adds `profile - tail` to the pixels of a band, `[rows, stride]` and one group more.
pub(crate) struct Image<'a, T: Real> {
    pub(crate) image: &'a mut [Float<T>],
    pub(crate) tail: T,
}

impl<T: Real> Visitor<T> for Image<'_, T> {
    const MOVES: bool = false;

    #[inline(always)]
    fn pair(&mut self, pair: &Pair<T>) {
        (pair.value() - self.tail).output().add_to_groups(self.image, pair.at);
    }
}

/// Adds the gradient of `Σ upstream S` with respect to x and y of the corners of each face of a band.
pub(crate) struct Gradient<'a, T: Real> {
    upstream: &'a [Float<T>],
    half: f64,
    corners: &'a mut [[Float<T>; 6]],
    sums: CornerSums<T::Lanes>,
}

impl<'a, T: Real> Gradient<'a, T> {
    pub(crate) fn new(
        scene: &Scene<T>,
        upstream: &'a [Float<T>],
        corners: &'a mut [[Float<T>; 6]],
    ) -> Self {
        Self { upstream, half: scene.half, corners, sums: CornerSums::nothing() }
    }
}

impl<T: Real> Visitor<T> for Gradient<'_, T> {
    const MOVES: bool = true;

    #[inline(always)]
    fn pair(&mut self, pair: &Pair<T>) {
        let pull = pair.slope(of_pixels::<T>(self.upstream, pair.at));
        let [x, y] = pair.offset;
        self.sums.add([pull * x, pull * y], pair.weights);
    }

    #[inline(always)]
    fn face(&mut self, number: usize, face: Face<T>) {
        self.sums.flush(face.corners(), self.half, &mut self.corners[number]);
    }
}

/// Adds the gradient of `Σ upstream S` with respect to the rows of the table.
pub(crate) struct TableGradient<'a, T: Real> {
    upstream: &'a [Float<T>],
    rows: &'a mut [[Float<T>; 4]],
    /// Sums of `upstream` over the pairs, each of which replaces a tail.
    visited: T::Lanes,
}

impl<'a, T: Real> TableGradient<'a, T> {
    pub(crate) fn new(upstream: &'a [Float<T>], rows: &'a mut [[Float<T>; 4]]) -> Self {
        Self { upstream, rows, visited: splat(0.0) }
    }

    /// Subtracts the tails that pairs have replaced from row `tail`.
    pub(crate) fn finish(self, tail: usize) {
        self.rows[tail][0] += -self.visited.sum();
    }
}

impl<T: Real> Visitor<T> for TableGradient<'_, T> {
    const MOVES: bool = false;

    #[inline(always)]
    fn pair(&mut self, pair: &Pair<T>) {
        let one = T::constant(of_pixels::<T>(self.upstream, pair.at));
        let t = pair.t;
        let (first, second) = (one * t, one * t * t);
        let powers = [one, first, second, second * t];
        let columns =
            [powers[0].output(), powers[1].output(), powers[2].output(), powers[3].output()];
        T::Lanes::add_to_rows(self.rows, &pair.row, columns);
        self.visited += one.output();
    }
}
