//! Which units take which pixels of a face. A few units share a face; one that reaches many pixels is cut into parts, each with units of its
//! own, so that a ground plane takes no longer than the rest.
//!
//! `slots` holds what [`prepare`](super::prepare::prepare) has found in some views: how many slots parts take, the faces that each view draws,
//! then face and number of the part in each of [`SLOTS`] slots, then the first slot of each face. Where faces ask for more slots than there
//! are, none is cut: then there are enough large ones to keep all units busy. So what is added up in which order is always the same.

use cubecl::prelude::*;

use super::reach::Reach;

/// Pixels of a part.
pub(super) const PART: u32 = 4096;
/// Parts that there is room for.
pub(super) const SLOTS: u32 = 4096;

/// Words before the slots.
#[cube]
pub(super) fn header(views: u32) -> u32 {
    views + 1u32
}

/// Number of words in `slots`, of so many views and faces in all of them.
pub(super) fn words(views: usize, jobs: usize) -> usize {
    1 + views + 2 * SLOTS as usize + jobs
}

/// Pixels that a group of units takes, counted row by row in what a face reaches.
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
    /// The pixels of group number `group`: of the face with this number, or behind them of a slot.
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

    /// All that a face reaches: for sums of floats, whose order must not depend on who took which slot.
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

/// Whether a face that reaches so many pixels is cut.
#[cube]
pub(super) fn is_cut(pixels: u32, slots: &Array<u32>) -> bool {
    let mut cut = false;
    if pixels > PART {
        cut = slots[0] <= SLOTS;
    }
    cut
}

/// Parts of a face that reaches so many pixels, if it is cut.
#[cube]
pub(super) fn parts(pixels: u32) -> u32 {
    (pixels - 1u32) / PART + 1u32
}

/// Where the first slot of a face stands.
#[cube]
pub(super) fn first_slot(job: u32, views: u32) -> usize {
    (header(views) + 2u32 * SLOTS + job) as usize
}
