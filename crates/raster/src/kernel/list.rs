//! The pixels that faces may reach, as a list of chunks that a walk takes one after the other.

use std::ops::Range;

use super::{
    face::Faces,
    float::Float as _,
    lanes::{GROUP, LANES},
    reach::Reach,
    real::{Float, Real},
    scene::{Place, Scene},
};

/// Faces that are listed together: what is prepared of them stays near the processor.
pub(crate) const LISTED: usize = 64;
/// Most rows of a band.
const MOST_ROWS: usize = 64;
/// Fewer of them for fewer views than this, so that there are bands for all threads.
const FEW_VIEWS: usize = 4;

/// Rows of a band. Bits must not depend on the number of threads, so neither may this.
pub(crate) fn rows_of_bands(views: usize) -> usize {
    if views < FEW_VIEWS { MOST_ROWS / 2 } else { MOST_ROWS }
}

/// Neighbours of a row that a face may reach.
#[derive(Clone, Copy, Default)]
pub(crate) struct Group<F> {
    /// Column of the first one.
    pub(crate) column: u32,
    /// Position of the first one in the band.
    pub(crate) at: u32,
    /// Height of all of them, in NDC.
    pub(crate) y: F,
}

/// Two groups of one face.
pub(crate) type Chunk<F> = [Group<F>; 2];

/// Faces of a band and their pixels.
pub(crate) struct List<T: Real> {
    pub(crate) faces: Vec<Faces<T>>,
    /// Two groups of one face make a chunk; more than there are.
    groups: Vec<Group<Float<T>>>,
    /// Which face of the list each chunk belongs to.
    owners: Vec<u32>,
}

impl<T: Real> List<T> {
    pub(crate) fn new() -> Self {
        let faces = Vec::with_capacity(LISTED / LANES);
        Self { faces, groups: Vec::new(), owners: Vec::new() }
    }

    /// Groups of each chunk, and the face that it belongs to.
    pub(crate) fn chunks(&self) -> (&[Chunk<Float<T>>], &[u32]) {
        (&self.groups.as_chunks().0[..self.owners.len()], &self.owners)
    }

    /// Lists the pixels of some faces of a band, given by their numbers.
    #[inline(always)]
    pub(crate) fn fill(&mut self, scene: &Scene<T>, place: &Place<T>, numbers: &[u32]) {
        self.faces.clear();
        self.owners.clear();
        let mut listed = 0;
        let band = scene.band_rows(place.band);
        let stride = scene.stride();
        // An odd group is joined by one on which nothing depends.
        let at = (band.len() * stride) as u32;
        let nowhere = Group { column: 0, at, y: Float::<T>::ZERO };
        for (block, numbers) in numbers.chunks(LANES).enumerate() {
            let faces = place.faces(scene, numbers);
            for (lane, &number) in numbers.iter().enumerate() {
                let reach = place.view.reaches[number as usize];
                let rows = within(band.clone(), reach);
                let most = listed + rows.len() * stride.div_ceil(GROUP) + 2;
                if self.groups.len() < most {
                    self.groups.resize(2 * most, Group::default());
                }
                for first in rows.clone().step_by(LANES) {
                    let (starts, ends) =
                        faces.columns(lane, scene.heights(first), reach, scene.size);
                    let mut at = (first - band.start) * stride;
                    for (k, y) in scene.heights(first).iter().take(rows.end - first).enumerate() {
                        let (column, groups) = (starts[k] as usize, groups_of(starts[k], ends[k]));
                        // Most rows have one group or two. These are written without asking, since a branch
                        // that nobody can foresee costs more.
                        let group = |n: usize| {
                            let (column, at) = (column + n * GROUP, at + column + n * GROUP);
                            Group { column: column as u32, at: at as u32, y: *y }
                        };
                        let free = &mut self.groups[listed..listed + 2];
                        (free[0], free[1]) = (group(0), group(1));
                        for n in 2..groups {
                            self.groups[listed + n] = group(n);
                        }
                        listed += groups;
                        at += stride;
                    }
                }
                if listed % 2 == 1 {
                    self.groups[listed] = nowhere;
                    listed += 1;
                }
                self.owners.resize(listed / 2, (block * LANES + lane) as u32);
            }
            self.faces.push(faces);
        }
    }
}

/// Groups that hold the columns from `start` to before `end`.
#[inline(always)]
fn groups_of(start: i32, end: i32) -> usize {
    ((end - start).max(0) as usize).div_ceil(GROUP)
}

/// Rows of a band that a face may reach.
#[inline(always)]
pub(crate) fn within(band: Range<usize>, reach: Reach) -> Range<usize> {
    band.start.max(reach.top as usize)..band.end.min(reach.bottom as usize)
}
