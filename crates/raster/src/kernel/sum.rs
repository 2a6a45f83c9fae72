//! `S = Σ profile(d)` over the faces of a pixel, its gradient, and the gradient of that.

use rayon::prelude::*;

use super::{
    bands::{Bands, ROWS, View},
    batch::{Batch, LANES},
    face::{Face, Spans, columns, pixel_centre, rows},
    real::{Dual, Float, Real},
    table::{Grid, Lookup},
};

/// Everything a traversal reads, in one number type.
pub(crate) struct Scene<'a, T: Real> {
    /// `[views, vertices, 3]`: x and y in NDC, depth.
    vertices: &'a [T],
    faces: &'a [[u32; 3]],
    /// Cubic coefficients of each cell, `[grid.rows()]`.
    table: &'a [[T; 4]],
    grid: Grid,
    size: usize,
    lookup: Lookup<T::Float>,
    /// Centres of the columns, with a chunk more than the image has.
    centres: Vec<T::Float>,
}

/// Gradient of `Σ upstream S`.
pub(crate) struct Gradient<T: Real> {
    /// `[views, vertices, 3]`; the third column is 0, a silhouette does not see depth.
    pub(crate) vertices: Vec<T>,
    /// Like [`Scene::table`].
    pub(crate) table: Vec<[T; 4]>,
}

/// What one band gives back.
struct BandGradient<T: Real> {
    /// For each entry of the band, the gradient to x and y of its three corners.
    corners: Vec<[T; 6]>,
    table: Vec<[T; 4]>,
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
            centres: (0..size + LANES).map(centre).collect(),
        }
    }

    fn view(&self, index: usize, views: usize) -> &[T] {
        let length = self.vertices.len() / views;
        &self.vertices[index * length..(index + 1) * length]
    }

    /// Rows of the image that band `band` holds.
    fn band_rows(&self, band: usize) -> std::ops::Range<usize> {
        band * ROWS..((band + 1) * ROWS).min(self.size)
    }
}

/// One walk over the pairs of a band. `upstream` and `image` are `[rows, size]`.
#[inline(always)]
fn walk<T: Real, const IMAGE: bool, const GRADIENT: bool, const TABLE: bool>(
    scene: &Scene<T>,
    vertices: &[T],
    entries: &[u32],
    band: usize,
    upstream: &[T::Float],
    image: &mut [T],
    gradient: &mut BandGradient<T>,
) {
    let mut batch = Batch::new();
    let mut sink = Sink { upstream, image, gradient, visited: T::Float::ZERO };
    let radius = scene.grid.outer;
    let band_rows = scene.band_rows(band);
    let mut heights = [T::Float::ZERO; ROWS];
    for (height, row) in heights.iter_mut().zip(band_rows.clone()) {
        *height = scene.centres[scene.size - 1 - row];
    }
    for (slot, &face) in entries.iter().enumerate() {
        let mut x = [T::ZERO; 3];
        let mut y = [T::ZERO; 3];
        let mut box_ = [f64::MAX, f64::MIN, f64::MAX, f64::MIN];
        for k in 0..3 {
            let at = 3 * scene.faces[face as usize][k] as usize;
            (x[k], y[k]) = (vertices[at], vertices[at + 1]);
            let (x, y) = (x[k].value().to_f64(), y[k].value().to_f64());
            box_ = [box_[0].min(x), box_[1].max(x), box_[2].min(y), box_[3].max(y)];
        }
        let face = Face::new(x, y);
        let (top, bottom) = rows(box_[2] - radius, box_[3] + radius, scene.size);
        let within = columns(box_[0] - radius, box_[1] + radius, scene.size);
        let spans = Spans::new(&face, T::Float::from_f64(radius));
        let (starts, ends) = spans.columns(&heights, within, scene.size);
        let mut sums = [T::ZERO; 6];
        for row in top.max(band_rows.start)..bottom.min(band_rows.end) {
            let in_band = row - band_rows.start;
            let (mut start, end) = (starts[in_band] as usize, ends[in_band] as usize);
            while start < end {
                let at = in_band * scene.size + start;
                start += batch.push(&scene.centres[start..], end - start, heights[in_band], at);
                if batch.is_full() {
                    sink.take::<IMAGE, GRADIENT, TABLE>(scene, &face, &mut batch, &mut sums);
                }
            }
        }
        if !batch.is_empty() {
            sink.take::<IMAGE, GRADIENT, TABLE>(scene, &face, &mut batch, &mut sums);
        }
        if GRADIENT {
            for sum in &mut sums {
                *sum = sum.scale(T::Float::from_f64(-2.0));
            }
            sink.gradient.corners[slot] = sums;
        }
    }
    if TABLE {
        sink.gradient.table[scene.grid.tail()][0] += T::constant(-sink.visited);
    }
}

/// Where the pairs of a band go.
struct Sink<'a, T: Real> {
    upstream: &'a [T::Float],
    image: &'a mut [T],
    gradient: &'a mut BandGradient<T>,
    /// Sum of `upstream` over the pairs, each of which replaced a tail.
    visited: T::Float,
}

impl<T: Real> Sink<'_, T> {
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
            batch.add_corners(self.upstream, sums);
        }
        if TABLE {
            batch.add_table(self.upstream, &mut self.gradient.table, &mut self.visited);
        }
        batch.clear();
    }
}

/// Compiles a walk for the instruction sets that matter and picks one at run time. Products and
/// sums are never contracted, so that every set gives the same bits.
macro_rules! dispatched {
    ($name:ident, $image:literal, $gradient:literal, $table:literal) => {
        fn $name<T: Real>(
            scene: &Scene<T>,
            vertices: &[T],
            entries: &[u32],
            band: usize,
            upstream: &[T::Float],
            image: &mut [T],
            gradient: &mut BandGradient<T>,
        ) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2")]
                fn avx512<T: Real>(
                    scene: &Scene<T>,
                    vertices: &[T],
                    entries: &[u32],
                    band: usize,
                    upstream: &[T::Float],
                    image: &mut [T],
                    gradient: &mut BandGradient<T>,
                ) {
                    walk::<T, $image, $gradient, $table>(
                        scene, vertices, entries, band, upstream, image, gradient,
                    );
                }
                #[target_feature(enable = "avx2")]
                fn avx2<T: Real>(
                    scene: &Scene<T>,
                    vertices: &[T],
                    entries: &[u32],
                    band: usize,
                    upstream: &[T::Float],
                    image: &mut [T],
                    gradient: &mut BandGradient<T>,
                ) {
                    walk::<T, $image, $gradient, $table>(
                        scene, vertices, entries, band, upstream, image, gradient,
                    );
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
                        return avx512(scene, vertices, entries, band, upstream, image, gradient);
                    }
                }
                if has("avx2") {
                    // SAFETY: the feature was just detected.
                    #[allow(unsafe_code)]
                    unsafe {
                        return avx2(scene, vertices, entries, band, upstream, image, gradient);
                    }
                }
            }
            walk::<T, $image, $gradient, $table>(
                scene, vertices, entries, band, upstream, image, gradient,
            );
        }
    };
}

dispatched!(walk_image, true, false, false);
dispatched!(walk_gradient, false, true, false);
dispatched!(walk_gradient_and_table, false, true, true);
dispatched!(walk_everything, true, true, true);

/// Entries of band `band` of a view.
fn entries(view: &View, band: usize) -> &[u32] {
    &view.entries[view.offsets[band] as usize..view.offsets[band + 1] as usize]
}

/// Runs the image part of a walk over all bands; `[views, size, size]`.
fn image<T: Real>(scene: &Scene<T>, bands: &Bands) -> Vec<T> {
    let size = scene.size;
    let views = bands.views.len();
    let mut image = vec![T::ZERO; views * size * size];
    image.par_chunks_mut(size * size).zip(&bands.views).enumerate().for_each(
        |(index, (image, view))| {
            let vertices = scene.view(index, views);
            let empty = scene.table[scene.grid.tail()][0].scale(drawn(view));
            image.par_chunks_mut(ROWS * size).enumerate().for_each(|(band, image)| {
                let mut none = BandGradient { corners: Vec::new(), table: Vec::new() };
                walk_image(scene, vertices, entries(view, band), band, &[], image, &mut none);
                image.iter_mut().for_each(|pixel| *pixel += empty);
            });
        },
    );
    image
}

/// Faces drawn in a view, as a factor.
fn drawn<F: Float>(view: &View) -> F {
    F::from_f64(view.drawn as f64)
}

/// Runs a walk with gradients over all bands. With `IMAGE` the sums come back as well.
fn gradient<T: Real, const IMAGE: bool>(
    scene: &Scene<T>,
    bands: &Bands,
    upstream: &[T::Float],
    wrt_table: bool,
) -> (Gradient<T>, Vec<T>) {
    let size = scene.size;
    let views = bands.views.len();
    let pixels = size * size;
    let table_rows = if wrt_table || IMAGE { scene.grid.rows() } else { 0 };
    let per_view: Vec<_> = (0..views)
        .into_par_iter()
        .map(|index| {
            let view = &bands.views[index];
            let vertices = scene.view(index, views);
            let upstream = &upstream[index * pixels..(index + 1) * pixels];
            let walked: Vec<_> = (0..bands.count)
                .into_par_iter()
                .map(|band| {
                    let entries = entries(view, band);
                    let rows = scene.band_rows(band);
                    let mut image =
                        if IMAGE { vec![T::ZERO; rows.len() * size] } else { Vec::new() };
                    let mut gradient = BandGradient {
                        corners: vec![[T::ZERO; 6]; entries.len()],
                        table: vec![[T::ZERO; 4]; table_rows],
                    };
                    let walk = match (IMAGE, wrt_table) {
                        (true, _) => walk_everything,
                        (false, true) => walk_gradient_and_table,
                        (false, false) => walk_gradient,
                    };
                    let upstream = &upstream[rows.start * size..rows.end * size];
                    walk(scene, vertices, entries, band, upstream, &mut image, &mut gradient);
                    (gradient, image)
                })
                .collect();
            gather(scene, view, vertices.len(), upstream, walked)
        })
        .collect();
    let mut total = Gradient {
        vertices: Vec::with_capacity(scene.vertices.len()),
        table: vec![[T::ZERO; 4]; scene.grid.rows()],
    };
    let mut sums = Vec::with_capacity(if IMAGE { views * pixels } else { 0 });
    for (gradient, image) in per_view {
        total.vertices.extend(gradient.vertices);
        add_rows(&mut total.table, &gradient.table);
        sums.extend(image);
    }
    (total, sums)
}

/// Adds up the bands of a view in their order: corners to vertices, tables, image rows.
fn gather<T: Real>(
    scene: &Scene<T>,
    view: &View,
    length: usize,
    upstream: &[T::Float],
    walked: Vec<(BandGradient<T>, Vec<T>)>,
) -> (Gradient<T>, Vec<T>) {
    let mut total = Gradient {
        vertices: vec![T::ZERO; length],
        table: vec![[T::ZERO; 4]; walked.first().map_or(0, |(band, _)| band.table.len())],
    };
    let tail = scene.table[scene.grid.tail()][0].scale(drawn(view));
    let mut image = Vec::new();
    for (band, (gradient, rows)) in walked.into_iter().enumerate() {
        for (&face, corners) in entries(view, band).iter().zip(&gradient.corners) {
            for (corner, xy) in scene.faces[face as usize].iter().zip(corners.chunks_exact(2)) {
                total.vertices[3 * *corner as usize] += xy[0];
                total.vertices[3 * *corner as usize + 1] += xy[1];
            }
        }
        add_rows(&mut total.table, &gradient.table);
        image.extend(rows.into_iter().map(|sum| sum + tail));
    }
    if !total.table.is_empty() {
        let sum = upstream.iter().fold(T::Float::ZERO, |sum, &g| sum + g);
        total.table[scene.grid.tail()][0] += T::constant(drawn::<T::Float>(view) * sum);
    }
    (total, image)
}

fn add_rows<T: Real>(total: &mut [[T; 4]], part: &[[T; 4]]) {
    for (total, part) in total.iter_mut().zip(part) {
        total.iter_mut().zip(part).for_each(|(total, &part)| *total += part);
    }
}

/// The inputs of the op in one float type.
#[derive(Clone, Copy)]
pub(crate) struct Inputs<'a, F> {
    /// `[views, vertices, 3]`.
    pub(crate) vertices: &'a [F],
    /// `[grid.rows(), 4]`.
    pub(crate) table: &'a [F],
    pub(crate) faces: &'a [[u32; 3]],
    pub(crate) grid: Grid,
    pub(crate) size: usize,
    pub(crate) near: f64,
    pub(crate) views: usize,
}

impl<F: Float> Inputs<'_, F> {
    pub(crate) fn bands(&self) -> Bands {
        let per_view = self.vertices.len() / 3 / self.views.max(1);
        Bands::new(self.vertices, per_view, self.faces, self.size, self.near, self.grid.outer)
    }

    fn rows(&self) -> Vec<[F; 4]> {
        self.table.chunks_exact(4).map(|row| [row[0], row[1], row[2], row[3]]).collect()
    }
}

/// Sums of the profile, `[views, size, size]`.
pub(crate) fn forward<F: Float>(inputs: &Inputs<F>) -> Vec<F> {
    let table = inputs.rows();
    let scene = Scene::new(inputs.vertices, inputs.faces, &table, inputs.grid, inputs.size);
    image(&scene, &inputs.bands())
}

/// Gradient of `Σ upstream S` to vertices and table, flat and in this order; the table's part is
/// 0 where it is not asked for.
pub(crate) fn vjp<F: Float>(inputs: &Inputs<F>, upstream: &[F], wrt_table: bool) -> Vec<F> {
    let table = inputs.rows();
    let scene = Scene::new(inputs.vertices, inputs.faces, &table, inputs.grid, inputs.size);
    let (gradient, _) = gradient::<F, false>(&scene, &inputs.bands(), upstream, wrt_table);
    gradient.vertices.into_iter().chain(gradient.table.into_iter().flatten()).collect()
}

/// Pullback of `direction` (like the result of [`vjp`]) through [`vjp`]: gradients to vertices,
/// table and upstream, flat and in this order.
///
/// The Hessian is symmetric, so the first two are the derivative of the gradient along the
/// direction, and the third is the derivative of the image along it: one walk with dual numbers.
pub(crate) fn vjp_of_vjp<F: Float>(inputs: &Inputs<F>, upstream: &[F], direction: &[F]) -> Vec<F> {
    let (along_vertices, along_table) = direction.split_at(inputs.vertices.len());
    let dual = |value: &[F], tangent: &[F]| -> Vec<Dual<F>> {
        let pair = |(&value, &tangent)| Dual { value, tangent };
        value.iter().zip(tangent).map(pair).collect()
    };
    let vertices = dual(inputs.vertices, along_vertices);
    let table: Vec<_> = dual(inputs.table, along_table)
        .chunks_exact(4)
        .map(|row| [row[0], row[1], row[2], row[3]])
        .collect();
    let scene = Scene::new(&vertices, inputs.faces, &table, inputs.grid, inputs.size);
    let (gradient, image) = gradient::<Dual<F>, true>(&scene, &inputs.bands(), upstream, true);
    let gradient = gradient.vertices.into_iter().chain(gradient.table.into_iter().flatten());
    gradient.chain(image).map(|dual| dual.tangent).collect()
}
