//! Colours of faces that share pixels: the image, one unit a pixel, and its gradient, gathered per face over its pixels and then per vertex
//! over its corners.

use cubecl::prelude::*;

use super::{
    blend_inputs::{BlendInputs, BlendSpec},
    dual::Dual,
    face_attributes::FaceAttributes,
    gradient::UNITS,
    of_pixel::{OF_PIXEL, OfPixel},
    reach::Reach,
    tile::TILE,
};

/// Writes each pixel of the image, `[views, channels + 1, height, width]`, or in a pass of second order its derivative.
///
/// With `pull` it also writes to `pixels`, for each pixel, [`OF_PIXEL`] numbers and the gradient of the background, `channels + 1` numbers; the
/// image itself is then only written in a pass of second order.
#[cube(launch)]
pub(super) fn blend_pixels(
    drawn: &BlendInputs,
    upstream: &Array<f32>,
    pixels: &mut Array<f32>,
    image: &mut Array<f32>,
    #[comptime] kind: BlendSpec,
    #[comptime] pull: bool,
) {
    let column = CUBE_POS_X * TILE + UNIT_POS_X;
    let row = CUBE_POS_Y * TILE + UNIT_POS_Y;
    let view = CUBE_POS_Z;
    let (frame, weights, of_cells) = (drawn.frame, drawn.weights, drawn.of_cells);
    if column >= frame.width || row >= frame.height {
        terminate!();
    }
    let channels = comptime!(kind.channels);
    let second = comptime!(kind.second);
    let px = frame.column_centre(column);
    let py = frame.row_centre(row);
    let background = weights.background as usize;
    let log_behind = drawn.number(background + channels, kind);

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
        let mut bits = drawn.cells[(first_word + word) as usize];
        while bits != 0 {
            let face = 32 * word + bits.trailing_zeros();
            bits &= bits - 1u32;
            if drawn.reaches(view, face, column, row) {
                let shown = FaceAttributes::of(drawn, view, face, kind);
                let pair = shown.pair(px, py, drawn, kind);
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
                        let sample = shown.sample(pair, drawn, kind);
                        for channel in 0..channels {
                            let own = sample.texels(drawn, channel, kind);
                            let seen = share.mul(sample.between(own));
                            values[channel] = values[channel] + seen.value;
                            tangents[channel] = tangents[channel] + seen.tangent;
                        }
                    } else {
                        for channel in 0..channels {
                            let own = shown.attribute(drawn, channel, kind);
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
    let first = drawn.in_image(view, row, column, kind);
    let step = drawn.plane();
    let own = OfPixel::at(drawn, view, row, column, kind);
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
        let colour = drawn.number(background + channel, kind);
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
pub(super) fn blend_faces(
    drawn: &BlendInputs,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    gradient: &mut Array<f32>,
    jobs: u32,
    #[comptime] kind: BlendSpec,
) {
    let job = CUBE_POS;
    if job >= jobs as usize {
        terminate!();
    }
    let channels = comptime!(kind.channels);
    let second = comptime!(kind.second);
    let count = comptime!(9 + 3 * kind.numbers());
    let units = comptime!(UNITS as usize);
    let (frame, weights) = (drawn.frame, drawn.weights);
    let face_count = drawn.of_cells.face_count;
    let (view, face) = (job as u32 / face_count, job as u32 % face_count);
    let shown = FaceAttributes::of(drawn, view, face, kind);
    let reach = Reach::load(&drawn.reaches, job);
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
    while pixel < end {
        let column = reach.left + pixel % width;
        let row = reach.top + pixel / width;
        let first = drawn.in_image(view, row, column, kind);
        let px = frame.column_centre(column);
        let py = frame.row_centre(row);
        let pair = shown.pair(px, py, drawn, kind);
        if pair.counts(weights) {
            let of_pixel = OfPixel::load(pixels, OfPixel::at(drawn, view, row, column, kind));
            let share = pair.share(of_pixel.log, weights);
            let seen = shown.seen(pair, drawn, upstream, first, kind);
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
                    let u = upstream[first + channel * drawn.plane()];
                    let by_channel = pair.weights.times(share.whole.scale(u));
                    let at = 9 + channel;
                    sums[at] = sums[at] + by_channel.a.stored(second);
                    sums[at + channels] = sums[at + channels] + by_channel.b.stored(second);
                    sums[at + 2 * channels] = sums[at + 2 * channels] + by_channel.c.stored(second);
                }
            }
            let between = pair.weights.mul(seen.at_corners).sum();
            // A share draws the image from what it is towards what the face shows.
            let pulled = seen.here.sub(of_pixel.draw);
            let by_edge = share.of_edge.mul(pulled);
            let by_place = share.whole.mul(pulled).mul(pair.depth_slope);
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
pub(super) fn blend_cubics(
    drawn: &BlendInputs,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    partial: &mut Array<f32>,
    rows: u32,
    #[comptime] kind: BlendSpec,
) {
    let (frame, of_cells) = (drawn.frame, drawn.of_cells);
    #[allow(clippy::manual_div_ceil, reason = "a shader has no other")]
    let across = (frame.width + TILE - 1u32) / TILE;
    #[allow(clippy::manual_div_ceil, reason = "a shader has no other")]
    let down = (frame.height + TILE - 1u32) / TILE;
    let tiles = of_cells.views * across * down;
    let table = ABSOLUTE_POS as u32 * rows * 4u32;
    let mut tile = CUBE_POS as u32;
    while tile < tiles {
        let column = tile % across * TILE + UNIT_POS_X;
        let row = tile / across % down * TILE + UNIT_POS_Y;
        let view = tile / (across * down);
        if column < frame.width && row < frame.height {
            let px = frame.column_centre(column);
            let py = frame.row_centre(row);
            let first = drawn.in_image(view, row, column, kind);
            let of_pixel = OfPixel::load(pixels, OfPixel::at(drawn, view, row, column, kind));
            let first_word = of_cells.first_word(view, column, row);
            for word in 0..of_cells.words {
                let mut bits = drawn.cells[(first_word + word) as usize];
                while bits != 0 {
                    let face = 32 * word + bits.trailing_zeros();
                    bits &= bits - 1u32;
                    if drawn.reaches(view, face, column, row) {
                        let shown = FaceAttributes::of(drawn, view, face, kind);
                        let pair = shown.pair(px, py, drawn, kind);
                        if pair.counts(drawn.weights) {
                            let share = pair.share(of_pixel.log, drawn.weights);
                            let seen = shown.seen(pair, drawn, upstream, first, kind);
                            let pulled = seen.here.sub(of_pixel.draw);
                            let (by_edge, by_depth) =
                                (share.of_edge.mul(pulled), share.whole.mul(pulled));
                            pair.pull_tables(by_edge, by_depth, drawn, partial, table, kind);
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
