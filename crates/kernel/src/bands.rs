//! Lists of the faces whose support reaches each band of rows, as culling leaves them.

mod face_reach;

use std::ops::Range;

use rayon::prelude::*;

use self::face_reach::{ReachOfFaces, reach_of_faces};
use super::{
    float::{Vectors, on_vectors},
    lanes::GROUP,
    reach::{Reach, in_pixels},
    tasks::{filled, task},
};
use crate::ImageSize;

/// Most rows of a band on the average.
const MOST_ROWS: usize = 64;
/// Fewer views than this are cut into bands of half as many rows.
const FEW_VIEWS: usize = 4;
/// No band has more rows: a list has eight bits for them.
const ROWS: usize = 255;
/// A band has at least as many rows, unless too few are left for the bands below: a list takes up to eight rows of a face at once.
const LEAST_ROWS: usize = 6;
/// Faces or vertices per rayon task.
const AT_ONCE: usize = 1 << 11;
/// Work of a face in each row, in addition to its groups of pixels.
const ROW_OF_FACE: i64 = 1;

/// Number of bands that each view is cut into. Independent of the number of threads, so that the bits of results are too.
pub fn bands_of_view(views: usize, size: ImageSize) -> usize {
    let rows = if views < FEW_VIEWS { MOST_ROWS / 2 } else { MOST_ROWS };
    size.height.div_ceil(rows)
}

/// Faces of one view by band, in ascending order of faces.
#[derive(Debug)]
pub(crate) struct View {
    /// The first row of each band, and the row after the last one.
    starts: Vec<u32>,
    /// `entries[offsets[b]..offsets[b + 1]]` are the faces of band b.
    offsets: Vec<u32>,
    entries: Vec<u32>,
    /// Pixels that each face may reach; none for a face that is not drawn.
    pub(crate) reaches: Vec<Reach>,
    /// Number of faces that are drawn, on the image or outside of it.
    pub(crate) drawn: usize,
    /// Distance outside each face that its support reaches, in NDC; empty if it is the same for all faces.
    pub(crate) radii: Vec<f32>,
}

impl View {
    /// Lists the faces by the pixels that each reaches, in `count` bands of about equal work. `drawn` is the number of faces drawn.
    pub(crate) fn new(
        reaches: Vec<Reach>,
        radii: Vec<f32>,
        drawn: usize,
        count: usize,
        size: ImageSize,
    ) -> Self {
        let fits = count <= size.height && size.height <= ROWS * count;
        assert!(fits, "{count} bands of an image of {} rows", size.height);
        let starts = starts(&reaches, count, size);
        let mut band_of = vec![0u32; size.height];
        for (band, rows) in starts.windows(2).enumerate() {
            band_of[rows[0] as usize..rows[1] as usize].fill(band as u32);
        }
        let (offsets, entries) = by_band(&reaches, &band_of, count);
        Self { starts, offsets, entries, reaches, drawn, radii }
    }

    /// Faces of band `band`.
    pub(crate) fn faces(&self, band: usize) -> &[u32] {
        &self.entries[self.offsets[band] as usize..self.offsets[band + 1] as usize]
    }

    /// Rows of the image that band `band` holds.
    pub(crate) fn rows(&self, band: usize) -> Range<usize> {
        self.starts[band] as usize..self.starts[band + 1] as usize
    }

    /// Cuts an image into its bands.
    pub(crate) fn cut<'a, F>(&self, mut image: &'a mut [F], width: usize) -> Vec<&'a mut [F]> {
        let rows = self.starts.windows(2).map(|rows| (rows[1] - rows[0]) as usize);
        rows.map(|rows| image.split_off_mut(..rows * width).expect("rows of the image")).collect()
    }
}

/// Faces that are drawn, and where.
#[derive(Clone, Copy)]
pub(crate) struct Drawn<'a> {
    pub(crate) faces: &'a [[u32; 3]],
    pub(crate) size: ImageSize,
    /// Depth below which a vertex counts as behind the camera.
    pub(crate) near: f64,
    /// Distance outside a face that its support reaches, in NDC.
    pub(crate) radius: f64,
    /// Whether back faces are not drawn.
    pub(crate) culls: bool,
}

/// The faces that reach each band of rows, for all views.
///
/// The example of the [crate](crate) makes them once for all passes.
#[derive(Debug)]
pub struct Bands {
    pub(crate) views: Vec<View>,
    /// Bands of a view.
    pub(crate) count: usize,
}

impl Bands {
    /// Lists the faces of each of `count` bands of each view. `vertices` `[views, 3, vertices]` holds x, y in
    /// NDC and the depth; a face enters the bands that its bounding box, grown by the radius, touches.
    pub(crate) fn new<F: Vectors>(
        vertices: &[F],
        vertices_per_view: usize,
        drawn: Drawn<'_>,
        count: usize,
    ) -> Self {
        let Drawn { faces, size, culls, .. } = drawn;
        let radius = F::from_f64(0.5 * drawn.radius * size.shorter() as f64);
        let near = F::from_f64(drawn.near);
        let view = |vertices: &[F]| {
            let (x, rest) = vertices.split_at(vertices_per_view);
            let (y, z) = rest.split_at(vertices_per_view);
            let mut places = filled([F::ZERO; 2], vertices_per_view);
            places.par_chunks_mut(AT_ONCE).enumerate().for_each(|(chunk, places)| {
                task("places", || {
                    for (k, place) in (chunk * AT_ONCE..).zip(places) {
                        *place = in_pixels([x[k], y[k], z[k]], near, size);
                    }
                });
            });
            let places = &places;
            let mut reaches = filled(Reach::NOTHING, faces.len());
            let chunks = faces.par_chunks(AT_ONCE).zip(reaches.par_chunks_mut(AT_ONCE));
            let reach = |(faces, reaches)| {
                task("reach", || {
                    let turned = culls.then_some([x, y]);
                    on_vectors!(reach_of_faces::<F>(ReachOfFaces {
                        places,
                        turned,
                        faces,
                        radius,
                        size,
                        reaches
                    }))
                })
            };
            let drawn = chunks.map(reach).sum();
            View::new(reaches, Vec::new(), drawn, count, size)
        };
        let views = vertices.par_chunks(3 * vertices_per_view.max(1)).map(view).collect();
        Self { views, count }
    }
}

/// Rows at which bands start, so that each is about as much work.
fn starts(reaches: &[Reach], count: usize, size: ImageSize) -> Vec<u32> {
    if count == 1 {
        return vec![0, size.height as u32];
    }
    // Work that starts and work that ends at each row.
    let changes = |reaches: &[Reach]| {
        task("work", || {
            let mut changes = vec![0i64; size.height + 1];
            for reach in reaches {
                let groups = i64::from((reach.right - reach.left).div_ceil(GROUP as u32));
                let work = if reach.top < reach.bottom { groups + ROW_OF_FACE } else { 0 };
                changes[reach.top as usize] += work;
                changes[reach.bottom as usize] -= work;
            }
            changes
        })
    };
    let add = |mut all: Vec<i64>, some: Vec<i64>| {
        all.iter_mut().zip(some).for_each(|(all, some)| *all += some);
        all
    };
    let changes = reaches
        .par_chunks(AT_ONCE.max(8 * size.height))
        .map(changes)
        .reduce_with(add)
        .unwrap_or_default();
    let (mut of_row, mut all) = (0, 0);
    // The work of each row and of those above it.
    let until: Vec<i64> = (0..size.height)
        .map(|row| {
            of_row += changes.get(row).copied().unwrap_or_default();
            all += of_row + (size.width / GROUP) as i64;
            all
        })
        .collect();
    let mut starts = vec![0];
    for band in 1..count {
        let last = starts[band - 1];
        // An even share of the remaining work; enough rows for the other bands, and at most `ROWS`.
        let left = count - band;
        let done = if last == 0 { 0 } else { until[last - 1] };
        let share = done + (all - done) / (left as i64 + 1);
        let row = until.partition_point(|&until| until <= share);
        // The nearest row, so that the last bands do not take what all others leave.
        let above = row.checked_sub(1).map_or(0, |row| until[row]);
        let row =
            row + usize::from(until.get(row).is_some_and(|&below| below - share < share - above));
        let row = row.max(last + LEAST_ROWS);
        let most = (last + ROWS).min(size.height - left);
        let least = size.height.saturating_sub(left * ROWS);
        starts.push(row.min(most).max(least).max(last + 1));
    }
    starts.push(size.height);
    starts.into_iter().map(|row| row as u32).collect()
}

/// Sorts faces into the bands that they reach, `band_of` the rows: where each band begins, and the faces.
fn by_band(reaches: &[Reach], band_of: &[u32], count: usize) -> (Vec<u32>, Vec<u32>) {
    let some = |(chunk, reaches): (usize, &[Reach])| {
        task("lists", || some_by_band(reaches, (chunk * AT_ONCE) as u32, band_of, count))
    };
    let mut parts: Vec<_> = reaches.par_chunks(AT_ONCE).enumerate().map(some).collect();
    if parts.len() == 1 {
        return parts.remove(0);
    }
    let mut offsets = vec![0u32; count + 1];
    for band in 0..count {
        let own = parts.iter().map(|(starts, _)| starts[band + 1] - starts[band]);
        offsets[band + 1] = offsets[band] + own.sum::<u32>();
    }
    let mut entries = filled(0u32, offsets[count] as usize);
    let mut left = &mut entries[..];
    let lists: Vec<_> = offsets
        .windows(2)
        .map(|ends| left.split_off_mut(..(ends[1] - ends[0]) as usize).expect("entries"))
        .collect();
    lists.into_par_iter().enumerate().for_each(|(band, mut list)| {
        task("lists together", || {
            for (starts, faces) in &parts {
                let own = &faces[starts[band] as usize..starts[band + 1] as usize];
                list.split_off_mut(..own.len()).expect("entries").copy_from_slice(own);
            }
        });
    });
    (offsets, entries)
}

/// Sorts some faces, the first of which has number `first`.
fn some_by_band(
    reaches: &[Reach],
    first: u32,
    band_of: &[u32],
    count: usize,
) -> (Vec<u32>, Vec<u32>) {
    let bands = |reach: &Reach| match reach.top < reach.bottom {
        true => {
            let last = band_of[reach.bottom as usize - 1];
            band_of[reach.top as usize] as usize..last as usize + 1
        }
        false => 0..0,
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
    for (face, reach) in (first..).zip(reaches) {
        for slot in &mut next[bands(reach)] {
            entries[*slot as usize] = face;
            *slot += 1;
        }
    }
    (offsets, entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(height: usize) -> ImageSize {
        ImageSize { height, width: 64 }
    }

    /// Faces of 9 rows and 8 columns, more and more of them downwards, and none above a third.
    fn reaches(height: u32, count: u32) -> Vec<Reach> {
        let face = |k: u32| {
            let place = (f64::from(k) / f64::from(count)).sqrt();
            let top = height / 3 + (place * f64::from(height - height / 3 - 9)) as u32;
            Reach { top, bottom: top + 9, left: k % 50, right: k % 50 + 8 }
        };
        (0..count).map(face).collect()
    }

    #[test]
    fn bands_hold_all_rows_and_about_as_much_work() {
        for (height, count) in [(256, 8), (1024, 64), (700, 3), (300, 2), (40, 1), (17, 16)] {
            let reaches = reaches(height, 5000);
            let starts = starts(&reaches, count, size(height as usize));
            assert_eq!((starts[0], starts[count], starts.len()), (0, height, count + 1));
            let rows: Vec<u32> = starts.windows(2).map(|rows| rows[1] - rows[0]).collect();
            assert!(rows.iter().all(|&rows| (1..=255).contains(&rows)), "{rows:?}");
        }
        let reaches = reaches(1024, 5000);
        let starts = starts(&reaches, 16, size(1024));
        let work = |rows: &[u32]| {
            let of = |r: &Reach| r.bottom.min(rows[1]).saturating_sub(r.top.max(rows[0]));
            reaches.iter().map(of).sum::<u32>()
        };
        let work: Vec<u32> = starts.windows(2).map(work).collect();
        let (most, all) = (*work.iter().max().unwrap(), work.iter().sum::<u32>());
        assert!(most * 16 < all * 5 / 4, "{work:?}");
        // The last bands do not take the remainders of those above them: ends above the nearest row give 4 %.
        let lower = work[8..].iter().sum::<u32>();
        assert!(f64::from(most) * 8.0 < 1.025 * f64::from(lower), "{work:?}");
    }

    #[test]
    fn every_face_is_listed_in_the_bands_that_it_reaches_and_in_no_other() {
        // More faces than one task takes, and some that reach nothing.
        let mut reaches = reaches(256, 40_000);
        reaches.iter_mut().step_by(7).for_each(|reach| *reach = Reach::NOTHING);
        let view = View::new(reaches.clone(), Vec::new(), 0, 8, size(256));
        for band in 0..8 {
            let rows = view.rows(band);
            let reaches_it = |r: &Reach| {
                (r.top as usize) < rows.end && r.bottom as usize > rows.start && r.top < r.bottom
            };
            let expected = (0u32..).zip(&reaches).filter(|(_, reach)| reaches_it(reach));
            assert!(view.faces(band).iter().copied().eq(expected.map(|(face, _)| face)));
        }
    }
}
