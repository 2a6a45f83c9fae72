//! One walk over the pixel-face pairs of a band, for the image, its gradient or both.

use super::{
    float::Float as _,
    lanes::{Lanes, Places},
    list::{AHEAD, Chunk, LISTED, List, group},
    pair::closest,
    real::{Float, Real, Table, splat},
    scene::{Place, Scene},
    table::Place as Cell,
};

/// Room for chunks whose geometry is known: a power of two. Adding up follows [`AHEAD`] chunks behind: while one waits for the table, the
/// arithmetic of the other goes on.
pub(crate) const RING: usize = 8;

/// Chunks whose gradients are added up lane by lane: fewer terms in a row keep more digits.
pub(crate) const TOGETHER: usize = 16;

/// What one band gives back.
pub(crate) struct BandGradient<F> {
    /// For each face of the band, the gradient to x and y of its three corners.
    pub(crate) corners: Vec<[F; 6]>,
    pub(crate) table: Vec<[F; 4]>,
}

/// One walk over the pairs of a band. `upstream` and `image` are `[rows, stride]` and a group more.
#[inline(always)]
fn walk<T: Real, const IMAGE: bool, const GRADIENT: bool, const TABLE: bool>(
    scene: &Scene<T>,
    place: Place<T>,
    upstream: &[Float<T>],
    image: &mut [Float<T>],
    gradient: &mut BandGradient<Float<T>>,
) {
    let mut list = List::new();
    let mut walker = Walker {
        scene,
        table: place.table,
        upstream,
        image,
        gradient,
        visited: splat(0.0),
        tail: place.tail(&scene.grid),
    };
    let lists = place.view.faces(place.band).chunks(LISTED).enumerate();
    for (k, numbers) in lists.skip(place.first_list) {
        list.fill(scene, &place, numbers);
        let first = k * LISTED;
        match (scene.lookup.has_far_cells(), list.slivers) {
            (false, false) => walker.take::<IMAGE, GRADIENT, TABLE, false, false>(&list, first),
            (false, true) => walker.take::<IMAGE, GRADIENT, TABLE, false, true>(&list, first),
            (true, _) => walker.take::<IMAGE, GRADIENT, TABLE, true, true>(&list, first),
        }
    }
    if TABLE {
        let visited = walker.visited.sum();
        gradient.table[scene.grid.tail()][0] += -visited;
    }
}

/// Where the pairs of a band go.
struct Walker<'a, 's, T: Real> {
    scene: &'a Scene<'s, T>,
    table: Table<'a, T>,
    upstream: &'a [Float<T>],
    image: &'a mut [Float<T>],
    gradient: &'a mut BandGradient<Float<T>>,
    /// Sums of `upstream` over the pairs, each of which replaced a tail.
    visited: T::Lanes,
    tail: T,
}

/// Chunks whose geometry is known: closest points, their weights, and their places in the table.
struct Ring<T: Real> {
    at: [[u32; 2]; RING],
    owner: [usize; RING],
    dx: [T; RING],
    dy: [T; RING],
    weights: [[T; 3]; RING],
    t: [T; RING],
    row: [Places; RING],
    rate: [T::Lanes; RING],
}

impl<T: Real> Walker<'_, '_, T> {
    /// Takes the chunks of a list, whose first face is number `first` of the band.
    #[inline(always)]
    fn take<
        const IMAGE: bool,
        const GRADIENT: bool,
        const TABLE: bool,
        const FAR: bool,
        const SLIVERS: bool,
    >(
        &mut self,
        list: &List<T>,
        first: usize,
    ) {
        let zero = T::constant(splat(0.0));
        let mut ring = Ring {
            at: [[0; 2]; RING],
            owner: [0; RING],
            dx: [zero; RING],
            dy: [zero; RING],
            weights: [[zero; 3]; RING],
            t: [zero; RING],
            row: [Places::FIRST; RING],
            rate: [splat(0.0); RING],
        };
        let mut sums = [splat::<T::Lanes>(0.0); 6];
        let mut face = usize::MAX;
        for (ahead, Chunk { places, at, owner }) in list.chunks(AHEAD).enumerate() {
            let slot = ahead % RING;
            (ring.at[slot], ring.owner[slot]) = (at, owner);
            let (px, py) = T::Lanes::pixels(places);
            let point = closest::<T, SLIVERS>(list.face(owner), px, py);
            let Cell { row, t, rate } =
                self.scene.lookup.place::<T, FAR>(point.distance2, point.inside);
            (ring.row[slot], ring.t[slot]) = (row, t);
            if GRADIENT {
                (ring.dx[slot], ring.dy[slot]) = (point.dx, point.dy);
                (ring.weights[slot], ring.rate[slot]) = (point.weights, rate);
            }
            if ahead < AHEAD {
                continue;
            }
            let slot = (ahead - AHEAD) % RING;
            let (at, owner) = (ring.at[slot], ring.owner[slot]);
            if GRADIENT && (owner != face || ahead % TOGETHER == 0) {
                self.corners(list, first, face, &sums);
                face = owner;
                sums = [splat(0.0); 6];
            }
            let cubic = T::rows(self.table, &ring.row[slot]);
            if IMAGE {
                self.value(&ring, slot, cubic, at);
            }
            if GRADIENT {
                self.pull::<TABLE>(&ring, slot, cubic, at, &mut sums);
            }
        }
        if GRADIENT {
            self.corners(list, first, face, &sums);
        }
    }

    /// Adds `profile - tail` to the pixels of a chunk.
    #[inline(always)]
    fn value(&mut self, ring: &Ring<T>, slot: usize, [a, b, c, d]: [T; 4], at: [u32; 2]) {
        let t = ring.t[slot];
        let value = a + t * (b + t * (c + t * d)) - self.tail;
        value.output().add_to_groups(self.image, at);
    }

    /// Adds to the gradient of a face, without its factor -2, and to that of the table.
    #[inline(always)]
    fn pull<const TABLE: bool>(
        &mut self,
        ring: &Ring<T>,
        slot: usize,
        [_, b, c, d]: [T; 4],
        [low, high]: [u32; 2],
        sums: &mut [T::Lanes; 6],
    ) {
        let upstream = T::Lanes::of_groups(group(self.upstream, low), group(self.upstream, high));
        let t = ring.t[slot];
        let slope = b + t * (c.scale(splat(2.0)) + t * d.scale(splat(3.0)));
        let pull = slope.scale(ring.rate[slot] * upstream);
        let (x, y) = (pull * ring.dx[slot], pull * ring.dy[slot]);
        let [w0, w1, w2] = ring.weights[slot];
        sums[0] += (x * w0).output();
        sums[1] += (y * w0).output();
        sums[2] += (x * w1).output();
        sums[3] += (y * w1).output();
        sums[4] += (x * w2).output();
        sums[5] += (y * w2).output();
        if TABLE {
            let one = T::constant(upstream);
            let (first, second) = (one * t, one * t * t);
            let powers = [one, first, second, second * t];
            let columns =
                [powers[0].output(), powers[1].output(), powers[2].output(), powers[3].output()];
            T::Lanes::add_to_rows(&mut self.gradient.table, &ring.row[slot], columns);
            self.visited += one.output();
        }
    }

    /// Adds to the gradient of a face.
    #[inline(always)]
    fn corners(&mut self, list: &List<T>, first: usize, face: usize, sums: &[T::Lanes; 6]) {
        if face == usize::MAX {
            return;
        }
        let order = list.face(face).corners();
        let corners = &mut self.gradient.corners[first + face];
        // From pixels, with y down, to NDC.
        let [right, down] = [-2.0, 2.0].map(|k| Float::<T>::from_f64(k * self.scene.half));
        for k in 0..3 {
            corners[2 * order[k]] += sums[2 * k].sum() * right;
            corners[2 * order[k] + 1] += sums[2 * k + 1].sum() * down;
        }
    }
}

/// Compiles a walk for AVX2 and for what every machine has, and picks one at run time. Products and
/// sums are never contracted, so that both give the same bits.
macro_rules! dispatched {
    ($name:ident, $image:literal, $gradient:literal, $table:literal) => {
        pub(crate) fn $name<T: Real>(
            scene: &Scene<T>,
            place: Place<T>,
            upstream: &[Float<T>],
            image: &mut [Float<T>],
            gradient: &mut BandGradient<Float<T>>,
        ) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2<T: Real>(
                    scene: &Scene<T>,
                    place: Place<T>,
                    upstream: &[Float<T>],
                    image: &mut [Float<T>],
                    gradient: &mut BandGradient<Float<T>>,
                ) {
                    walk::<T, $image, $gradient, $table>(scene, place, upstream, image, gradient);
                }
                // Two questions, so that the compiler leaves out what no machine asks for.
                if T::Lanes::NEEDS_AVX2 {
                    // SAFETY: the feature was detected before there were such vectors.
                    #[allow(unsafe_code)]
                    return unsafe { avx2(scene, place, upstream, image, gradient) };
                }
                if T::Lanes::GAINS_AVX2 {
                    if super::lanes::has_vectors() {
                        // SAFETY: the feature was just detected.
                        #[allow(unsafe_code)]
                        return unsafe { avx2(scene, place, upstream, image, gradient) };
                    }
                }
            }
            walk::<T, $image, $gradient, $table>(scene, place, upstream, image, gradient);
        }
    };
}

dispatched!(walk_image, true, false, false);
dispatched!(walk_gradient, false, true, false);
dispatched!(walk_image_and_gradient, true, true, false);
dispatched!(walk_gradient_and_table, false, true, true);
dispatched!(walk_everything, true, true, true);
