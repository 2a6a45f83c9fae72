//! Blending of colours face by face: the largest weight of each pixel, sums relative to it, and their gradient, gathered per face over its
//! pixels.

use cubecl::prelude::*;

use super::{
    blend_inputs::{BlendInputs, BlendSpec},
    dual::{Dual, load},
    face_attributes::FaceAttributes,
    of_pixel::{OF_PIXEL, OfPixel},
    parts::{Part, SLOTS},
    table::UNITS as WALKERS,
    whole::{self, INFINITE, MARKS, NEGATIVE, SIZE, add_relative, mark},
};

/// Units of a cube, which share a part of a face.
pub(super) const UNITS: u32 = 32;

/// The bits of 1.
const ONE: u32 = 0x3f80_0000;

/// Numbers summed per pixel: the share of the faces, and the share times each channel, with their derivatives in a pass of second order.
pub(super) fn summed(kind: BlendSpec) -> usize {
    (kind.channels + 1) * if kind.second { 2 } else { 1 }
}

/// Computes the largest face weight at each pixel of the launch: the first of the pixel's [`MARKS`] becomes its logarithm, encoded as an
/// integer of the same order.
#[cube(launch)]
pub(super) fn find_largest(
    drawn: &BlendInputs,
    marks: &mut Array<Atomic<u32>>,
    #[comptime] kind: BlendSpec,
) {
    let part = drawn.part(CUBE_POS as u32);
    let (view, face) = (part.job / drawn.face_count, part.job % drawn.face_count);
    let shown = FaceAttributes::of(drawn, view, face, kind);
    let mut pixel = part.start + UNIT_POS;
    while pixel < part.end {
        let (column, row) = (part.column(pixel), part.row(pixel));
        let pair = shown.pair(column, row, drawn, kind);
        if pair.counts(drawn.weights) {
            let bits = u32::reinterpret(pair.log_edge.value + pair.log_depth.value);
            let ordered = select(bits > SIZE, u32::MAX - bits, bits + NEGATIVE);
            let at = MARKS * drawn.frame.pixel(view, row, column);
            marks[at as usize].fetch_max(ordered);
        }
        pixel += UNITS;
    }
}

/// The logarithm of the largest weight at a pixel of the launch; `behind` is the logarithm of the background's weight.
#[cube]
fn largest(mark: u32, behind: f32) -> f32 {
    let positive = mark >= NEGATIVE;
    let bits = select(positive, mark - NEGATIVE, u32::MAX - mark);
    let log = f32::reinterpret(select(mark == 0u32, 0u32, bits));
    select(mark == 0u32 || log < behind, behind, log)
}

/// Sums the shares of faces at each pixel of the launch, relative to the largest weight there, and the weighted channels: [`summed`] whole
/// numbers of two words. With `measure` it only computes the largest magnitudes at each pixel of a value and of a derivative: the second
/// and third of its [`MARKS`]. A share is at most 1.
#[cube(launch)]
pub(super) fn add_shares(
    drawn: &BlendInputs,
    marks: &mut Array<Atomic<u32>>,
    sums: &mut Array<Atomic<u32>>,
    #[comptime] kind: BlendSpec,
    #[comptime] measure: bool,
) {
    let part = drawn.part(CUBE_POS as u32);
    let (view, face) = (part.job / drawn.face_count, part.job % drawn.face_count);
    let shown = FaceAttributes::of(drawn, view, face, kind);
    let channels = comptime!(kind.channels);
    let weights = drawn.weights;
    let behind = drawn.number(weights.background as usize + channels, kind).value;
    let mut terms = Array::<f32>::new(comptime!(summed(kind)));
    let mut pixel = part.start + UNIT_POS;
    while pixel < part.end {
        let (column, row) = (part.column(pixel), part.row(pixel));
        let pair = shown.pair(column, row, drawn, kind);
        if pair.counts(weights) {
            let of_pixel = drawn.frame.pixel(view, row, column);
            let at = (MARKS * of_pixel) as usize;
            let log = largest(marks[at].load(), behind);
            let share = pair.share(Dual::constant(log), weights).whole;
            store(&mut terms, 0usize, share, kind);
            if kind.is_textured {
                let sample = shown.sample(pair, drawn, kind);
                for channel in 0..channels {
                    let own = sample.texels(drawn, channel, kind);
                    store(&mut terms, channel + 1, share.mul(sample.between(own)), kind);
                }
            } else {
                for channel in 0..channels {
                    let own = shown.attribute(drawn, channel, kind);
                    store(&mut terms, channel + 1, share.mul(pair.weights.mul(own).sum()), kind);
                }
            }
            if measure {
                // A share of NaN makes all values NaN.
                let share = mark(terms[0]);
                let mut shown = select(share < INFINITE, 0u32, share);
                let mut moved = 0u32;
                for k in 0..comptime!(summed(kind)) {
                    let size = mark(terms[k]);
                    if is_moved(k, kind) {
                        moved = select(size > moved, size, moved);
                    } else if k > 0 {
                        shown = select(size > shown, size, shown);
                    }
                }
                marks[at + 1].fetch_max(shown);
                if kind.second {
                    marks[at + 2].fetch_max(moved);
                }
            } else {
                let shown = marks[at + 1].load();
                let moved = marks[at + 2].load();
                let first = of_pixel as usize * comptime!(summed(kind));
                for k in 0..comptime!(summed(kind)) {
                    let of_term = select(k == 0, ONE, select(is_moved(k, kind), moved, shown));
                    add_relative(sums, 2 * (first + k), terms[k], of_term, drawn.face_count);
                }
            }
        }
        pixel += UNITS;
    }
}

/// Whether a summed number of a pixel is a derivative.
#[cube]
fn is_moved(number: usize, #[comptime] kind: BlendSpec) -> bool {
    if kind.second { number % 2 == 1 } else { false.runtime() }
}

/// Stores a term among those of a pixel, with its derivative in a pass of second order.
#[cube]
fn store(terms: &mut Array<f32>, number: usize, term: Dual, #[comptime] kind: BlendSpec) {
    if kind.second {
        terms[2 * number] = term.value;
        terms[2 * number + 1] = term.tangent;
    } else {
        terms[number] = term.value;
    }
}

/// One of the summed numbers of a pixel.
#[cube]
fn total(
    sums: &Array<u32>,
    of_pixel: usize,
    number: usize,
    size: u32,
    moved: u32,
    face_count: u32,
    #[comptime] kind: BlendSpec,
) -> Dual {
    let first = of_pixel * comptime!(summed(kind));
    if kind.second {
        let at = 2 * (first + 2 * number);
        Dual {
            value: whole::relative_sum(sums, at, size, face_count),
            tangent: whole::relative_sum(sums, at + 2, moved, face_count),
        }
    } else {
        Dual::constant(whole::relative_sum(sums, 2 * (first + number), size, face_count))
    }
}

/// Inputs of [`finish_pixels`] in addition to the numbers shared by all pixels.
#[derive(CubeType, CubeLaunch)]
pub(super) struct Added {
    marks: Array<u32>,
    sums: Array<u32>,
    /// Start of the background in the numbers, and of their derivatives in the direction.
    background: u32,
    along: u32,
    face_count: u32,
    first_view: u32,
    /// Pixels of a view, and of all views of the launch.
    plane: u32,
    pixels: u32,
}

/// Writes each pixel of the image, `[views, channels + 1, height, width]`, or in a pass of second order its derivative.
///
/// With `pull` it also writes to `pixels`, for each pixel, [`OF_PIXEL`] numbers and the gradient of the background, `channels + 1` numbers; the
/// image itself is then only written in a pass of second order.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
pub(super) fn finish_pixels(
    added: &Added,
    numbers: &Array<f32>,
    direction: &Array<f32>,
    upstream: &Array<f32>,
    pixels: &mut Array<f32>,
    image: &mut Array<f32>,
    #[comptime] kind: BlendSpec,
    #[comptime] pull: bool,
) {
    let own = ABSOLUTE_POS as u32;
    if own >= added.pixels {
        terminate!();
    }
    let channels = comptime!(kind.channels);
    let second = comptime!(kind.second);
    let (background, along) = (added.background as usize, added.along as usize);
    let at = background + channels;
    let log_behind = load(numbers, at, direction, along + at, second);
    let of_pixel = own as usize;
    let largest = largest(added.marks[(MARKS * own) as usize], log_behind.value);
    let shown = added.marks[(MARKS * own) as usize + 1];
    let moved = added.marks[(MARKS * own) as usize + 2];
    // Shares are relative to 1, all of them NaN if one is. A constant alone would not do: CUDA reinterprets the bits of variables only.
    let unit = select(shown < INFINITE, ONE, shown);
    let sum = total(&added.sums, of_pixel, 0usize, unit, moved, added.face_count, kind);
    let behind = log_behind.sub(Dual::constant(largest)).exp();
    let whole_weight = sum.add(behind);
    let per_total = whole_weight.recip();
    let covered = sum.mul(per_total);
    let rest = behind.mul(per_total);
    let step = added.plane as usize;
    let view = (added.first_view + own / added.plane) as usize;
    let first = view * (channels + 1) * step + (own % added.plane) as usize;
    let written =
        (view * step + (own % added.plane) as usize) * comptime!(OF_PIXEL + kind.channels + 1);
    let mut of_share = 0.0f32;
    if pull {
        of_share = upstream[first + channels * step];
    }
    // The dot products of the upstream with the image, and with the background alone.
    let mut whole = covered.value * of_share;
    let mut whole_tangent = covered.tangent * of_share;
    let mut alone = 0.0f32;
    let mut alone_tangent = 0.0f32;
    for channel in 0..channels {
        let at = background + channel;
        let colour = load(numbers, at, direction, along + at, second);
        let sum = total(&added.sums, of_pixel, channel + 1, shown, moved, added.face_count, kind);
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
            pixels[written + OF_PIXEL + channel] = rest.scale(u).stored(second);
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
        pixels[written] = log.value;
        pixels[written + 1] = log.tangent;
        pixels[written + 2] = draw.value;
        pixels[written + 3] = draw.tangent;
        pixels[written + OF_PIXEL + channels] = rest.mul(alone.sub(whole)).stored(second);
    }
}

/// Writes the gradient of each face, and after these those of parts, a cube each, as `[views · faces + slots, 9 + 3 numbers]`: x, y and
/// depth of each corner, then the attributes of each.
#[cube(launch)]
pub(super) fn blend_faces(
    drawn: &BlendInputs,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    gradient: &mut Array<f32>,
    #[comptime] kind: BlendSpec,
) {
    let group = CUBE_POS;
    if group >= (drawn.views * drawn.face_count + SLOTS) as usize {
        terminate!();
    }
    let channels = comptime!(kind.channels);
    let second = comptime!(kind.second);
    let count = comptime!(9 + 3 * kind.numbers());
    let units = comptime!(UNITS as usize);
    let weights = drawn.weights;
    let part = drawn.part(group as u32);
    let (view, face) = (part.job / drawn.face_count, part.job % drawn.face_count);
    let shown = FaceAttributes::of(drawn, view, face, kind);
    let mut pixel = part.start + UNIT_POS;
    let mut sums = Array::<f32>::new(count);
    for k in 0..count {
        sums[k] = 0.0f32;
    }
    while pixel < part.end {
        let (column, row) = (part.column(pixel), part.row(pixel));
        let first = drawn.in_image(view, row, column, kind);
        let pair = shown.pair(column, row, drawn, kind);
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
            // A share moves the image from its value towards that of the face.
            let pulled = seen.here.sub(of_pixel.draw);
            let by_edge = share.of_edge.mul(pulled);
            let by_place = share.whole.mul(pulled).mul(pair.depth_slope);
            // The nearness decreases with depth.
            let by_z = by_place.scale(-weights.per_range);
            // Depth and the weights on the face both depend on a weight on the screen through its share of 1 / z.
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
    // One number after the other: each unit sums some of them over all units.
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
        gradient[count * group + number] = sum;
        number += units;
    }
}

/// Adds the gradient of both tables, `[units, rows, 4]`: each unit sums over its pairs into a separate table, as in
/// [`sum_cubics`](super::table::sum_cubics).
#[cube(launch)]
pub(super) fn blend_cubics(
    drawn: &BlendInputs,
    upstream: &Array<f32>,
    pixels: &Array<f32>,
    partial: &mut Array<f32>,
    rows: u32,
    #[comptime] kind: BlendSpec,
) {
    let table = ABSOLUTE_POS as u32 * rows * 4u32;
    let mut job = CUBE_POS as u32;
    while job < drawn.views * drawn.face_count {
        let part = Part::whole(job, &drawn.reaches);
        let (view, face) = (part.job / drawn.face_count, part.job % drawn.face_count);
        let shown = FaceAttributes::of(drawn, view, face, kind);
        let mut pixel = part.start + UNIT_POS;
        while pixel < part.end {
            let (column, row) = (part.column(pixel), part.row(pixel));
            let pair = shown.pair(column, row, drawn, kind);
            if pair.counts(drawn.weights) {
                let first = drawn.in_image(view, row, column, kind);
                let of_pixel = OfPixel::load(pixels, OfPixel::at(drawn, view, row, column, kind));
                let share = pair.share(of_pixel.log, drawn.weights);
                let seen = shown.seen(pair, drawn, upstream, first, kind);
                let pulled = seen.here.sub(of_pixel.draw);
                let (by_edge, by_depth) = (share.of_edge.mul(pulled), share.whole.mul(pulled));
                pair.pull_tables(by_edge, by_depth, drawn, partial, table, kind);
            }
            pixel += WALKERS;
        }
        job += CUBE_COUNT as u32;
    }
}

/// Sums the gradient of the background over the pixels of each cube, `[cubes, channels + 1]`.
#[cube(launch)]
pub(super) fn sum_background(
    pixels: &Array<f32>,
    partial: &mut Array<f32>,
    count: u32,
    #[comptime] kind: BlendSpec,
) {
    let numbers = comptime!(kind.channels + 1);
    let mut shares = SharedMemory::<f32>::new(comptime!((kind.channels + 1) * WALKERS as usize));
    for number in 0..numbers {
        let mut sum = 0.0f32;
        let mut pixel = ABSOLUTE_POS as u32;
        while pixel < count {
            let at = pixel as usize * comptime!(OF_PIXEL + kind.channels + 1);
            sum += pixels[at + OF_PIXEL + number];
            pixel += CUBE_COUNT as u32 * WALKERS;
        }
        shares[number * comptime!(WALKERS as usize) + UNIT_POS as usize] = sum;
    }
    sync_cube();
    let mut number = UNIT_POS as usize;
    while number < numbers {
        let mut sum = 0.0f32;
        for unit in 0..comptime!(WALKERS as usize) {
            sum += shares[number * comptime!(WALKERS as usize) + unit];
        }
        partial[CUBE_POS * numbers + number] = sum;
        number += comptime!(WALKERS as usize);
    }
}
