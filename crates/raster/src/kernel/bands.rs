//! Which faces reach which rows: the list that culling leaves.

use rayon::prelude::*;

use super::{
    face::{bounds, rows},
    real::Float,
};

/// Rows of a band.
pub(crate) const ROWS: usize = 16;

/// Faces of one view by band, in ascending order of faces.
#[derive(Debug)]
pub(crate) struct View {
    /// `entries[offsets[b]..offsets[b + 1]]` are the faces of band b.
    pub(crate) offsets: Vec<u32>,
    pub(crate) entries: Vec<u32>,
    /// Faces that are drawn at all.
    pub(crate) drawn: usize,
}

/// The lists of all views.
#[derive(Debug)]
pub(crate) struct Bands {
    pub(crate) views: Vec<View>,
    /// Bands of a view.
    pub(crate) count: usize,
}

impl Bands {
    /// Lists the faces of each band of each view. `vertices` `[views, vertices, 3]` holds x, y in
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
        let view = |vertices: &[F]| {
            let range = |face: &[u32; 3]| {
                let corners = face.map(|v| &vertices[3 * v as usize..3 * v as usize + 3]);
                bounds(corners, near).map(|[x0, x1, y0, y1]| {
                    let (top, bottom) = rows(y0 - radius, y1 + radius, size);
                    let misses = x0 - radius > 1.0 || x1 + radius < -1.0 || bottom <= top;
                    if misses { (0, 0) } else { (top / ROWS, bottom.div_ceil(ROWS)) }
                })
            };
            let ranges: Vec<_> = faces.iter().map(range).collect();
            let mut offsets = vec![0u32; count + 1];
            for (first, end) in ranges.iter().flatten() {
                offsets[*first..*end].iter_mut().for_each(|n| *n += 1);
            }
            let mut total = 0;
            for offset in &mut offsets {
                total += std::mem::replace(offset, total);
            }
            let mut entries = vec![0u32; total as usize];
            let mut next = offsets.clone();
            for (face, range) in ranges.iter().enumerate() {
                let Some((first, end)) = *range else { continue };
                for slot in &mut next[first..end] {
                    entries[*slot as usize] = face as u32;
                    *slot += 1;
                }
            }
            View { offsets, entries, drawn: ranges.iter().flatten().count() }
        };
        let views = vertices.par_chunks(3 * vertices_per_view.max(1)).map(view).collect();
        Self { views, count }
    }
}
