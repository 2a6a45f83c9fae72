//! Which faces reach which rows: the list that culling leaves.

use rayon::prelude::*;

use super::{
    float::{Float as _, Vectors},
    lanes::{LANES, Lanes, Plain, Work, has_vectors, run},
    reach::{Reach, grown, in_pixels},
    real::splat,
};
use crate::ImageSize;

/// Faces of one view by band, in ascending order of faces.
#[derive(Debug)]
pub(crate) struct View {
    /// `entries[offsets[b]..offsets[b + 1]]` are the faces of band b.
    offsets: Vec<u32>,
    entries: Vec<u32>,
    /// Pixels that each face may reach; none for a face that is not drawn.
    pub(crate) reaches: Vec<Reach>,
    /// Faces that are drawn at all, on the image or beside it.
    pub(crate) drawn: usize,
    /// How far outside each face reaches, in NDC; nothing where all faces reach as far.
    pub(crate) radii: Vec<f32>,
}

impl View {
    /// Lists faces by the pixels that each reaches, in `count` bands of `rows` each: a power of two.
    pub(crate) fn of_reaches(
        reaches: Vec<Reach>,
        radii: Vec<f32>,
        count: usize,
        rows: usize,
    ) -> Self {
        let (offsets, entries) = by_band(&reaches, count, rows);
        let drawn = reaches.iter().filter(|&&reach| reach != Reach::NOTHING).count();
        Self { offsets, entries, reaches, drawn, radii }
    }

    /// Faces of band `band`.
    pub(crate) fn faces(&self, band: usize) -> &[u32] {
        &self.entries[self.offsets[band] as usize..self.offsets[band + 1] as usize]
    }
}

/// Which faces reach which rows, of all views.
#[derive(Debug)]
pub struct Bands {
    pub(crate) views: Vec<View>,
    /// Bands of a view.
    pub(crate) count: usize,
}

impl Bands {
    /// Lists the faces of each band of each view. `vertices` `[views, 3, vertices]` holds x, y in
    /// NDC and the depth; a face enters the bands that its bounding box grown by `radius` touches.
    pub(crate) fn new<F: Vectors>(
        vertices: &[F],
        vertices_per_view: usize,
        faces: &[[u32; 3]],
        size: ImageSize,
        rows: usize,
        near: f64,
        radius: f64,
    ) -> Self {
        let count = size.height.div_ceil(rows);
        let radius = F::from_f64(0.5 * radius * size.shorter() as f64);
        let near = F::from_f64(near);
        let view = |vertices: &[F]| {
            let (x, rest) = vertices.split_at(vertices_per_view);
            let (y, z) = rest.split_at(vertices_per_view);
            let place = |((&x, &y), &z)| in_pixels([x, y, z], near, size);
            let places: Vec<_> = x.iter().zip(y).zip(z).map(place).collect();
            let mut reaches = vec![Reach::NOTHING; faces.len()];
            let (places, reached) = (&places, &mut reaches);
            let drawn = if has_vectors() {
                run::<F::Best, _>(ReachOfFaces::<F::Best> {
                    places,
                    faces,
                    radius,
                    size,
                    reaches: reached,
                })
            } else {
                run::<Plain<F>, _>(ReachOfFaces::<Plain<F>> {
                    places,
                    faces,
                    radius,
                    size,
                    reaches: reached,
                })
            };
            let (offsets, entries) = by_band(&reaches, count, rows);
            View { offsets, entries, reaches, drawn, radii: Vec::new() }
        };
        let views = vertices.par_chunks(3 * vertices_per_view.max(1)).map(view).collect();
        Self { views, count }
    }
}

/// Writes the pixels that each face may reach, and counts the faces that are drawn.
struct ReachOfFaces<'a, L: Lanes> {
    /// Places of the vertices in the image.
    places: &'a [[L::Float; 2]],
    faces: &'a [[u32; 3]],
    /// In pixels.
    radius: L::Float,
    size: ImageSize,
    reaches: &'a mut [Reach],
}

impl<L: Lanes> Work for ReachOfFaces<'_, L> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let Self { places, faces, radius, size, reaches } = self;
        let mut drawn = 0;
        for (faces, reaches) in faces.chunks(LANES).zip(reaches.chunks_mut(LANES)) {
            let mut corners = [[[L::Float::ZERO; LANES]; 3]; 2];
            for (lane, face) in faces.iter().enumerate() {
                for k in 0..3 {
                    let [x, y] = places[face[k] as usize];
                    (corners[0][k][lane], corners[1][k][lane]) = (x, y);
                }
            }
            let [x, y] = &corners;
            let columns = Range::<L>::new(x, radius, size.width);
            let rows = Range::<L>::new(y, radius, size.height);
            for (lane, reach) in reaches.iter_mut().enumerate() {
                let [left, right] = [columns.start[lane] as u32, columns.end[lane] as u32];
                let [top, bottom] = [rows.start[lane] as u32, rows.end[lane] as u32];
                // A vertex that is not drawn is at infinity in both.
                let is_drawn = columns.highest[lane] < L::Float::from_f64(f64::INFINITY);
                drawn += usize::from(is_drawn);
                if is_drawn && left < right && top < bottom {
                    *reach = Reach { top, bottom, left, right };
                }
            }
        }
        drawn
    }
}

/// Pixels that faces may reach along an axis: first and after the last.
struct Range<L: Lanes> {
    start: [i32; LANES],
    end: [i32; LANES],
    highest: [L::Float; LANES],
}

impl<L: Lanes> Range<L> {
    #[inline(always)]
    fn new([a, b, c]: &[[L::Float; LANES]; 3], radius: L::Float, side: usize) -> Self {
        let (a, b, c) = (L::of(a), L::of(b), L::of(c));
        let highest = a.max(b).max(c);
        let grown = L::splat(grown(radius, side));
        let low = a.min(b).min(c) - grown + splat(1.0);
        let most = splat(side as f64);
        Self {
            start: L::index_array(low.max(splat(0.0)).min(most).nearest()),
            end: L::index_array((highest + grown).max(splat(0.0)).min(most).nearest()),
            highest: highest.array(),
        }
    }
}

/// Sorts faces into the bands that they reach, of `rows` each: a power of two.
fn by_band(reaches: &[Reach], count: usize, rows: usize) -> (Vec<u32>, Vec<u32>) {
    let shift = rows.trailing_zeros();
    let bands = |reach: &Reach| {
        let end = (reach.bottom as usize + rows - 1) >> shift;
        (reach.top as usize) >> shift..end
    };
    let mut offsets = vec![0u32; count + 1];
    for reach in reaches {
        offsets[bands(reach)].iter_mut().for_each(|n| *n += 1);
    }
    let mut total = 0;
    for offset in &mut offsets {
        total += std::mem::replace(offset, total);
    }
    let mut entries = vec![0u32; total as usize];
    let mut next = offsets.clone();
    for (face, reach) in reaches.iter().enumerate() {
        for slot in &mut next[bands(reach)] {
            entries[*slot as usize] = face as u32;
            *slot += 1;
        }
    }
    (offsets, entries)
}
