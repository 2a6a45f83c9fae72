//! `S = Σ profile(d)` over the faces of a pixel, its gradient, and the gradient of that.

use std::{borrow::Cow, ops::Range};

use rayon::prelude::*;

use super::{
    bands::{Bands, Drawn, View},
    float::{Float, Vectors, on_vectors},
    gather::{Part, gather as gather_corners},
    lanes,
    reach::{Reach, within},
    real::{self, Dual, Real, Table},
    scene::{BandRef, Scene},
    table::Grid,
    tasks::task,
    walk::{Gradient, Image, TableGradient, walk},
};
use crate::ImageSize;

/// Faces are selected by their upstream if one in this many pixels, or more, has none.
const MOST_PULLED: usize = 4;

/// The inputs of sums of a profile, in one float type.
#[derive(Clone, Copy)]
pub struct Inputs<'a, F> {
    /// `[views, 3, vertices]`: x and y in NDC, depth in world units.
    pub vertices: &'a [F],
    /// `[grid.rows(), 4]`: the profile as cubics, constant first, in the position of the squared distance within its cell.
    pub table: &'a [F],
    /// Vertices of each face.
    pub faces: &'a [[u32; 3]],
    /// Layout of the cells of the table.
    pub grid: Grid,
    /// Height and width of the image.
    pub size: ImageSize,
    /// Depth below which a vertex counts as behind the camera: its faces are not drawn.
    pub near: f64,
    /// Whether back faces, whose corners appear in clockwise order, are culled.
    pub culls: bool,
    /// Number of views.
    pub views: usize,
    /// Bands of a view: [`bands_of_view`](crate::bands_of_view), or for losses [`bands_of_losses`](crate::bands_of_losses). From one to the
    /// number of rows, with at most 255 rows per band on average.
    pub bands: usize,
}

impl<F> Inputs<'_, F> {
    pub(crate) fn bands(&self) -> Bands
    where
        F: Vectors,
    {
        let per_view = self.vertices.len() / 3 / self.views.max(1);
        let Self { vertices, faces, size, near, culls, .. } = *self;
        let drawn = Drawn { faces, size, near, radius: self.grid.outer, culls };
        Bands::new(vertices, per_view, drawn, self.bands)
    }

    /// The scene of a walk over these inputs; `tangents` are those of vertices and table, or empty.
    pub(crate) fn scene<'s, T>(&'s self, tangents: [&'s [F]; 2]) -> Scene<'s, T>
    where
        T: Real,
        T::Lanes: super::lanes::Lanes<Float = F>,
    {
        let table = Table { values: self.table.as_chunks().0, tangents: tangents[1].as_chunks().0 };
        let Self { vertices, faces, grid, size, .. } = *self;
        Scene::new([vertices, tangents[0]], faces, table, grid, size)
    }
}

/// See [`Kernels::sums`](crate::Kernels::sums).
pub(crate) fn forward<F: Vectors>(inputs: &Inputs<F>, bands: &Bands) -> Vec<F> {
    on_vectors!(image::<F>(&inputs.scene([&[]; 2]), bands))
}

/// See [`Kernels::sums_vjp`](crate::Kernels::sums_vjp).
pub(crate) fn vjp<F: Vectors>(
    inputs: &Inputs<F>,
    bands: &Bands,
    upstream: &[F],
    wanted: [bool; 2],
) -> Vec<F> {
    let wanted = [wanted[0], wanted[1], false];
    on_vectors!(gradient::<F>(&inputs.scene([&[]; 2]), bands, upstream, wanted))
}

/// See [`Kernels::sums_vjp_of_vjp`](crate::Kernels::sums_vjp_of_vjp).
///
/// The Hessian is symmetric, so the first two gradients are the derivative of the gradient along the direction, and the third is the
/// derivative of the image along it: one walk with dual numbers.
pub(crate) fn vjp_of_vjp<F: Vectors>(
    inputs: &Inputs<F>,
    bands: &Bands,
    upstream: &[F],
    direction: &[F],
    along: [bool; 2],
    wanted: [bool; 3],
) -> Vec<F> {
    let tangents = tangents([inputs.vertices, inputs.table], along, direction);
    let tangents = tangents.each_ref().map(|own| &own[..]);
    on_vectors!(gradient::<Dual<F>>(&inputs.scene(tangents), bands, upstream, wanted))
}

/// Tangents of inputs: consecutive parts of `direction` for those that it is `along`, zeros for the others.
pub(crate) fn tangents<'a, F: Vectors, const N: usize>(
    inputs: [&[F]; N],
    along: [bool; N],
    mut direction: &'a [F],
) -> [Cow<'a, [F]>; N] {
    std::array::from_fn(|k| {
        if !along[k] {
            return Cow::Owned(vec![F::ZERO; inputs[k].len()]);
        }
        let (own, rest) = direction.split_at(inputs[k].len());
        direction = rest;
        Cow::Borrowed(own)
    })
}

/// Runs the image part of a walk over all bands; `[views, height, width]`.
fn image<T: Real>(scene: &Scene<T>, bands: &Bands) -> Vec<real::Float<T>> {
    let views = bands.views.len();
    let pixels = scene.size.pixels();
    let mut image = vec![real::Float::<T>::ZERO; views * pixels];
    image.par_chunks_mut(pixels).zip(&bands.views).enumerate().for_each(
        |(index, (image, view))| {
            let rows = view.cut(image, scene.size.width);
            rows.into_par_iter().enumerate().for_each(|(band, image)| {
                task("image of a band", || {
                    let place = scene.place(view, index, views, band);
                    let mut padded = vec![place.empty(&scene.grid); place.length(scene)];
                    let tail = place.tail(&scene.grid);
                    walk(scene, place, &mut Image { image: &mut padded, tail });
                    trim(&padded, image, scene);
                });
            });
        },
    );
    image
}

/// Copies rows of a band to the image.
fn trim<T: Real>(padded: &[real::Float<T>], image: &mut [real::Float<T>], scene: &Scene<T>) {
    let width = scene.size.width;
    for (row, padded) in image.chunks_exact_mut(width).zip(padded.chunks(scene.stride())) {
        row.copy_from_slice(&padded[..width]);
    }
}

/// Copies rows of the image to a band, followed by zeros.
fn pad<T: Real>(rows: &[real::Float<T>], scene: &Scene<T>, length: usize) -> Vec<real::Float<T>> {
    let mut padded = vec![real::Float::<T>::ZERO; length];
    let width = scene.size.width;
    for (padded, row) in padded.chunks_mut(scene.stride()).zip(rows.chunks(width)) {
        padded[..width].copy_from_slice(row);
    }
    padded
}

/// Faces of a band that reach a pixel whose upstream is not 0; `None` if most pixels have one, where the selection would cost more than it
/// saves.
fn pulled<F: lanes::Float>(
    upstream: &[F],
    faces: &[u32],
    reaches: &[Reach],
    rows: Range<usize>,
) -> Option<Vec<u32>> {
    let zeros = upstream.iter().filter(|&&g| g == F::ZERO).count();
    if zeros < upstream.len() / MOST_PULLED {
        return None;
    }
    // Number of pixels with an upstream above and to the left of each.
    let (width, height) = (upstream.len() / rows.len().max(1), rows.len());
    let stride = width + 1;
    let mut counts = vec![0u32; stride * (height + 1)];
    for (row, upstream) in upstream.chunks_exact(width.max(1)).enumerate() {
        let (above, below) = counts.split_at_mut((row + 1) * stride);
        let above = &above[row * stride..];
        let mut of_row = 0;
        for column in 0..width {
            of_row += u32::from(upstream[column] != F::ZERO);
            below[column + 1] = above[column + 1] + of_row;
        }
    }
    let is_pulled = |&&face: &&u32| {
        let reach = reaches[face as usize];
        let own = within(rows.clone(), reach);
        let until = |row: usize, column: u32| counts[(row - rows.start) * stride + column as usize];
        until(own.end, reach.right) + until(own.start, reach.left)
            != until(own.end, reach.left) + until(own.start, reach.right)
    };
    Some(faces.iter().filter(is_pulled).copied().collect())
}

/// Results of a band: for each face the gradient to x and y of its three corners, that to the table, and rows of the image.
struct Walked<'a, F> {
    faces: Cow<'a, [u32]>,
    corners: Vec<[F; 6]>,
    table: Vec<[F; 4]>,
    image: Vec<F>,
}

/// Runs a walk with gradients over all bands: gradients of `Σ upstream S` with respect to vertices and table, and the sums, those that are
/// wanted, concatenated in this order. The third row of each view's vertices is 0, because a silhouette does not depend on depth. For dual
/// numbers all results are tangents.
fn gradient<T: Real>(
    scene: &Scene<T>,
    bands: &Bands,
    upstream: &[real::Float<T>],
    [wrt_vertices, wrt_table, with_image]: [bool; 3],
) -> Vec<real::Float<T>> {
    let zero = real::Float::<T>::ZERO;
    let views = bands.views.len();
    let (pixels, width) = (scene.size.pixels(), scene.size.width);
    let table_rows = if wrt_table { scene.grid.rows() } else { 0 };
    let in_band = |index: usize, band: usize| {
        let view = &bands.views[index];
        let whole = scene.place(view, index, views, band);
        let rows = whole.rows();
        let of_band = index * pixels + rows.start * width..index * pixels + rows.end * width;
        let upstream = &upstream[of_band];
        let some = match T::DUAL || wrt_table {
            true => None,
            false => pulled(upstream, whole.numbers, &view.reaches, rows),
        };
        let faces = some.map_or(Cow::Borrowed(whole.numbers), Cow::Owned);
        let place = BandRef { numbers: &faces, ..whole };
        // For floats, the image is a separate pass. For dual numbers it is part of this one, at little cost.
        let length = if T::DUAL { place.length(scene) } else { 0 };
        let mut walked = Walked {
            corners: vec![[zero; 6]; faces.len()],
            table: vec![[zero; 4]; table_rows],
            image: vec![place.empty(&scene.grid); length],
            faces: Cow::default(),
        };
        let upstream = &pad(upstream, scene, place.length(scene));
        let gradient = Gradient::new(scene, upstream, &mut walked.corners);
        let image = Image { image: &mut walked.image, tail: place.tail(&scene.grid) };
        let table = TableGradient::new(upstream, &mut walked.table);
        let tail = scene.grid.tail();
        match (T::DUAL, wrt_table) {
            (false, false) => {
                walk(scene, place, &mut { gradient });
            }
            (true, false) => {
                walk(scene, place, &mut (image, gradient));
            }
            (false, true) => {
                let mut both = (gradient, table);
                walk(scene, place, &mut both);
                both.1.finish(tail);
            }
            (true, true) => {
                let mut all = ((image, gradient), table);
                walk(scene, place, &mut all);
                all.1.finish(tail);
            }
        }
        walked.faces = faces;
        walked
    };
    let count = scene.vertices.len();
    let mut vertices = vec![zero; count];
    let per_view: Vec<_> = vertices
        .par_chunks_mut((count / views.max(1)).max(1))
        .enumerate()
        .map(|(index, total)| {
            let in_band = |band| task("gradient of a band", || in_band(index, band));
            let walked: Vec<_> = (0..bands.count).into_par_iter().map(in_band).collect();
            let upstream = &upstream[index * pixels..(index + 1) * pixels];
            gather(scene, &bands.views[index], upstream, walked, total)
        })
        .collect();
    let mut table = vec![[zero; 4]; table_rows];
    for (part, _) in &per_view {
        for (total, part) in table.iter_mut().zip(part) {
            total.iter_mut().zip(part).for_each(|(total, &part)| *total += part);
        }
    }
    let mut flat = if wrt_vertices { vertices } else { Vec::new() };
    flat.extend_from_slice(table.as_flattened());
    if with_image {
        per_view.iter().for_each(|(_, image)| flat.extend_from_slice(image));
    }
    flat
}

/// Adds up the bands of a view in their order: corners to `vertices`, tables, image rows.
fn gather<T: Real>(
    scene: &Scene<T>,
    view: &View,
    upstream: &[real::Float<T>],
    walked: Vec<Walked<'_, real::Float<T>>>,
    vertices: &mut [real::Float<T>],
) -> (Vec<[real::Float<T>; 4]>, Vec<real::Float<T>>) {
    let zero = real::Float::<T>::ZERO;
    let mut table = vec![[zero; 4]; walked.first().map_or(0, |band| band.table.len())];
    let mut image = Vec::with_capacity(walked.iter().map(|band| band.image.len()).sum());
    let factor = real::Float::<T>::ONE;
    let part = |walked| {
        let Walked { faces, corners, .. }: &Walked<_> = walked;
        Part { faces, corners, factor }
    };
    let parts: Vec<_> = walked.iter().map(part).collect();
    gather_corners(scene.faces, &parts, vertices);
    for walked in walked {
        for (total, part) in table.iter_mut().zip(&walked.table) {
            total.iter_mut().zip(part).for_each(|(total, &part)| *total += part);
        }
        for row in walked.image.chunks_exact(scene.stride()) {
            image.extend_from_slice(&row[..scene.size.width]);
        }
    }
    // The upstream has no tangent.
    if !table.is_empty() && !T::DUAL {
        let sum = upstream.iter().fold(zero, |sum, &g| sum + g);
        table[scene.grid.tail()][0] += real::Float::<T>::from_f64(view.drawn as f64) * sum;
    }
    (table, image)
}
