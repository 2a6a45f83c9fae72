//! Pixels that faces may reach, several faces at a time.

use crate::{
    ImageSize,
    float::Float as _,
    lanes::{LANES, Lanes, Work, run},
    reach::{Reach, grown, is_seen_clockwise},
    real::splat,
};

/// Writes the pixels that each face may reach, and counts the faces that are drawn.
pub(super) struct ReachOfFaces<'a, L: Lanes> {
    /// Places of the vertices in the image.
    pub(super) places: &'a [[L::Float; 2]],
    /// x and y of the vertices in NDC, where back faces are not drawn.
    pub(super) turned: Option<[&'a [L::Float]; 2]>,
    pub(super) faces: &'a [[u32; 3]],
    /// In pixels.
    pub(super) radius: L::Float,
    pub(super) size: ImageSize,
    pub(super) reaches: &'a mut [Reach],
}

/// Runs `work`, compiled for its vectors.
pub(super) fn reach_of_faces<L: Lanes>(work: ReachOfFaces<L>) -> usize {
    run::<L, _>(work)
}

impl<L: Lanes> Work for ReachOfFaces<'_, L> {
    type Output = usize;

    #[inline(always)]
    fn run(self) -> usize {
        let Self { places, turned, faces, radius, size, reaches } = self;
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
            let columns = Pixels::<L>::new(x, radius, size.width);
            let rows = Pixels::<L>::new(y, radius, size.height);
            for (lane, reach) in reaches.iter_mut().enumerate() {
                let [left, right] = [columns.start[lane] as u32, columns.end[lane] as u32];
                let [top, bottom] = [rows.start[lane] as u32, rows.end[lane] as u32];
                // A vertex that is not drawn is at infinity in both.
                let mut is_drawn = columns.highest[lane] < L::Float::from_f64(f64::INFINITY);
                if let Some([x, y]) = turned {
                    is_drawn &=
                        !is_seen_clockwise(faces[lane].map(|v| [x[v as usize], y[v as usize]]));
                }
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
struct Pixels<L: Lanes> {
    start: [i32; LANES],
    end: [i32; LANES],
    highest: [L::Float; LANES],
}

impl<L: Lanes> Pixels<L> {
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
