//! `S = Σ profile(d)` over the faces of a pixel, its gradient, and the gradient of that.

use rayon::prelude::*;

use super::{
    bands::{Bands, ROWS, View},
    real::{Dual, Float, Real},
    table::Grid,
    walk::{
        BandGradient, Place, Scene, walk_everything, walk_gradient, walk_gradient_and_table,
        walk_image,
    },
};

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
                let place = Place { vertices, view, band };
                let mut padded = vec![empty; scene.band_rows(band).len() * scene.stride()];
                walk_image(scene, place, &[], &mut padded, &mut none);
                trim(&padded, image, scene);
            });
        },
    );
    image
}

/// Rows of a band as they stand in the image.
fn trim<T: Real>(padded: &[T], image: &mut [T], scene: &Scene<T>) {
    for (row, padded) in image.chunks_exact_mut(scene.size).zip(padded.chunks(scene.stride())) {
        row.copy_from_slice(&padded[..scene.size]);
    }
}

/// Rows of the image as they stand in a band, followed by zeros.
fn pad<T: Real>(rows: &[T::Float], scene: &Scene<T>) -> Vec<T::Float> {
    let mut padded = vec![T::Float::ZERO; rows.len() / scene.size * scene.stride()];
    for (padded, row) in padded.chunks_mut(scene.stride()).zip(rows.chunks(scene.size)) {
        padded[..scene.size].copy_from_slice(row);
    }
    padded
}

/// Faces drawn in a view, as a factor.
fn drawn<F: Float>(view: &View) -> F {
    F::from_f64(view.drawn as f64)
}

/// Runs a walk with gradients over all bands: gradient of `Σ upstream S` to vertices and table, flat
/// and in this order, the third row of each view's vertices 0, because a silhouette does not see
/// depth. With `IMAGE` the sums come back as well.
fn gradient<T: Real, const IMAGE: bool>(
    scene: &Scene<T>,
    bands: &Bands,
    upstream: &[T::Float],
    wrt_table: bool,
) -> (Vec<T>, Vec<T>) {
    let size = scene.size;
    let views = bands.views.len();
    let pixels = size * size;
    let table_rows = if wrt_table || IMAGE { scene.grid.rows() } else { 0 };
    let count = scene.vertices.len();
    let mut flat = vec![T::ZERO; count + 4 * scene.grid.rows()];
    let (vertices, table) = flat.split_at_mut(count);
    let per_view: Vec<_> = vertices
        .par_chunks_mut((count / views.max(1)).max(1))
        .enumerate()
        .map(|(index, total)| {
            let view = &bands.views[index];
            let vertices = scene.view(index, views);
            let upstream = &upstream[index * pixels..(index + 1) * pixels];
            let walked: Vec<_> = (0..bands.count)
                .into_par_iter()
                .map(|band| {
                    let rows = scene.band_rows(band);
                    let length = rows.len() * scene.stride();
                    let mut image = if IMAGE { vec![T::ZERO; length] } else { Vec::new() };
                    let mut gradient = BandGradient {
                        corners: vec![[T::ZERO; 6]; view.faces(band).len()],
                        table: vec![[T::ZERO; 4]; table_rows],
                    };
                    let walk = match (IMAGE, wrt_table) {
                        (true, _) => walk_everything,
                        (false, true) => walk_gradient_and_table,
                        (false, false) => walk_gradient,
                    };
                    let upstream = pad(&upstream[rows.start * size..rows.end * size], scene);
                    let place = Place { vertices, view, band };
                    walk(scene, place, &upstream, &mut image, &mut gradient);
                    (gradient, image)
                })
                .collect();
            gather(scene, view, upstream, walked, total)
        })
        .collect();
    let mut sums = Vec::with_capacity(if IMAGE { views * pixels } else { 0 });
    for (part, image) in per_view {
        table.iter_mut().zip(part.as_flattened()).for_each(|(total, &part)| *total += part);
        sums.extend(image);
    }
    (flat, sums)
}

/// Adds up the bands of a view in their order: corners to `vertices`, tables, image rows.
fn gather<T: Real>(
    scene: &Scene<T>,
    view: &View,
    upstream: &[T::Float],
    walked: Vec<(BandGradient<T>, Vec<T>)>,
    vertices: &mut [T],
) -> (Vec<[T; 4]>, Vec<T>) {
    let mut table = vec![[T::ZERO; 4]; walked.first().map_or(0, |(band, _)| band.table.len())];
    let tail = scene.table[scene.grid.tail()][0].scale(drawn(view));
    let mut image = Vec::with_capacity(walked.iter().map(|(_, rows)| rows.len()).sum());
    let (x, rest) = vertices.split_at_mut(vertices.len() / 3);
    for (band, (gradient, rows)) in walked.into_iter().enumerate() {
        for (&face, corners) in view.faces(band).iter().zip(&gradient.corners) {
            for (corner, xy) in scene.faces[face as usize].iter().zip(corners.chunks_exact(2)) {
                x[*corner as usize] += xy[0];
                rest[*corner as usize] += xy[1];
            }
        }
        add_rows(&mut table, &gradient.table);
        for row in rows.chunks(scene.stride()) {
            image.extend(row[..scene.size].iter().map(|&sum| sum + tail));
        }
    }
    if !table.is_empty() {
        let sum = upstream.iter().fold(T::Float::ZERO, |sum, &g| sum + g);
        table[scene.grid.tail()][0] += T::constant(drawn::<T::Float>(view) * sum);
    }
    (table, image)
}

fn add_rows<T: Real>(total: &mut [[T; 4]], part: &[[T; 4]]) {
    for (total, part) in total.iter_mut().zip(part) {
        total.iter_mut().zip(part).for_each(|(total, &part)| *total += part);
    }
}

/// The inputs of the op in one float type.
#[derive(Clone, Copy)]
pub(crate) struct Inputs<'a, F> {
    /// `[views, 3, vertices]`.
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
    gradient::<F, false>(&scene, &inputs.bands(), upstream, wrt_table).0
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
    gradient.iter().chain(&image).map(|dual| dual.tangent).collect()
}
