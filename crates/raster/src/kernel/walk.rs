//! One walk over the pixel-face pairs of a band, for the image, its gradient or both.

use std::ops::Range;

use super::{
    bands::View,
    face::Faces,
    float::Float as _,
    lanes::{GROUP, LANES, Lanes, Places},
    list::{Chunk, LISTED, List},
    pair::closest,
    real::{Float, Real, Table, splat},
    table::{Grid, Lookup, Place as Cell},
};
use crate::ImageSize;

/// Chunks by which adding up follows geometry: while one waits for the table, the arithmetic of the
/// other goes on.
const BEHIND: usize = 4;
/// Chunks between the two, and room for more: a power of two.
const RING: usize = 8;

/// Chunks whose gradients are added up lane by lane: fewer terms in a row keep more digits.
const TOGETHER: usize = 16;

/// Everything a traversal reads, in one number type.
pub(crate) struct Scene<'a, T: Real> {
    /// `[views, 3, vertices]`: x and y in NDC, depth.
    pub(crate) vertices: &'a [Float<T>],
    /// Their tangents, where numbers have any.
    pub(crate) tangents: &'a [Float<T>],
    pub(crate) faces: &'a [[u32; 3]],
    /// Cubic coefficients of each cell, `[1 or views, grid.rows()]`.
    pub(crate) tables: Table<'a, T>,
    pub(crate) grid: Grid,
    pub(crate) size: ImageSize,
    /// Rows of a band.
    pub(crate) rows: usize,
    pub(crate) lookup: Lookup<Float<T>>,
    /// Centres of the columns, with a group more than the image has.
    centres: Vec<Float<T>>,
    /// Centres of the rows, with a vector more.
    heights: Vec<Float<T>>,
}

/// Which band of which view.
#[derive(Clone, Copy)]
pub(crate) struct Place<'a, T: Real> {
    /// `[3, vertices]`.
    pub(crate) vertices: &'a [Float<T>],
    /// The same, or nothing.
    pub(crate) tangents: &'a [Float<T>],
    /// `[grid.rows()]`.
    pub(crate) table: Table<'a, T>,
    pub(crate) view: &'a View,
    pub(crate) band: usize,
}

impl<T: Real> Place<'_, T> {
    /// Up to [`LANES`] faces of the scene, given by their numbers, as this view sees them; the last one
    /// fills them up.
    #[inline(always)]
    pub(crate) fn faces(&self, scene: &Scene<T>, numbers: &[u32]) -> Faces<T> {
        let mut values = [[[Float::<T>::ZERO; LANES]; 3]; 2];
        let mut tangents = [[[Float::<T>::ZERO; LANES]; 3]; 2];
        let count = self.vertices.len() / 3;
        let (xs, ys) = (&self.vertices[..count], &self.vertices[count..2 * count]);
        for lane in 0..LANES {
            let face = scene.faces[numbers[lane.min(numbers.len() - 1)] as usize];
            for k in 0..3 {
                let vertex = face[k] as usize;
                (values[0][k][lane], values[1][k][lane]) = (xs[vertex], ys[vertex]);
                if T::DUAL {
                    tangents[0][k][lane] = self.tangents[vertex];
                    tangents[1][k][lane] = self.tangents[count + vertex];
                }
            }
        }
        let [x, y] = values;
        let [dx, dy] = tangents;
        let x = [lanes(&x[0], &dx[0]), lanes(&x[1], &dx[1]), lanes(&x[2], &dx[2])];
        let y = [lanes(&y[0], &dy[0]), lanes(&y[1], &dy[1]), lanes(&y[2], &dy[2])];
        let mut radii = [Float::<T>::from_f64(scene.grid.outer); LANES];
        if !self.view.radii.is_empty() {
            for lane in 0..LANES {
                let number = numbers[lane.min(numbers.len() - 1)] as usize;
                radii[lane] = Float::<T>::from_f64(f64::from(self.view.radii[number]));
            }
        }
        Faces::new(x, y, T::Lanes::of(&radii))
    }

    /// The constant outside the support.
    #[inline(always)]
    fn tail(&self, grid: &Grid) -> T {
        let tail = grid.tail();
        let tangent = if T::DUAL { self.table.tangents[tail][0] } else { Float::<T>::ZERO };
        T::new(T::Lanes::splat(self.table.values[tail][0]), T::Lanes::splat(tangent))
    }

    /// A pixel that no face reaches.
    pub(crate) fn empty(&self, grid: &Grid) -> Float<T> {
        let rows = if T::DUAL { self.table.tangents } else { self.table.values };
        rows[grid.tail()][0] * Float::<T>::from_f64(self.view.drawn as f64)
    }
}

/// Numbers with their tangents.
#[inline(always)]
fn lanes<T: Real>(values: &[Float<T>; LANES], tangents: &[Float<T>; LANES]) -> T {
    T::new(T::Lanes::of(values), T::Lanes::of(tangents))
}

/// What one band gives back.
pub(crate) struct BandGradient<F> {
    /// For each face of the band, the gradient to x and y of its three corners.
    pub(crate) corners: Vec<[F; 6]>,
    pub(crate) table: Vec<[F; 4]>,
}

impl<'a, T: Real> Scene<'a, T> {
    pub(crate) fn new(
        vertices: [&'a [Float<T>]; 2],
        faces: &'a [[u32; 3]],
        tables: Table<'a, T>,
        grid: Grid,
        size: ImageSize,
        rows: usize,
    ) -> Self {
        let number = Float::<T>::from_f64;
        let [vertices, tangents] = vertices;
        Self {
            vertices,
            tangents,
            faces,
            tables,
            grid,
            size,
            rows,
            lookup: Lookup::new(&grid),
            centres: (0..size.width + GROUP).map(|k| number(size.column_centre(k))).collect(),
            heights: (0..size.height + LANES).map(|row| number(size.row_centre(row))).collect(),
        }
    }

    /// A band of view `index` of `views`.
    pub(crate) fn place<'b>(
        &self,
        view: &'b View,
        index: usize,
        views: usize,
        band: usize,
    ) -> Place<'b, T>
    where
        'a: 'b,
    {
        let of_view = |numbers: &'a [Float<T>]| {
            let length = numbers.len() / views;
            &numbers[index * length..(index + 1) * length]
        };
        let rows = self.grid.rows();
        let first = if self.tables.values.len() > rows { index * rows } else { 0 };
        let of_table =
            |all: &'a [[Float<T>; 4]]| &all[first.min(all.len())..(first + rows).min(all.len())];
        let table = Table {
            values: of_table(self.tables.values),
            tangents: of_table(self.tables.tangents),
        };
        let [vertices, tangents] = [self.vertices, self.tangents].map(of_view);
        Place { vertices, tangents, table, view, band }
    }

    /// Length of a row of a band: that of the image, and a group for what reaches beyond.
    pub(crate) fn stride(&self) -> usize {
        self.size.width + GROUP
    }

    /// Numbers of a band: its rows, and a group for pixels on which nothing depends.
    pub(crate) fn band_length(&self, band: usize) -> usize {
        self.band_rows(band).len() * self.stride() + GROUP
    }

    /// Rows of the image that band `band` holds.
    pub(crate) fn band_rows(&self, band: usize) -> Range<usize> {
        band * self.rows..((band + 1) * self.rows).min(self.size.height)
    }

    /// Centres of a column and those behind it.
    #[inline(always)]
    pub(crate) fn centres(&self, column: u32) -> &[Float<T>; GROUP] {
        let group = &self.centres[column as usize..column as usize + GROUP];
        group.try_into().expect("a group of columns")
    }

    /// Centres of a row of the image and those below it.
    #[inline(always)]
    pub(crate) fn heights(&self, row: usize) -> &[Float<T>; LANES] {
        self.heights[row..row + LANES].try_into().expect("as many heights as lanes")
    }
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

/// Lets tests walk as on a machine without AVX2.
#[cfg(test)]
pub(crate) static PORTABLE: std::sync::atomic::AtomicBool =
    std::sync::atomic::AtomicBool::new(false);

/// Whether this machine has AVX2.
pub(crate) fn has_avx2() -> bool {
    #[cfg(test)]
    if PORTABLE.load(std::sync::atomic::Ordering::SeqCst) {
        return false;
    }
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2");
    #[cfg(not(target_arch = "x86_64"))]
    false
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
                    if has_avx2() {
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
