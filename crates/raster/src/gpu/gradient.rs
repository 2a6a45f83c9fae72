//! The gradient to the vertices, gathered: first per face over its pixels, then per vertex over its
//! corners. WGSL has no atomic addition of floats, and a gather always sums in one order.

use cubecl::prelude::*;

use super::{
    frame::Frame,
    pair::{Cubic, Face, Lookup},
    reach::Reach,
};

/// Units that share a face.
pub(super) const UNITS: u32 = 32;

/// Writes the gradient of each face to x and y of its three corners, one cube a face: `gradient`
/// becomes `[views, faces, 6]`.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn sum_faces(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    table: &Array<f32>,
    direction: &Array<f32>,
    upstream: &Array<f32>,
    gradient: &mut Array<f32>,
    lookup: Lookup,
    frame: Frame,
    face_count: u32,
    jobs: u32,
    table_offset: u32,
    first_view: u32,
    #[comptime] second: bool,
) {
    let job = CUBE_POS;
    if job >= jobs as usize {
        terminate!();
    }
    let view = job as u32 / face_count + first_view;
    let reach = Reach::load(reaches, job);
    let stride = comptime!(if second { 12usize } else { 6usize });
    let face = Face::new(corners, stride * job, second);
    let mut ax = 0.0f32;
    let mut ay = 0.0f32;
    let mut bx = 0.0f32;
    let mut by = 0.0f32;
    let mut cx = 0.0f32;
    let mut cy = 0.0f32;
    let mut pixel = UNIT_POS;
    let mut end = 0u32;
    let mut width = 1u32;
    if reach.left < reach.right {
        width = reach.right - reach.left;
        end = width * (reach.bottom - reach.top);
    }
    while pixel < end {
        let column = reach.left + pixel % width;
        let row = reach.top + pixel / width;
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
        pixel += UNITS;
    }
    // One corner coordinate after the other: unit k adds up coordinate k.
    let mut shares = SharedMemory::<f32>::new(comptime!(6 * UNITS as usize));
    let at = UNIT_POS as usize;
    shares[at] = ax;
    shares[at + comptime!(UNITS as usize)] = ay;
    shares[at + comptime!(2 * UNITS as usize)] = bx;
    shares[at + comptime!(3 * UNITS as usize)] = by;
    shares[at + comptime!(4 * UNITS as usize)] = cx;
    shares[at + comptime!(5 * UNITS as usize)] = cy;
    sync_cube();
    if UNIT_POS < 6 {
        let mut sum = 0.0f32;
        for unit in 0..UNITS {
            sum += shares[(UNIT_POS * UNITS + unit) as usize];
        }
        gradient[6 * job + UNIT_POS as usize] = sum;
    }
}

/// Adds up the corners of each vertex into `gradient` `[views, 3, vertices]`, one unit a vertex.
///
/// `corners` starts with the place of each vertex's first corner, `[vertices + 1]`; the corners
/// follow, each as `3 * face + corner`. The depth gets 0: a silhouette does not see it.
#[cube(launch)]
pub(super) fn sum_vertices(
    of_faces: &Array<f32>,
    corners: &Array<u32>,
    gradient: &mut Array<f32>,
    vertex_count: u32,
    face_count: u32,
    jobs: u32,
    first_view: u32,
) {
    let job = ABSOLUTE_POS as u32;
    if job >= jobs {
        terminate!();
    }
    let vertex = job % vertex_count;
    let view = job / vertex_count;
    let mut x = 0.0f32;
    let mut y = 0.0f32;
    let start = corners[vertex as usize];
    let end = corners[vertex as usize + 1];
    for place in start..end {
        let corner = corners[(vertex_count + 1u32 + place) as usize];
        let at = (6u32 * view * face_count + 2u32 * corner) as usize;
        x += of_faces[at];
        y += of_faces[at + 1];
    }
    let at = (3u32 * (first_view + view) * vertex_count + vertex) as usize;
    gradient[at] = x;
    gradient[at + vertex_count as usize] = y;
    gradient[at + 2 * vertex_count as usize] = 0.0f32;
}
