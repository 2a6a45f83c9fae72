//! Which faces reach which rows: the list that culling leaves.

use rayon::prelude::*;

use super::{
    face::{Reach, in_pixels},
    real::Float,
};

/// Rows of a band.
pub(crate) const ROWS: usize = 32;

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
}

impl View {
    /// Faces of band `band`.
    pub(crate) fn faces(&self, band: usize) -> &[u32] {
        &self.entries[self.offsets[band] as usize..self.offsets[band + 1] as usize]
    }
}

/// The lists of all views.
#[derive(Debug)]
pub(crate) struct Bands {
    pub(crate) views: Vec<View>,
    /// Bands of a view.
    pub(crate) count: usize,
}

impl Bands {
    /// Lists the faces of each band of each view. `vertices` `[views, 3, vertices]` holds x, y in
    /// NDC and the depth; a face enters the bands that its bounding box grown by `radius` touches.
    pub(crate) fn new<F: Float>(
        vertices: &[F],
        vertices_per_view: usize,
        faces: &[[u32; 3]],
        size: usize,
        near: f64,
        radius: f64,
    ) -> Self {
        let count = size.div_ceil(ROWS);
        let radius = F::from_f64(0.5 * radius * size as f64);
        let near = F::from_f64(near);
        let view = |vertices: &[F]| {
            let (x, rest) = vertices.split_at(vertices_per_view);
            let (y, z) = rest.split_at(vertices_per_view);
            let place = |((&x, &y), &z)| in_pixels([x, y, z], near, size);
            let places: Vec<_> = x.iter().zip(y).zip(z).map(place).collect();
            let mut drawn = 0;
            let corners = |&[a, b, c]: &[u32; 3]| {
                [places[a as usize], places[b as usize], places[c as usize]]
            };
            let reach = |face: &[u32; 3]| {
                let reach = Reach::around(corners(face), radius, size);
                drawn += usize::from(reach.is_some());
                reach.unwrap_or(Reach::NOTHING)
            };
            let reaches: Vec<Reach> = faces.iter().map(reach).collect();
            let (offsets, entries) = by_band(&reaches, count);
            View { offsets, entries, reaches, drawn }
        };
        let views = vertices.par_chunks(3 * vertices_per_view.max(1)).map(view).collect();
        Self { views, count }
    }
}

/// Sorts faces into the bands that they reach.
fn by_band(reaches: &[Reach], count: usize) -> (Vec<u32>, Vec<u32>) {
    let bands = |reach: &Reach| {
        let [top, bottom] = [reach.top, reach.bottom].map(|row| row as usize);
        top / ROWS..bottom.div_ceil(ROWS)
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
