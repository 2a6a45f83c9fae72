//! The gradient with respect to the vertices, gathered: first per face over its pixels, then per vertex over its corners. WGSL has no
//! atomic addition of floats, and a gather has a fixed order of summation.

use cubecl::prelude::*;

use super::{
    frame::Frame,
    pair::{Cubic, Face, Lookup},
    parts::{Part, first_slot, is_cut, parts},
    reach::Reach,
};

/// Units of a cube.
pub(super) const UNITS: u32 = 64;

/// Writes the gradient of each face with respect to x and y of its corners, and after these those of parts: `gradient` becomes
/// `[views · faces + slots, 6]`. `lanes` units share a part.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn sum_faces(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    slots: &Array<u32>,
    table: &Array<f32>,
    direction: &Array<f32>,
    upstream: &Array<f32>,
    gradient: &mut Array<f32>,
    lookup: Lookup,
    frame: Frame,
    face_count: u32,
    views: u32,
    groups: u32,
    table_offset: u32,
    first_view: u32,
    #[comptime] lanes: u32,
    #[comptime] second: bool,
) {
    let jobs = views * face_count;
    let part = Part::of(ABSOLUTE_POS as u32 / lanes, reaches, slots, views, jobs);
    let view = part.job / face_count + first_view;
    let stride = comptime!(if second { 12usize } else { 6usize });
    let face = Face::new(corners, stride * part.job as usize, second);
    let mut ax = 0.0f32;
    let mut ay = 0.0f32;
    let mut bx = 0.0f32;
    let mut by = 0.0f32;
    let mut cx = 0.0f32;
    let mut cy = 0.0f32;
    let mut pixel = part.start + UNIT_POS % lanes;
    while pixel < part.end {
        let (column, row) = (part.column(pixel), part.row(pixel));
        let g = upstream[frame.pixel(view, row, column) as usize];
        let pair = face.pair(frame.column_centre(column), frame.row_centre(row), lookup);
        let cubic = Cubic::new(table, pair.row, direction, table_offset, second);
        let pull = pair.pull(cubic, g);
        let (x, y) = (pull.x, pull.y);
        ax += x.mul(pair.weight(0u32)).stored(second);
        ay += y.mul(pair.weight(0u32)).stored(second);
        bx += x.mul(pair.weight(1u32)).stored(second);
        by += y.mul(pair.weight(1u32)).stored(second);
        cx += x.mul(pair.weight(2u32)).stored(second);
        cy += y.mul(pair.weight(2u32)).stored(second);
        pixel += lanes;
    }
    // The units of a part sum one corner coordinate after the other.
    let mut shares = SharedMemory::<f32>::new(comptime!(6 * UNITS as usize));
    let at = UNIT_POS as usize;
    shares[at] = ax;
    shares[at + comptime!(UNITS as usize)] = ay;
    shares[at + comptime!(2 * UNITS as usize)] = bx;
    shares[at + comptime!(3 * UNITS as usize)] = by;
    shares[at + comptime!(4 * UNITS as usize)] = cx;
    shares[at + comptime!(5 * UNITS as usize)] = cy;
    sync_cube();
    let per_cube = comptime!(UNITS / lanes);
    let mut number = UNIT_POS;
    while number < comptime!(6 * UNITS / lanes) {
        let own = number % per_cube;
        let coordinate = number / per_cube;
        let group = CUBE_POS as u32 * per_cube + own;
        let first = coordinate * UNITS + own * lanes;
        let mut sum = 0.0f32;
        for lane in 0..lanes {
            sum += shares[(first + lane) as usize];
        }
        if group < groups {
            gradient[(6 * group + coordinate) as usize] = sum;
        }
        number += UNITS;
    }
}

/// Sums `count` numbers of the corners of each vertex into `gradient`, one unit for each of its `rows` numbers, of which those after
/// `count` are 0: `[views, rows, vertices]`, or with `by_vertex` `[views, vertices, rows]`.
///
/// `of_faces` is `[views · faces + slots, stride]`, with the numbers of the three corners from `first` on. `corners` starts with the offset
/// of each vertex's first corner, `[vertices + 1]`; the corners follow, each as `3 * face + corner`.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn gather_corners(
    of_faces: &Array<f32>,
    corners: &Array<u32>,
    reaches: &Array<u32>,
    slots: &Array<u32>,
    gradient: &mut Array<f32>,
    vertex_count: u32,
    face_count: u32,
    views: u32,
    first_view: u32,
    stride: u32,
    first: u32,
    count: u32,
    rows: u32,
    #[comptime] by_vertex: bool,
) {
    let own = ABSOLUTE_POS as u32;
    if own >= views * vertex_count * rows {
        terminate!();
    }
    let number = own % rows;
    let vertex = own / rows % vertex_count;
    let view = own / (rows * vertex_count);
    let mut sum = 0.0f32;
    let start = corners[vertex as usize];
    let end = select(number < count, corners[vertex as usize + 1], start);
    for place in start..end {
        let corner = corners[(vertex_count + 1u32 + place) as usize];
        let job = view * face_count + corner / 3u32;
        let at = first + count * (corner % 3u32) + number;
        let pixels = Reach::load(reaches, job as usize).pixels();
        let mut part = job;
        let mut end = job + 1u32;
        if is_cut(pixels, slots) {
            part = views * face_count + slots[first_slot(job, views)];
            end = part + parts(pixels);
        }
        while part < end {
            sum += of_faces[(stride * part + at) as usize];
            part += 1u32;
        }
    }
    let view = first_view + view;
    let at = if by_vertex {
        (view * vertex_count + vertex) * rows + number
    } else {
        (view * rows + number) * vertex_count + vertex
    };
    gradient[at as usize] = sum;
}
