//! The image face by face: the units of a face add its terms to the sums of its pixels, as integers of 64 bits. No kernel needs the faces
//! of a pixel.

use cubecl::prelude::*;

use super::{
    frame::Frame,
    pair::{Cubic, Face, Lookup},
    parts::Part,
    whole::{INFINITE, MOST, SIZE, WORD, add, add_relative, mark, or_nan, relative_sum, sum},
};

/// Units of a cube of [`clear`].
pub(super) const CLEARED: u32 = 256;
/// Integer units per 1, unless the terms of all faces together could then exceed 64 bits: a term below 1 fits the lower word and takes one
/// atomic operation, with an error of at most 1.2e-10.
const UNITS_OF_ONE: f32 = WORD;

/// Writes zeros to the header of `slots` and to all `sums`, and to `scale` the bits of the factor from terms to integers, and of the
/// largest magnitude of a table row: no term is more than twice as large.
#[cube(launch)]
pub(super) fn clear(
    table: &Array<f32>,
    slots: &mut Array<u32>,
    sums: &mut Array<u32>,
    scale: &mut Array<u32>,
    header: u32,
    words: u32,
    rows: u32,
    face_count: u32,
) {
    let own = ABSOLUTE_POS as u32;
    let step = CUBE_COUNT as u32 * CLEARED;
    let mut at = own;
    while at < header {
        slots[at as usize] = 0u32;
        at += step;
    }
    let mut at = own;
    while at < words {
        sums[at as usize] = 0u32;
        at += step;
    }
    let mut largest = SharedMemory::<u32>::new(comptime!(CLEARED as usize));
    let mut most = 0u32;
    if CUBE_POS == 0 {
        let mut row = UNIT_POS;
        while row < rows {
            let mut size = 0.0f32;
            for k in 0..4usize {
                size += f32::abs(table[4 * row as usize + k]);
            }
            let bits = u32::reinterpret(size) & SIZE;
            most = select(bits > most, bits, most);
            row += CLEARED;
        }
    }
    largest[UNIT_POS as usize] = most;
    sync_cube();
    if ABSOLUTE_POS == 0 {
        for unit in 0..comptime!(CLEARED as usize) {
            let bits = largest[unit];
            most = select(bits > most, bits, most);
        }
        let size = f32::reinterpret(most);
        // Upper bound of the sums over all faces.
        let sum = 2.0f32 * size * f32::cast_from(face_count);
        let per_term = select(sum * UNITS_OF_ONE < MOST, UNITS_OF_ONE, MOST / sum);
        scale[0] = u32::reinterpret(per_term);
        scale[1] = most;
    }
}

/// Conversion of terms to integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Terms {
    /// By one scale for all pixels, the first number written by [`clear`].
    Scaled,
    /// None: only the largest term of each pixel is computed, and written in place of the scale.
    Measured,
    /// Relative to the largest term: for terms of all sizes, and for derivatives, which are unbounded.
    Relative,
}

/// Adds the terms of each face to `sums`, two words per pixel of the views of the launch; `lanes` units share a part of a face.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn splat(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    slots: &Array<u32>,
    table: &Array<f32>,
    direction: &Array<f32>,
    scale: &mut Array<Atomic<u32>>,
    sums: &mut Array<Atomic<u32>>,
    lookup: Lookup,
    frame: Frame,
    face_count: u32,
    views: u32,
    table_offset: u32,
    #[comptime] lanes: u32,
    #[comptime] terms: Terms,
    #[comptime] second: bool,
) {
    let jobs = views * face_count;
    let part = Part::of(ABSOLUTE_POS as u32 / lanes, reaches, slots, views, jobs);
    let view = part.job / face_count;
    let stride = comptime!(if second { 12usize } else { 6usize });
    let face = Face::new(corners, stride * part.job as usize, second);
    let tail = Cubic::new(table, lookup.cells, direction, table_offset, second).first();
    let mut of_all = 0.0f32;
    if terms == Terms::Scaled {
        of_all = f32::reinterpret(scale[0].load());
    }
    let mut pixel = part.start + UNIT_POS % lanes;
    while pixel < part.end {
        let (column, row) = (part.column(pixel), part.row(pixel));
        let pair = face.pair(frame.column_centre(column), frame.row_centre(row), lookup);
        let cubic = Cubic::new(table, pair.row, direction, table_offset, second);
        let term = pair.value(cubic).sub(tail).stored(second);
        let at = frame.pixel(view, row, column) as usize;
        if terms == Terms::Scaled {
            add(sums, 2 * at, term * of_all);
        } else if terms == Terms::Measured {
            scale[at].fetch_max(mark(term));
        } else {
            add_relative(sums, 2 * at, term, scale[at].load(), face_count);
        }
        pixel += lanes;
    }
}

/// Converts the sums of [`splat`] to floats, and adds the constants of all faces at pixels that they do not reach: one unit per pixel.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn settle(
    words: &Array<u32>,
    slots: &Array<u32>,
    table: &Array<f32>,
    direction: &Array<f32>,
    scale: &Array<u32>,
    sums: &mut Array<f32>,
    lookup: Lookup,
    face_count: u32,
    per_view: u32,
    first: u32,
    pixels: u32,
    table_offset: u32,
    #[comptime] terms: Terms,
    #[comptime] second: bool,
) {
    let pixel = ABSOLUTE_POS as u32;
    if pixel >= pixels {
        terminate!();
    }
    let tail = Cubic::new(table, lookup.cells, direction, table_offset, second).first();
    let drawn = f32::cast_from(slots[(1u32 + pixel / per_view) as usize]);
    let place = 2 * pixel as usize;
    let total = if terms == Terms::Scaled {
        let scaled = sum(words, place) / f32::reinterpret(scale[0]);
        // A table with a NaN makes all of them NaN.
        or_nan(scale[1] < INFINITE, scaled)
    } else {
        relative_sum(words, place, scale[pixel as usize], face_count)
    };
    sums[(first + pixel) as usize] = total + tail.scale(drawn).stored(second);
}
