//! Assignment of the pixels of a face to units. A few units share a face; a face with many pixels is split into parts with separate units,
//! so that a ground plane takes no longer than other faces.
//!
//! `slots` holds results of [`prepare`](super::prepare::prepare) for some views: the number of slots of all parts, the number of faces
//! drawn per view, then face and part number for each of [`SLOTS`] slots, then the first slot of each face. If faces need more slots than
//! there are, none is split: then there are enough large faces to keep all units busy. The order of summation is therefore always the same.

use cubecl::prelude::*;

use super::reach::Reach;

/// Pixels of a part.
pub(super) const PART: u32 = 4096;
/// Most parts per launch.
pub(super) const SLOTS: u32 = 4096;

/// Words before the slots.
#[cube]
pub(super) fn header(views: u32) -> u32 {
    views + 1u32
}

/// Number of words in `slots`, for `views` views with `jobs` faces in total.
pub(super) fn words(views: usize, jobs: usize) -> usize {
    1 + views + 2 * SLOTS as usize + jobs
}

/// Pixels of a group of units, in row-major order of the face's reach.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Part {
    /// The face, among those of all views of the launch.
    pub(super) job: u32,
    pub(super) start: u32,
    pub(super) end: u32,
    left: u32,
    top: u32,
    width: u32,
}

#[cube]
impl Part {
    /// The pixels of group `group`: those of the face with this number, or after all faces those of a slot.
    pub(super) fn of(
        group: u32,
        reaches: &Array<u32>,
        slots: &Array<u32>,
        views: u32,
        jobs: u32,
    ) -> Part {
        let mut job = group;
        let mut start = 0u32;
        let mut most = 0xffff_ffffu32;
        if group >= jobs {
            job = 0u32;
            most = 0u32;
            let slot = group - jobs;
            let taken = slots[0];
            if taken <= SLOTS && slot < taken {
                let at = (header(views) + 2u32 * slot) as usize;
                job = slots[at];
                start = PART * slots[at + 1];
                most = start + PART;
            }
        }
        let reach = Reach::load(reaches, job as usize);
        let all = reach.pixels();
        let mut end = select(most < all, most, all);
        if group < jobs && is_cut(all, slots) {
            end = 0u32;
        }
        let width = select(reach.left < reach.right, reach.right - reach.left, 1u32);
        Part { job, start, end, left: reach.left, top: reach.top, width }
    }

    /// The whole reach of a face: for sums of floats, whose order must not depend on the assignment of slots.
    pub(super) fn whole(job: u32, reaches: &Array<u32>) -> Part {
        let reach = Reach::load(reaches, job as usize);
        let width = select(reach.left < reach.right, reach.right - reach.left, 1u32);
        Part { job, start: 0u32, end: reach.pixels(), left: reach.left, top: reach.top, width }
    }

    pub(super) fn column(self, pixel: u32) -> u32 {
        self.left + pixel % self.width
    }

    pub(super) fn row(self, pixel: u32) -> u32 {
        self.top + pixel / self.width
    }
}

/// Whether a face with a reach of `pixels` pixels is split.
#[cube]
pub(super) fn is_cut(pixels: u32, slots: &Array<u32>) -> bool {
    let mut cut = false;
    if pixels > PART {
        cut = slots[0] <= SLOTS;
    }
    cut
}

/// Number of parts of a face with a reach of `pixels` pixels, if it is split.
#[cube]
pub(super) fn parts(pixels: u32) -> u32 {
    (pixels - 1u32) / PART + 1u32
}

/// Index of the first slot of a face.
#[cube]
pub(super) fn first_slot(job: u32, views: u32) -> usize {
    (header(views) + 2u32 * SLOTS + job) as usize
}
