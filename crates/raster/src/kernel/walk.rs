//! One walk over the pixel-face pairs of a band, for the image, its gradient or both.

use std::ops::Range;

use super::{
    bands::{ROWS, View},
    batch::{Batch, GROUP},
    face::{BLOCK, Face, Faces, Reach, SPANS, Spans, pixel_centre},
    real::{Float, Real},
    table::{Grid, Lookup},
};

/// Everything a traversal reads, in one number type.
pub(crate) struct Scene<'a, T: Real> {
    /// `[views, 3, vertices]`: x and y in NDC, depth.
    pub(crate) vertices: &'a [T],
    pub(crate) faces: &'a [[u32; 3]],
    /// Cubic coefficients of each cell, `[grid.rows()]`.
    pub(crate) table: &'a [[T; 4]],
    pub(crate) grid: Grid,
    pub(crate) size: usize,
    lookup: Lookup<T::Float>,
    /// Centres of the columns, with a group more than the image has.
    centres: Vec<T::Float>,
    /// Centres of the rows, likewise.
    heights: Vec<T::Float>,
}

/// Which band of which view.
#[derive(Clone, Copy)]
pub(crate) struct Place<'a, T> {
    /// `[3, vertices]`.
    pub(crate) vertices: &'a [T],
    pub(crate) view: &'a View,
    pub(crate) band: usize,
}

impl<T: Real> Place<'_, T> {
    /// A block of faces of the scene, given by their numbers, as this view sees them; the last one
    /// fills it up.
    #[inline(always)]
    pub(crate) fn faces(&self, scene: &Scene<T>, numbers: &[u32]) -> Faces<T> {
        let (xs, rest) = self.vertices.split_at(self.vertices.len() / 3);
        let mut corners = [[[T::ZERO; BLOCK]; 3]; 2];
        for lane in 0..BLOCK {
            let face = scene.faces[numbers[lane.min(numbers.len() - 1)] as usize];
            for k in 0..3 {
                let vertex = face[k] as usize;
                (corners[0][k][lane], corners[1][k][lane]) = (xs[vertex], rest[vertex]);
            }
        }
        let [x, y] = corners;
        Faces::new(x, y, T::Float::from_f64(scene.grid.outer))
    }
}

/// What one band gives back.
pub(crate) struct BandGradient<T: Real> {
    /// For each face of the band, the gradient to x and y of its three corners.
    pub(crate) corners: Vec<[T; 6]>,
    pub(crate) table: Vec<[T; 4]>,
}

impl<'a, T: Real> Scene<'a, T> {
    pub(crate) fn new(
        vertices: &'a [T],
        faces: &'a [[u32; 3]],
        table: &'a [[T; 4]],
        grid: Grid,
        size: usize,
    ) -> Self {
        let centre = |column| T::Float::from_f64(pixel_centre(column, size));
        Self {
            vertices,
            faces,
            table,
            grid,
            size,
            lookup: Lookup::new(&grid),
            centres: (0..size + GROUP).map(centre).collect(),
            heights: (0..size + SPANS).map(|row| -centre(row)).collect(),
        }
    }

    /// Vertices of view `index` of `views`, `[3, vertices]`.
    pub(crate) fn view(&self, index: usize, views: usize) -> &'a [T] {
        let length = self.vertices.len() / views;
        &self.vertices[index * length..(index + 1) * length]
    }

    /// Length of a row of a band: that of the image, and a group for what reaches beyond.
    pub(crate) fn stride(&self) -> usize {
        self.size + GROUP
    }

    /// Rows of the image that band `band` holds.
    pub(crate) fn band_rows(&self, band: usize) -> std::ops::Range<usize> {
        band * ROWS..((band + 1) * ROWS).min(self.size)
    }
}

/// One walk over the pairs of a band. `upstream` and `image` are `[rows, stride]`.
#[inline(always)]
fn walk<T: Real, const IMAGE: bool, const GRADIENT: bool, const TABLE: bool>(
    scene: &Scene<T>,
    place: Place<T>,
    upstream: &[T::Float],
    image: &mut [T],
    gradient: &mut BandGradient<T>,
) {
    let mut batch = Batch::new();
    let mut sink = Sink { image, gradient, visited: T::Float::ZERO };
    let rows = scene.band_rows(place.band);
    let listed = place.view.faces(place.band);
    for (block, numbers) in listed.chunks(BLOCK).enumerate() {
        let faces = place.faces(scene, numbers);
        for (lane, &number) in numbers.iter().enumerate() {
            let face = faces.face(lane);
            let reach = place.view.reaches[number as usize];
            let runs = Runs::new(&faces.spans(lane), reach, rows.clone(), scene);
            let sums =
                sink.visit::<IMAGE, GRADIENT, TABLE>(scene, &face, &runs, upstream, &mut batch);
            if GRADIENT {
                sink.gradient.corners[BLOCK * block + lane] = sums;
            }
        }
    }
    if TABLE {
        sink.gradient.table[scene.grid.tail()][0] += T::constant(-sink.visited);
    }
}

/// The pixels of a band that a face may reach, row by row.
pub(crate) struct Runs {
    /// Rows of the image.
    pub(crate) rows: Range<usize>,
    /// First row of the band.
    band: usize,
    starts: [[i32; SPANS]; ROWS / SPANS],
    ends: [[i32; SPANS]; ROWS / SPANS],
}

impl Runs {
    /// Those of a face with these limits among `rows`, which is a band.
    #[inline(always)]
    pub(crate) fn new<T: Real>(
        spans: &Spans<T::Float>,
        reach: Reach,
        rows: Range<usize>,
        scene: &Scene<T>,
    ) -> Self {
        let band = rows.start;
        let rows = rows.start.max(reach.top as usize)..rows.end.min(reach.bottom as usize);
        let mut runs = Self {
            rows: rows.clone(),
            band,
            starts: [[0; SPANS]; ROWS / SPANS],
            ends: [[0; SPANS]; ROWS / SPANS],
        };
        for (k, row) in rows.step_by(SPANS).enumerate() {
            let heights = scene.heights[row..row + SPANS].try_into().expect("heights are padded");
            (runs.starts[k], runs.ends[k]) = spans.columns(heights, reach, scene.size);
        }
        runs
    }

    /// First column and the one after the last in a row of `rows`; there may be none between.
    #[inline(always)]
    pub(crate) fn columns(&self, row: usize) -> (usize, usize) {
        let k = row - self.rows.start;
        (self.starts.as_flattened()[k] as usize, self.ends.as_flattened()[k] as usize)
    }
}

/// Where the pairs of a band go.
struct Sink<'a, T: Real> {
    image: &'a mut [T],
    gradient: &'a mut BandGradient<T>,
    /// Sum of `upstream` over the pairs, each of which replaced a tail.
    visited: T::Float,
}

impl<T: Real> Sink<'_, T> {
    /// Takes all pixels of a face; gives the gradient to x and y of its corners.
    #[inline(always)]
    fn visit<const IMAGE: bool, const GRADIENT: bool, const TABLE: bool>(
        &mut self,
        scene: &Scene<T>,
        face: &Face<T>,
        runs: &Runs,
        upstream: &[T::Float],
        batch: &mut Batch<T>,
    ) -> [T; 6] {
        let mut sums = [T::ZERO; 6];
        let mut first = (runs.rows.start - runs.band) * scene.stride();
        for row in runs.rows.clone() {
            let (mut start, end) = runs.columns(row);
            while start < end {
                let (centres, height) = (&scene.centres[start..], scene.heights[row]);
                batch.push::<GRADIENT>(centres, height, first + start, upstream);
                start += GROUP;
                if batch.is_full() {
                    self.take::<IMAGE, GRADIENT, TABLE>(scene, face, batch, &mut sums);
                }
            }
            first += scene.stride();
        }
        if !batch.is_empty() {
            self.take::<IMAGE, GRADIENT, TABLE>(scene, face, batch, &mut sums);
        }
        if GRADIENT {
            for sum in &mut sums {
                *sum = sum.scale(T::Float::from_f64(-2.0));
            }
        }
        sums
    }

    #[inline(always)]
    fn take<const IMAGE: bool, const GRADIENT: bool, const TABLE: bool>(
        &mut self,
        scene: &Scene<T>,
        face: &Face<T>,
        batch: &mut Batch<T>,
        sums: &mut [T; 6],
    ) {
        batch.places::<GRADIENT>(face, &scene.lookup);
        batch.fetch(scene.table);
        if IMAGE {
            batch.add_values(self.image, scene.table[scene.grid.tail()][0]);
        }
        if GRADIENT {
            batch.add_corners(sums);
        }
        if TABLE {
            batch.add_table(&mut self.gradient.table, &mut self.visited);
        }
        batch.clear();
    }
}

/// Compiles a walk for the instruction sets that matter and picks one at run time. Products and
/// sums are never contracted, so that every set gives the same bits.
macro_rules! dispatched {
    ($name:ident, $image:literal, $gradient:literal, $table:literal) => {
        pub(crate) fn $name<T: Real>(
            scene: &Scene<T>,
            place: Place<T>,
            upstream: &[T::Float],
            image: &mut [T],
            gradient: &mut BandGradient<T>,
        ) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
                fn avx512<T: Real>(
                    scene: &Scene<T>,
                    place: Place<T>,
                    upstream: &[T::Float],
                    image: &mut [T],
                    gradient: &mut BandGradient<T>,
                ) {
                    walk::<T, $image, $gradient, $table>(scene, place, upstream, image, gradient);
                }
                #[target_feature(enable = "avx2")]
                fn avx2<T: Real>(
                    scene: &Scene<T>,
                    place: Place<T>,
                    upstream: &[T::Float],
                    image: &mut [T],
                    gradient: &mut BandGradient<T>,
                ) {
                    walk::<T, $image, $gradient, $table>(scene, place, upstream, image, gradient);
                }
                let has = |name: &str| match name {
                    "avx512" => {
                        is_x86_feature_detected!("avx512f")
                            && is_x86_feature_detected!("avx512vl")
                            && is_x86_feature_detected!("avx512dq")
                            && is_x86_feature_detected!("avx512bw")
                    }
                    _ => is_x86_feature_detected!("avx2"),
                };
                if has("avx512") {
                    // SAFETY: the features were just detected.
                    #[allow(unsafe_code)]
                    unsafe {
                        return avx512(scene, place, upstream, image, gradient);
                    }
                }
                if has("avx2") {
                    // SAFETY: the feature was just detected.
                    #[allow(unsafe_code)]
                    unsafe {
                        return avx2(scene, place, upstream, image, gradient);
                    }
                }
            }
            walk::<T, $image, $gradient, $table>(scene, place, upstream, image, gradient);
        }
    };
}

dispatched!(walk_image, true, false, false);
dispatched!(walk_gradient, false, true, false);
dispatched!(walk_gradient_and_table, false, true, true);
dispatched!(walk_everything, true, true, true);

#[cfg(all(test, target_arch = "x86_64"))]
mod tests;
