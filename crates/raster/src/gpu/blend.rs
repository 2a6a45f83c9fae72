//! Colours of faces that share pixels: the image, one unit a pixel, and its gradient, gathered per face over its pixels and then per vertex
//! over its corners.

use cubecl::prelude::*;

use super::TILE;
use super::{
    cells::Cells,
    dual::{Dual, load},
    frame::Frame,
    gradient::UNITS,
    reach::Reach,
    shown::{Kind, Shown, Weights},
};

/// Numbers of a pixel that a gradient needs: the logarithm of all weights, and what the image is to the upstream, with their derivatives.
pub(super) const OF_PIXEL: usize = 4;

/// Writes each pixel of the image, `[views, channels + 1, height, width]`, or in a pass of second order its derivative.
///
/// With `pull` it also writes to `pixels`, for each pixel, [`OF_PIXEL`] numbers and the gradient of the background, `channels + 1` numbers; the
/// image itself is then only written in a pass of second order.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn blend_pixels(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    cells: &Array<u32>,
    numbers: &Array<f32>,
    direction: &Array<f32>,
    entries: &Array<u32>,
    upstream: &Array<f32>,
    pixels: &mut Array<f32>,
    image: &mut Array<f32>,
    of_cells: Cells,
    weights: Weights,
    frame: Frame,
    first_view: u32,
    #[comptime] kind: Kind,
    #[comptime] pull: bool,
) {
    let column = CUBE_POS_X * TILE + UNIT_POS_X;
    let row = CUBE_POS_Y * TILE + UNIT_POS_Y;
    let view = CUBE_POS_Z;
    if column >= frame.width || row >= frame.height {
        terminate!();
    }
    let channels = comptime!(kind.channels);
    let second = comptime!(kind.second);
    let px = frame.column_centre(column);
    let py = frame.row_centre(row);
    let along = weights.along;
    let stride = comptime!(if second { 18usize } else { 9usize });
    let first_attribute = weights.attributes + (first_view + view) * weights.per_view;
    let last = weights.background as usize + channels;
    let log_behind = load(numbers, last, direction, along as usize + last, second);

    // Sums of weights relative to the largest so far, and of weights times channels.
    let mut largest = log_behind.value;
    let mut total = 0.0f32;
    let mut total_tangent = 0.0f32;
    let mut values = Array::<f32>::new(channels);
    let mut tangents = Array::<f32>::new(channels);
    for channel in 0..channels {
        values[channel] = 0.0f32;
        tangents[channel] = 0.0f32;
    }
    let first_word = of_cells.first_word(view, column, row);
    for word in 0..of_cells.words {
        let mut bits = cells[(first_word + word) as usize];
        while bits != 0 {
            let face = 32 * word + bits.trailing_zeros();
            bits &= bits - 1u32;
            let job = (view * of_cells.face_count + face) as usize;
            if Reach::load(reaches, job).holds(column, row) {
                let shown = Shown::new(
                    corners,
                    stride * job,
                    entries,
                    face as usize,
                    first_attribute,
                    kind,
                );
                let pair = shown.pair(px, py, weights, numbers, direction, kind);
                if pair.counts(weights) {
                    let log = pair.log_edge.value + pair.log_depth.value;
                    if log > largest {
                        let shrunk = f32::exp(largest - log);
                        total *= shrunk;
                        total_tangent *= shrunk;
                        for channel in 0..channels {
                            values[channel] = values[channel] * shrunk;
                            tangents[channel] = tangents[channel] * shrunk;
                        }
                        largest = log;
                    }
                    let share = pair.share(Dual::constant(largest), weights).whole;
                    total += share.value;
                    total_tangent += share.tangent;
                    if kind.is_textured {
                        let sample = shown.sample(pair, weights, numbers, direction, kind);
                        for channel in 0..channels {
                            let own = sample.texels(numbers, direction, weights, channel, second);
                            let seen = share.mul(sample.between(own));
                            values[channel] = values[channel] + seen.value;
                            tangents[channel] = tangents[channel] + seen.tangent;
                        }
                    } else {
                        for channel in 0..channels {
                            let own = shown.attribute(numbers, direction, along, channel, second);
                            let seen = share.mul(pair.weights.mul(own).sum());
                            values[channel] = values[channel] + seen.value;
                            tangents[channel] = tangents[channel] + seen.tangent;
                        }
                    }
                }
            }
        }
    }

    let total = Dual { value: total, tangent: total_tangent };
    let behind = log_behind.sub(Dual::constant(largest)).exp();
    let whole_weight = total.add(behind);
    let per_total = whole_weight.recip();
    let covered = total.mul(per_total);
    let rest = behind.mul(per_total);
    let plane = frame.height * frame.width;
    let in_plane = row * frame.width + column;
    let planes = comptime!(kind.channels as u32 + 1);
    let first = ((first_view + view) * planes * plane + in_plane) as usize;
    let step = plane as usize;
    let own = frame.pixel(first_view + view, row, column) as usize
        * comptime!(OF_PIXEL + kind.channels + 1);
    let mut of_share = 0.0f32;
    if pull {
        of_share = upstream[first + channels * step];
    }
    // What the upstream makes of the image, and of the background alone.
    let mut whole = covered.value * of_share;
    let mut whole_tangent = covered.tangent * of_share;
    let mut alone = 0.0f32;
    let mut alone_tangent = 0.0f32;
    for channel in 0..channels {
        let at = weights.background as usize + channel;
        let colour = load(numbers, at, direction, along as usize + at, second);
        let sum = Dual { value: values[channel], tangent: tangents[channel] };
        let seen = sum.mul(per_total).add(rest.mul(colour));
        if comptime!(!pull || kind.second) {
            image[first + channel * step] = seen.stored(second);
        }
        if pull {
            let u = upstream[first + channel * step];
            whole += seen.value * u;
            whole_tangent += seen.tangent * u;
            alone += colour.value * u;
            alone_tangent += colour.tangent * u;
            pixels[own + OF_PIXEL + channel] = rest.scale(u).stored(second);
        }
    }
    if comptime!(!pull || kind.second) {
        image[first + channels * step] = covered.stored(second);
    }
    if pull {
        let whole = Dual { value: whole, tangent: whole_tangent };
        let alone = Dual { value: alone, tangent: alone_tangent };
        let log = whole_weight.ln().add(Dual::constant(largest));
        let draw = whole.sub(Dual::constant(of_share));
        pixels[own] = log.value;
        pixels[own + 1] = log.tangent;
        pixels[own + 2] = draw.value;
        pixels[own + 3] = draw.tangent;
        pixels[own + OF_PIXEL + channels] = rest.mul(alone.sub(whole)).stored(second);
    }
}

/// Writes the gradient of each face, one cube a face, as `[views, faces, 9 + 3 numbers]`: x, y and depth of each of its corners, then the
/// attributes of each.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn blend_faces(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    numbers: &Array<f32>,
    direction: &Array<f32>,
    entries: &Array<u32>,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    gradient: &mut Array<f32>,
    weights: Weights,
    frame: Frame,
    face_count: u32,
    jobs: u32,
    first_view: u32,
    #[comptime] kind: Kind,
) {
    let job = CUBE_POS;
    if job >= jobs as usize {
        terminate!();
    }
    let channels = comptime!(kind.channels);
    let second = comptime!(kind.second);
    let count = comptime!(9 + 3 * kind.numbers());
    let units = comptime!(UNITS as usize);
    let view = job as u32 / face_count + first_view;
    let face = job % face_count as usize;
    let stride = comptime!(if second { 18usize } else { 9usize });
    let first_attribute = weights.attributes + view * weights.per_view;
    let shown = Shown::new(corners, stride * job, entries, face, first_attribute, kind);
    let reach = Reach::load(reaches, job);
    let mut pixel = UNIT_POS;
    let mut end = 0u32;
    let mut width = 1u32;
    if reach.left < reach.right {
        width = reach.right - reach.left;
        end = width * (reach.bottom - reach.top);
    }
    let mut sums = Array::<f32>::new(count);
    for k in 0..count {
        sums[k] = 0.0f32;
    }
    let plane = frame.height * frame.width;
    let planes = comptime!(kind.channels as u32 + 1);
    while pixel < end {
        let column = reach.left + pixel % width;
        let row = reach.top + pixel / width;
        let first = (view * planes * plane + row * frame.width + column) as usize;
        let own = frame.pixel(view, row, column) as usize * comptime!(OF_PIXEL + kind.channels + 1);
        let px = frame.column_centre(column);
        let py = frame.row_centre(row);
        let pair = shown.pair(px, py, weights, numbers, direction, kind);
        if pair.counts(weights) {
            let log = Dual { value: pixels[own], tangent: pixels[own + 1] };
            let draw = Dual { value: pixels[own + 2], tangent: pixels[own + 3] };
            let share = pair.share(log, weights);
            let seen = shown.seen(
                pair,
                weights,
                numbers,
                direction,
                upstream,
                first,
                plane as usize,
                kind,
            );
            if kind.is_textured {
                let by_u = pair.weights.times(share.whole.mul(seen.by_u));
                let by_v = pair.weights.times(share.whole.mul(seen.by_v));
                sums[9] = sums[9] + by_u.a.stored(second);
                sums[10] = sums[10] + by_v.a.stored(second);
                sums[11] = sums[11] + by_u.b.stored(second);
                sums[12] = sums[12] + by_v.b.stored(second);
                sums[13] = sums[13] + by_u.c.stored(second);
                sums[14] = sums[14] + by_v.c.stored(second);
            } else {
                for channel in 0..channels {
                    let u = upstream[first + channel * plane as usize];
                    let by_channel = pair.weights.times(share.whole.scale(u));
                    let at = 9 + channel;
                    sums[at] = sums[at] + by_channel.a.stored(second);
                    sums[at + channels] = sums[at + channels] + by_channel.b.stored(second);
                    sums[at + 2 * channels] = sums[at + 2 * channels] + by_channel.c.stored(second);
                }
            }
            let between = pair.weights.mul(seen.at_corners).sum();
            // A share draws the image from what it is towards what the face shows.
            let drawn = seen.here.sub(draw);
            let by_edge = share.of_edge.mul(drawn);
            let by_place = share.whole.mul(drawn).mul(pair.depth_slope);
            // The nearness falls as the depth grows.
            let by_z = by_place.scale(-weights.per_range);
            // Both the depth and the weights on the face change by a weight on the screen as by its share of 1 / z.
            let pulled_back = seen.at_corners.less(between).times(share.whole);
            let by_part = pulled_back.less(pair.depth.mul(by_z)).times(pair.depth);
            let by_barycentric = by_part.mul(shown.per_depth);
            let moved = shown.pulled(pair, by_edge.mul(pair.edge_slope), by_barycentric);
            let (x, y) = (moved.x(pair), moved.y(pair));
            let z = by_barycentric.mul(pair.barycentric).mul(shown.per_depth);
            sums[0] = sums[0] + x.a.stored(second);
            sums[1] = sums[1] + y.a.stored(second);
            sums[2] = sums[2] - z.a.stored(second);
            sums[3] = sums[3] + x.b.stored(second);
            sums[4] = sums[4] + y.b.stored(second);
            sums[5] = sums[5] - z.b.stored(second);
            sums[6] = sums[6] + x.c.stored(second);
            sums[7] = sums[7] + y.c.stored(second);
            sums[8] = sums[8] - z.c.stored(second);
        }
        pixel += UNITS;
    }
    // One number after the other: each unit adds up some of them over all units.
    let mut shares = SharedMemory::<f32>::new(comptime!((9 + 3 * kind.numbers()) * UNITS as usize));
    for k in 0..count {
        shares[k * units + UNIT_POS as usize] = sums[k];
    }
    sync_cube();
    let mut number = UNIT_POS as usize;
    while number < count {
        let mut sum = 0.0f32;
        for unit in 0..units {
            sum += shares[number * units + unit];
        }
        gradient[count * job + number] = sum;
        number += units;
    }
}

/// Adds the gradient of both tables, every unit to tables of its own over the pixels that it walks, `[units, rows, 4]`, as
/// [`sum_cubics`](super::table::sum_cubics) does.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn blend_cubics(
    corners: &Array<f32>,
    reaches: &Array<u32>,
    cells: &Array<u32>,
    numbers: &Array<f32>,
    direction: &Array<f32>,
    entries: &Array<u32>,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    partial: &mut Array<f32>,
    of_cells: Cells,
    weights: Weights,
    frame: Frame,
    first_view: u32,
    views: u32,
    rows: u32,
    #[comptime] kind: Kind,
) {
    #[allow(clippy::manual_div_ceil, reason = "a shader has no other")]
    let across = (frame.width + TILE - 1u32) / TILE;
    #[allow(clippy::manual_div_ceil, reason = "a shader has no other")]
    let down = (frame.height + TILE - 1u32) / TILE;
    let tiles = views * across * down;
    let table = ABSOLUTE_POS as u32 * rows * 4u32;
    let stride = comptime!(if kind.second { 18usize } else { 9usize });
    let plane = frame.height * frame.width;
    let planes = comptime!(kind.channels as u32 + 1);
    let mut tile = CUBE_POS as u32;
    while tile < tiles {
        let column = tile % across * TILE + UNIT_POS_X;
        let row = tile / across % down * TILE + UNIT_POS_Y;
        let view = tile / (across * down);
        if column < frame.width && row < frame.height {
            let px = frame.column_centre(column);
            let py = frame.row_centre(row);
            let first_attribute = weights.attributes + (first_view + view) * weights.per_view;
            let first =
                ((first_view + view) * planes * plane + row * frame.width + column) as usize;
            let own = frame.pixel(first_view + view, row, column) as usize
                * comptime!(OF_PIXEL + kind.channels + 1);
            let log = Dual { value: pixels[own], tangent: pixels[own + 1] };
            let draw = Dual { value: pixels[own + 2], tangent: pixels[own + 3] };
            let first_word = of_cells.first_word(view, column, row);
            for word in 0..of_cells.words {
                let mut bits = cells[(first_word + word) as usize];
                while bits != 0 {
                    let face = 32 * word + bits.trailing_zeros();
                    bits &= bits - 1u32;
                    let job = (view * of_cells.face_count + face) as usize;
                    if Reach::load(reaches, job).holds(column, row) {
                        let shown = Shown::new(
                            corners,
                            stride * job,
                            entries,
                            face as usize,
                            first_attribute,
                            kind,
                        );
                        let pair = shown.pair(px, py, weights, numbers, direction, kind);
                        if pair.counts(weights) {
                            let share = pair.share(log, weights);
                            let seen = shown.seen(
                                pair,
                                weights,
                                numbers,
                                direction,
                                upstream,
                                first,
                                plane as usize,
                                kind,
                            );
                            let drawn = seen.here.sub(draw);
                            pair.pull_tables(
                                share.of_edge.mul(drawn),
                                share.whole.mul(drawn),
                                weights,
                                numbers,
                                direction,
                                partial,
                                table,
                                kind,
                            );
                        }
                    }
                }
            }
        }
        tile += CUBE_COUNT as u32;
    }
}

/// Adds up `count` numbers of the corners of each vertex into `gradient`, one unit for each number of a vertex: `[views, count, vertices]`, or
/// with `by_vertex` `[views, vertices, count]`.
///
/// `of_faces` is `[views, faces, stride]`, with the numbers of the three corners from `first` on; `corners` are those of the vertices, as
/// [`sum_vertices`](super::gradient::sum_vertices) has them.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn gather_corners(
    of_faces: &Array<f32>,
    corners: &Array<u32>,
    gradient: &mut Array<f32>,
    vertex_count: u32,
    face_count: u32,
    jobs: u32,
    first_view: u32,
    stride: u32,
    first: u32,
    count: u32,
    #[comptime] by_vertex: bool,
) {
    let job = ABSOLUTE_POS as u32;
    if job >= jobs {
        terminate!();
    }
    let number = job % count;
    let vertex = job / count % vertex_count;
    let view = job / (count * vertex_count);
    let mut sum = 0.0f32;
    let start = corners[vertex as usize];
    let end = corners[vertex as usize + 1];
    for place in start..end {
        let corner = corners[(vertex_count + 1u32 + place) as usize];
        let face = view * face_count + corner / 3u32;
        sum += of_faces[(face * stride + first + count * (corner % 3u32) + number) as usize];
    }
    let view = first_view + view;
    let at = if by_vertex {
        (view * vertex_count + vertex) * count + number
    } else {
        (view * count + number) * vertex_count + vertex
    };
    gradient[at as usize] = sum;
}
