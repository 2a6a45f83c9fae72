//! The corners of every face, contiguous, and the pixels it may reach.

use cubecl::prelude::*;

use super::{
    frame::Frame,
    parts::{PART, SLOTS, first_slot, header, parts},
    reach::Reach,
    whole::SIZE as MAGNITUDE,
};

/// Bits of 1e6: projected coordinates beyond it (NDC) are not drawn. Compared as bits, since floats of one sign have the order of their
/// bits, and a shader may assume that no float is NaN.
const FAR_AWAY_BITS: u32 = 1e6f32.to_bits();
/// Margin for rounding, in pixels.
const MARGIN: f32 = 0.01;

/// Whether a corner may be drawn: `x` and `y` not far away, `z` not nearer than the float with the bits `near` and not beyond that with the
/// bits `far`; false for NaN.
#[cube]
fn is_drawn(x: f32, y: f32, z: f32, near: u32, far: u32) -> bool {
    let x = u32::reinterpret(x) & MAGNITUDE;
    let y = u32::reinterpret(y) & MAGNITUDE;
    let z = u32::reinterpret(z);
    x <= FAR_AWAY_BITS && y <= FAR_AWAY_BITS && z >= near && z <= far
}

/// First pixel of an axis of `side` pixels whose centre lies at or after `low` (NDC).
#[cube]
fn first_pixel(low: f32, side: u32, shorter: u32) -> u32 {
    let side = f32::cast_from(side);
    let place = (low * f32::cast_from(shorter) + side - 1.0f32) * 0.5f32 - MARGIN;
    let place = select(place > 0.0f32, place, 0.0f32);
    let place = select(place < side, place, side);
    let whole = u32::cast_from(place);
    select(f32::cast_from(whole) < place, whole + 1u32, whole)
}

/// The pixel after the last whose centre lies at or before `high` (NDC).
#[cube]
fn end_pixel(high: f32, side: u32, shorter: u32) -> u32 {
    let side = f32::cast_from(side);
    let place = (high * f32::cast_from(shorter) + side + 1.0f32) * 0.5f32 + MARGIN;
    let place = select(place > 0.0f32, place, 0.0f32);
    u32::cast_from(select(place < side, place, side))
}

#[cube]
fn least(a: f32, b: f32, c: f32) -> f32 {
    let least = select(a < b, a, b);
    select(c < least, c, least)
}

#[cube]
fn largest(a: f32, b: f32, c: f32) -> f32 {
    let largest = select(a > b, a, b);
    select(c > largest, c, largest)
}

/// Units of a cube of [`prepare`], all of one view.
pub(super) const PREPARED: u32 = 256;

/// Writes corners and reach of every face of every view, one unit each, and to `slots`, whose first words are 0, the split of faces (see
/// [`parts`](super::parts)) and the number of faces drawn per view, on the image or outside of it.
///
/// `vertices` is `[views, 3, vertices]`; `direction` starts with its derivatives. `corners` becomes `[views, faces, 6]`, in a pass of
/// second order `[views, faces, 12]` with the derivatives last; with `depths` the depths of the three corners follow, and their
/// derivatives. With `culls` back faces are not drawn.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn prepare(
    vertices: &Array<f32>,
    direction: &Array<f32>,
    faces: &Array<u32>,
    corners: &mut Array<f32>,
    reaches: &mut Array<u32>,
    slots: &mut Array<Atomic<u32>>,
    frame: Frame,
    first_view: u32,
    views: u32,
    vertex_count: u32,
    face_count: u32,
    near: u32,
    far: u32,
    radius: f32,
    #[comptime] depths: bool,
    #[comptime] culls: bool,
    #[comptime] second: bool,
) {
    let view = CUBE_POS_Y;
    let face = CUBE_POS_X * PREPARED + UNIT_POS;
    let mut counts = SharedMemory::<u32>::new(comptime!(PREPARED as usize));
    let mut count = 0u32;
    if face < face_count {
        let job = view * face_count + face;
        let reach = prepare_face(
            vertices,
            direction,
            faces,
            corners,
            frame,
            first_view + view,
            face,
            job,
            vertex_count,
            near,
            far,
            radius,
            depths,
            culls,
            second,
        );
        let at = 4 * job as usize;
        reaches[at] = reach.left;
        reaches[at + 1] = reach.right;
        reaches[at + 2] = reach.top;
        reaches[at + 3] = reach.bottom;
        count = select(reach.left <= reach.right, 1u32, 0u32);
        let pixels = reach.pixels();
        if pixels > PART {
            let parts = parts(pixels);
            let first = slots[0].fetch_add(parts);
            slots[first_slot(job, views)].store(first);
            let end = select(first + parts < SLOTS, first + parts, SLOTS);
            for slot in first..end {
                let at = (header(views) + 2u32 * slot) as usize;
                slots[at].store(job);
                slots[at + 1].store(slot - first);
            }
        }
    }
    counts[UNIT_POS as usize] = count;
    sync_cube();
    if UNIT_POS == 0 {
        let mut total = 0u32;
        for unit in 0..comptime!(PREPARED as usize) {
            total += counts[unit];
        }
        slots[(1u32 + view) as usize].fetch_add(total);
    }
}

/// Writes the corners of one face, and returns its reach.
#[cube]
#[allow(clippy::too_many_arguments)]
fn prepare_face(
    vertices: &Array<f32>,
    direction: &Array<f32>,
    faces: &Array<u32>,
    corners: &mut Array<f32>,
    frame: Frame,
    view: u32,
    face: u32,
    job: u32,
    vertex_count: u32,
    near: u32,
    far: u32,
    radius: f32,
    #[comptime] depths: bool,
    #[comptime] culls: bool,
    #[comptime] second: bool,
) -> Reach {
    let vertex_count = vertex_count as usize;
    let face = face as usize;
    let origin = 3 * view as usize * vertex_count;
    let a = origin + faces[3 * face] as usize;
    let b = origin + faces[3 * face + 1] as usize;
    let c = origin + faces[3 * face + 2] as usize;
    let flat = comptime!(if second { 12usize } else { 6usize });
    let stride = comptime!(if depths { flat / 2 * 3 } else { flat });
    let at = stride * job as usize;
    let (ax, ay, az) = (vertices[a], vertices[a + vertex_count], vertices[a + 2 * vertex_count]);
    let (bx, by, bz) = (vertices[b], vertices[b + vertex_count], vertices[b + 2 * vertex_count]);
    let (cx, cy, cz) = (vertices[c], vertices[c + vertex_count], vertices[c + 2 * vertex_count]);
    corners[at] = ax;
    corners[at + 1] = ay;
    corners[at + 2] = bx;
    corners[at + 3] = by;
    corners[at + 4] = cx;
    corners[at + 5] = cy;
    if second {
        corners[at + 6] = direction[a];
        corners[at + 7] = direction[a + vertex_count];
        corners[at + 8] = direction[b];
        corners[at + 9] = direction[b + vertex_count];
        corners[at + 10] = direction[c];
        corners[at + 11] = direction[c + vertex_count];
    }
    if depths {
        corners[at + flat] = az;
        corners[at + flat + 1] = bz;
        corners[at + flat + 2] = cz;
        if second {
            corners[at + flat + 3] = direction[a + 2 * vertex_count];
            corners[at + flat + 4] = direction[b + 2 * vertex_count];
            corners[at + flat + 5] = direction[c + 2 * vertex_count];
        }
    }
    let drawn = is_drawn(ax, ay, az, near, far)
        && is_drawn(bx, by, bz, near, far)
        && is_drawn(cx, cy, cz, near, far);
    // Back faces have corners in clockwise order.
    let drawn = drawn && (comptime!(!culls) || (bx - ax) * (cy - ay) >= (by - ay) * (cx - ax));
    let left = first_pixel(least(ax, bx, cx) - radius, frame.width, frame.shorter);
    let right = end_pixel(largest(ax, bx, cx) + radius, frame.width, frame.shorter);
    let top = first_pixel(-largest(ay, by, cy) - radius, frame.height, frame.shorter);
    let bottom = end_pixel(-least(ay, by, cy) + radius, frame.height, frame.shorter);
    let seen = drawn && left < right && top < bottom;
    let hidden = select(drawn, 0u32, 1u32);
    Reach {
        left: select(seen, left, hidden),
        right: select(seen, right, 0u32),
        top: select(seen, top, 0u32),
        bottom: select(seen, bottom, 0u32),
    }
}
