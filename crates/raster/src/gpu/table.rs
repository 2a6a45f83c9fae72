//! The gradient of a table, summed over the pairs of each unit, then over all units.

use cubecl::prelude::*;

use super::{
    dual::Dual,
    frame::Frame,
    pair::{Face, Lookup},
    parts::Part,
};

/// Units of a cube, which share a face.
pub(super) const UNITS: u32 = 64;

/// Adds the gradient of the table: each unit sums over its pairs into a separate table, so that sums do not depend on an order of units.
/// `partial` is `[units, rows, 4]`.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn sum_cubics(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    slots: &Array<u32>,
    upstream: &Array<f32>,
    partial: &mut Array<f32>,
    lookup: Lookup,
    frame: Frame,
    face_count: u32,
    views: u32,
    first_view: u32,
    #[comptime] second: bool,
) {
    let jobs = views * face_count;
    let rows = 2u32 * (lookup.cells + 1u32);
    let own = ABSOLUTE_POS as u32 * rows * 4u32;
    let tail = (own + 4u32 * lookup.cells) as usize;
    let stride = comptime!(if second { 12usize } else { 6usize });
    let mut job = CUBE_POS as u32;
    while job < jobs {
        let part = Part::whole(job, reaches);
        let view = part.job / face_count + first_view;
        let face = Face::new(corners, stride * part.job as usize, second);
        let mut pixel = part.start + UNIT_POS;
        while pixel < part.end {
            let (column, row) = (part.column(pixel), part.row(pixel));
            let g = upstream[frame.pixel(view, row, column) as usize];
            let pair = face.pair(frame.column_centre(column), frame.row_centre(row), lookup);
            // A pair outside the tail replaces one in the tail.
            if pair.row != lookup.cells {
                add_powers(partial, own + 4u32 * pair.row, pair.place, Dual::constant(g), second);
                partial[tail] = partial[tail] - Dual::constant(g).stored(second);
            }
            pixel += UNITS;
        }
        job += CUBE_COUNT as u32;
    }
    if !second {
        // All faces contribute their tail to pixels that they do not reach.
        let per_view = frame.height * frame.width;
        let mut pixel = ABSOLUTE_POS as u32;
        while pixel < views * per_view {
            let drawn = f32::cast_from(slots[(1u32 + pixel / per_view) as usize]);
            let g = upstream[(first_view * per_view + pixel) as usize];
            partial[tail] = partial[tail] + g * drawn;
            pixel += UNITS * CUBE_COUNT as u32;
        }
    }
}

/// Adds `g`, `g t`, `g t²` and `g t³` to four numbers from `at` on.
#[cube]
pub(super) fn add_powers(
    partial: &mut Array<f32>,
    at: u32,
    place: Dual,
    g: Dual,
    #[comptime] second: bool,
) {
    let at = at as usize;
    let first = place.mul(g);
    let square = first.mul(place);
    partial[at] = partial[at] + g.stored(second);
    partial[at + 1] = partial[at + 1] + first.stored(second);
    partial[at + 2] = partial[at + 2] + square.stored(second);
    partial[at + 3] = partial[at + 3] + square.mul(place).stored(second);
}

/// Sums the tables of all units into `gradient`, from `offset` on: one unit per coefficient.
#[cube(launch)]
pub(super) fn sum_tables(
    partial: &Array<f32>,
    gradient: &mut Array<f32>,
    units: u32,
    coefficients: u32,
    offset: u32,
) {
    let coefficient = ABSOLUTE_POS as u32;
    if coefficient >= coefficients {
        terminate!();
    }
    let mut sum = 0.0f32;
    for unit in 0..units {
        sum += partial[(unit * coefficients + coefficient) as usize];
    }
    gradient[(offset + coefficient) as usize] = sum;
}
