//! One walk over the pixel-face pairs of a band, for the image, its gradient or both.

use super::{
    float::Float as _,
    lanes::{GROUP, LANES, Lanes, Places},
    list::{Chunk, LISTED, List},
    pair::closest,
    real::{Float, Real, Table, splat},
    scene::{Place, Scene},
    table::Place as Cell,
};

/// Chunks by which adding up follows geometry: while one waits for the table, the arithmetic of the
/// other goes on.
const BEHIND: usize = 4;
/// Chunks between the two, and room for more: a power of two.
const RING: usize = 8;

/// Chunks whose gradients are added up lane by lane: fewer terms in a row keep more digits.
const TOGETHER: usize = 16;

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
    for (k, numbers) in place.view.faces(place.band).chunks(LISTED).enumerate() {
        list.fill(scene, &place, numbers);
        let slivers = list.faces.iter().any(|faces| faces.slivers);
        match (scene.lookup.has_far_cells(), slivers) {
            (false, false) => {
                walker.take::<IMAGE, GRADIENT, TABLE, false, false>(&list, k * LISTED)
            }
            (false, true) => walker.take::<IMAGE, GRADIENT, TABLE, false, true>(&list, k * LISTED),
            (true, _) => walker.take::<IMAGE, GRADIENT, TABLE, true, true>(&list, k * LISTED),
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
            dx: [zero; RING],
            dy: [zero; RING],
            weights: [[zero; 3]; RING],
            t: [zero; RING],
            row: [Places::FIRST; RING],
            rate: [splat(0.0); RING],
        };
        let mut sums = [splat::<T::Lanes>(0.0); 6];
        let mut face = usize::MAX;
        let (chunks, owners) = list.chunks();
        for ahead in 0..chunks.len() + BEHIND {
            if ahead < chunks.len() {
                let owner = owners[ahead] as usize;
                self.geometry::<GRADIENT, FAR, SLIVERS>(
                    &mut ring,
                    ahead % RING,
                    list,
                    owner,
                    &chunks[ahead],
                );
            }
            if ahead < BEHIND {
                continue;
            }
            let (chunk, owner) = (&chunks[ahead - BEHIND], owners[ahead - BEHIND] as usize);
            let slot = (ahead - BEHIND) % RING;
            if GRADIENT && (owner != face || ahead % TOGETHER == 0) {
                self.corners(list, first, face, &sums);
                face = owner;
                sums = [splat(0.0); 6];
            }
            let cubic = T::rows(self.table, &ring.row[slot]);
            if IMAGE {
                self.value(&ring, slot, cubic, chunk);
            }
            if GRADIENT {
                self.pull::<TABLE>(&ring, slot, cubic, chunk, &mut sums);
            }
        }
        if GRADIENT {
            self.corners(list, first, face, &sums);
        }
    }

    /// Closest points of a chunk and their places in the table; `GRADIENT` keeps what the gradient
    /// needs of them.
    #[inline(always)]
    fn geometry<const GRADIENT: bool, const FAR: bool, const SLIVERS: bool>(
        &self,
        ring: &mut Ring<T>,
        slot: usize,
        list: &List<T>,
        owner: usize,
        [low, high]: &Chunk<Float<T>>,
    ) {
        let face = list.faces[owner / LANES].face(owner % LANES);
        let centres = |column: u32| self.scene.centres(column);
        let px = T::Lanes::of_groups(centres(low.column), centres(high.column));
        let py = T::Lanes::of_halves(low.y, high.y);
        let point = closest::<T, SLIVERS>(&face, px, py);
        let Cell { row, t, rate } =
            self.scene.lookup.place::<T, FAR>(point.distance2, point.inside);
        ring.row[slot] = T::Lanes::places(row, self.table.values.len());
        ring.t[slot] = t;
        if GRADIENT {
            (ring.dx[slot], ring.dy[slot]) = (point.dx, point.dy);
            (ring.weights[slot], ring.rate[slot]) = (point.weights, rate);
        }
    }

    /// Adds `profile - tail` to the pixels of a chunk.
    #[inline(always)]
    fn value(
        &mut self,
        ring: &Ring<T>,
        slot: usize,
        [a, b, c, d]: [T; 4],
        [low, high]: &Chunk<Float<T>>,
    ) {
        let t = ring.t[slot];
        let value = a + t * (b + t * (c + t * d)) - self.tail;
        value.output().add_to_groups(self.image, [low.at, high.at]);
    }

    /// Adds to the gradient of a face, without its factor -2, and to that of the table.
    #[inline(always)]
    fn pull<const TABLE: bool>(
        &mut self,
        ring: &Ring<T>,
        slot: usize,
        [_, b, c, d]: [T; 4],
        [low, high]: &Chunk<Float<T>>,
        sums: &mut [T::Lanes; 6],
    ) {
        let upstream = T::Lanes::of_groups(self.group(low.at), self.group(high.at));
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

    #[inline(always)]
    fn group(&self, at: u32) -> &[Float<T>; GROUP] {
        self.upstream[at as usize..at as usize + GROUP].try_into().expect("a group of pixels")
    }

    /// Adds to the gradient of a face.
    #[inline(always)]
    fn corners(&mut self, list: &List<T>, first: usize, face: usize, sums: &[T::Lanes; 6]) {
        if face == usize::MAX {
            return;
        }
        let order = list.faces[face / LANES].corners(face % LANES);
        let corners = &mut self.gradient.corners[first + face];
        let factor = Float::<T>::from_f64(-2.0);
        for k in 0..3 {
            corners[2 * order[k]] += sums[2 * k].sum() * factor;
            corners[2 * order[k] + 1] += sums[2 * k + 1].sum() * factor;
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
                    if super::lanes::has_avx2() {
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
