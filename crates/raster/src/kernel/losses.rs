//! Losses of silhouettes and their gradients to the vertices, in one pass over the bands.
//!
//! What a pair of pixel and face is to the image is kept for the gradient while it is near the processor, so that nothing is computed
//! twice.

use std::{any::Any, cell::RefCell};

use rayon::prelude::*;

use super::{
    bands::{Bands, View},
    float::Float,
    lanes::{LANES, Lanes, Places, Plain, Work, has_vectors, run},
    list::{AHEAD, Chunk, LISTED, List, group, rows_of_bands},
    pair::closest,
    pixel_loss::{PARTS, PixelLoss, overlap_and_union, squared_error},
    real::{Table, splat},
    scene::{Place, Scene},
    sum::Inputs,
    table::Place as Cell,
    walk::{BandGradient, RING, TOGETHER, walk_gradient, walk_image},
};
use crate::ImageSize;

/// Chunks of a band that are kept, of 140 bytes in f32 and 268 in f64: a thread keeps 4.6 or 8.8 MB at most. Lists that do not fit are walked
/// twice. A power of two, as vectors grow.
const KEPT: usize = 1 << 15;

/// Pixels of a band from which on it has no more rows than [`LEAST_ROWS`], so that what is kept stays near the processor.
const PIXELS: usize = 1 << 12;
/// Fewest rows of a band in images that have more.
const LEAST_ROWS: usize = 16;

/// Rows of a band.
pub(crate) fn rows_of_losses(views: usize, size: ImageSize) -> usize {
    let most = rows_of_bands(views);
    PIXELS.div_ceil(size.width.max(1)).next_power_of_two().clamp(LEAST_ROWS, most)
}

/// Losses `[views]`, and the gradient of each to its vertices, `[views, 3, vertices]`, if it is wanted: else it is 0. `target` is
/// `[1 or views, height, width]`.
pub(crate) fn losses<F: Float>(
    inputs: &Inputs<F>,
    bands: &Bands,
    target: &[F],
    loss: PixelLoss,
    with_gradient: bool,
) -> [Vec<F>; 2] {
    let asked = (loss, with_gradient);
    if has_vectors() {
        of_views::<F::Best>(&inputs.scene([&[]; 2]), bands, target, asked)
    } else {
        of_views::<Plain<F>>(&inputs.scene([&[]; 2]), bands, target, asked)
    }
}

fn of_views<L: Lanes>(
    scene: &Scene<L>,
    bands: &Bands,
    target: &[L::Float],
    (loss, with_gradient): (PixelLoss, bool),
) -> [Vec<L::Float>; 2] {
    let zero = L::Float::ZERO;
    let (views, pixels) = (bands.views.len(), scene.size.pixels());
    let in_band = |view: usize, band: usize| {
        let mut room = Room::taken();
        let (rows, width) = (scene.band_rows(band), scene.size.width);
        let first = if target.len() > pixels { view * pixels } else { 0 };
        let target = &target[first + rows.start * width..first + rows.end * width];
        let place = scene.place(&bands.views[view], view, views, band);
        let whole = bands.count == 1;
        let done =
            run::<L, _>(Band { scene, place, target, loss, with_gradient, whole, room: &mut room });
        room.leave();
        done
    };
    let count = scene.vertices.len();
    let mut gradient = vec![zero; count];
    let losses = gradient
        .par_chunks_mut((count / views.max(1)).max(1))
        .enumerate()
        .map(|(view, gradient)| {
            let walked: Vec<_> =
                (0..bands.count).into_par_iter().map(|band| in_band(view, band)).collect();
            gather(scene, &bands.views[view], &walked, loss, gradient)
        })
        .collect();
    [losses, gradient]
}

/// What a band gives back: its sums over pixels, and parts of the gradient to the corners of its faces.
struct Walked<F> {
    sums: [F; PARTS],
    /// Whether the band is all of its view: then there is one part, which has its factor already.
    whole: bool,
    parts: Vec<BandGradient<F>>,
}

/// The loss of a view from its bands, in their order, and its gradient.
fn gather<L: Lanes>(
    scene: &Scene<L>,
    view: &View,
    walked: &[Walked<L::Float>],
    loss: PixelLoss,
    gradient: &mut [L::Float],
) -> L::Float {
    let mut sums = [L::Float::ZERO; PARTS];
    for band in walked {
        sums[0] += band.sums[0];
        sums[1] += band.sums[1];
    }
    let (value, factors) = loss.of_sums(sums, scene.size.pixels());
    let (x, rest) = gradient.split_at_mut(gradient.len() / 3);
    for (band, Walked { whole, parts, .. }) in walked.iter().enumerate() {
        for (part, &factor) in parts.iter().zip(&factors) {
            let factor = if *whole { L::Float::ONE } else { factor };
            for (&face, corners) in view.faces(band).iter().zip(&part.corners) {
                for (corner, xy) in scene.faces[face as usize].iter().zip(corners.chunks_exact(2)) {
                    x[*corner as usize] += xy[0] * factor;
                    rest[*corner as usize] += xy[1] * factor;
                }
            }
        }
    }
    value
}

/// What is kept of eight pixels and a face: where the closest point lies from there, times the rate at which the profile changes with the
/// squared distance, and its weights on the second and the third corner.
#[derive(Clone, Copy)]
struct Kept<L> {
    dx: L,
    dy: L,
    weights: [L; 2],
}

/// Memory that bands use one after the other.
struct Room<L: Lanes> {
    kept: Vec<Kept<L>>,
    /// Of each chunk, its places in the band and its face, as a number of the band.
    at: Vec<([u32; 2], u32)>,
    /// Of each face, its corners as they were given, by their places there.
    corners: Vec<[usize; 3]>,
    image: Vec<L::Float>,
    target: Vec<L::Float>,
    parts: [Vec<L::Float>; PARTS],
}

thread_local! {
    /// The room of the last band of this thread: asking the system for memory in every step takes longer than some steps.
    static ROOM: RefCell<Option<Box<dyn Any>>> = const { RefCell::new(None) };
}

impl<L: Lanes> Room<L> {
    /// That of the last band, if it was of these numbers.
    fn taken() -> Box<Self> {
        let last = ROOM.take().and_then(|room| room.downcast().ok());
        last.unwrap_or_else(|| Box::new(Self::new()))
    }

    /// Leaves it to the next band.
    fn leave(self: Box<Self>) {
        ROOM.set(Some(self));
    }

    fn new() -> Self {
        let parts = [Vec::new(), Vec::new()];
        let (kept, at, corners) = (Vec::new(), Vec::new(), Vec::new());
        Self { kept, at, corners, image: Vec::new(), target: Vec::new(), parts }
    }
}

/// One band of one view.
struct Band<'a, 's, L: Lanes> {
    scene: &'a Scene<'s, L>,
    place: Place<'a, L>,
    target: &'a [L::Float],
    loss: PixelLoss,
    with_gradient: bool,
    /// Whether the view has no other.
    whole: bool,
    room: &'a mut Room<L>,
}

impl<L: Lanes> Work for Band<'_, '_, L> {
    type Output = Walked<L::Float>;

    #[inline(always)]
    fn run(mut self) -> Walked<L::Float> {
        let listed = self.draw();
        let sums = self.compare();
        let parts = match (self.loss, self.whole) {
            _ if !self.with_gradient => Vec::new(),
            (PixelLoss::Iou, false) => self.pull::<PARTS>(listed),
            _ => self.pull::<1>(listed),
        };
        Walked { sums, whole: self.whole, parts }
    }
}

impl<L: Lanes> Band<'_, '_, L> {
    /// Draws the band and keeps what its gradient needs, of so many lists of faces as it says.
    #[inline(always)]
    fn draw(&mut self) -> usize {
        let Self { scene, place, room, .. } = self;
        let length = scene.band_length(place.band).next_multiple_of(LANES);
        room.kept.clear();
        room.at.clear();
        room.corners.clear();
        room.image.clear();
        room.image.resize(length, place.empty(&scene.grid));
        let tail = place.tail(&scene.grid);
        let mut list = List::new();
        let mut listed = 0;
        for numbers in place.view.faces(place.band).chunks(LISTED) {
            list.fill(scene, place, numbers);
            if room.kept.len() + list.len() + AHEAD > KEPT {
                break;
            }
            let first = (listed * LISTED) as u32;
            room.corners.extend((0..numbers.len()).map(|owner| list.face(owner).corners()));
            match (scene.lookup.has_far_cells(), list.slivers) {
                (false, false) => room.take::<false, false>(scene, place.table, tail, &list, first),
                (false, true) => room.take::<false, true>(scene, place.table, tail, &list, first),
                (true, _) => room.take::<true, true>(scene, place.table, tail, &list, first),
            }
            listed += 1;
        }
        let place = Place { first_list: listed, ..*place };
        if listed * LISTED < place.view.faces(place.band).len() {
            let mut none = BandGradient { corners: Vec::new(), table: Vec::new() };
            walk_image(scene, place, &[], &mut room.image, &mut none);
        }
        listed
    }

    /// Sums over the pixels, which leaves the derivatives by the sums of profiles in the parts; in the first of them alone, with their
    /// factors, where the band is all of its view.
    #[inline(always)]
    fn compare(&mut self) -> [L::Float; PARTS] {
        let (width, stride) = (self.scene.size.width, self.scene.stride());
        let Room { image, target, parts, .. } = &mut *self.room;
        target.clear();
        target.resize(image.len(), L::Float::ZERO);
        for (row, own) in self.target.chunks(width).enumerate() {
            target[row * stride..row * stride + width].copy_from_slice(own);
        }
        let [first, second] = parts;
        for part in [&mut *first, &mut *second] {
            part.resize(image.len(), L::Float::ZERO);
        }
        // What belongs to no pixel is covered by nothing, and adds nothing to the sums.
        let rows = self.target.len() / width.max(1);
        let beside = |numbers: &mut [L::Float]| {
            numbers[rows * stride..].fill(L::Float::ZERO);
            for row in numbers[..rows * stride].chunks_mut(stride) {
                row[width..].fill(L::Float::ZERO);
            }
        };
        beside(image);
        let sums = match self.loss {
            PixelLoss::SquaredError => squared_error::<L>(image, target, first),
            PixelLoss::Iou => overlap_and_union::<L>(image, target, first, second),
        };
        let sums = [sums[0].sum(), sums[1].sum()];
        if self.whole {
            let (_, [by_first, by_second]) = self.loss.of_sums(sums, self.target.len());
            let [by_first, by_second] = [L::splat(by_first), L::splat(by_second)];
            let pairs = first.as_chunks_mut().0.iter_mut().zip(second.as_chunks().0);
            for (first, second) in pairs {
                *first = (L::of(first) * by_first + L::of(second) * by_second).array();
            }
        }
        beside(first);
        beside(second);
        sums
    }

    /// The gradients of the sums of so many parts times the sums of profiles, to the corners of the faces.
    #[inline(always)]
    fn pull<const COUNT: usize>(&mut self, listed: usize) -> Vec<BandGradient<L::Float>> {
        let Self { scene, place, room, .. } = self;
        let faces = place.view.faces(place.band).len();
        let nothing =
            || BandGradient { corners: vec![[L::Float::ZERO; 6]; faces], table: Vec::new() };
        let mut gradients: Vec<_> = (0..COUNT).map(|_| nothing()).collect();
        let (mut sums, mut face) = ([[splat::<L>(0.0); 6]; COUNT], u32::MAX);
        for (k, (kept, &(at, owner))) in room.kept.iter().zip(&room.at).enumerate() {
            if owner != face || k % TOGETHER == 0 {
                for part in 0..COUNT {
                    flush(&room.corners, face, &sums[part], scene.half, &mut gradients[part]);
                }
                (sums, face) = ([[splat(0.0); 6]; COUNT], owner);
            }
            let [second, third] = kept.weights;
            for part in 0..COUNT {
                let upstream = &room.parts[part];
                let pull = L::of_groups(group(upstream, at[0]), group(upstream, at[1]));
                let (x, y) = (pull * kept.dx, pull * kept.dy);
                let sums = &mut sums[part];
                sums[0] += x;
                sums[1] += y;
                sums[2] += x * second;
                sums[3] += y * second;
                sums[4] += x * third;
                sums[5] += y * third;
            }
        }
        for part in 0..COUNT {
            flush(&room.corners, face, &sums[part], scene.half, &mut gradients[part]);
        }
        let place = Place { first_list: listed, ..*place };
        if listed * LISTED < faces {
            for (gradient, upstream) in gradients.iter_mut().zip(&room.parts) {
                walk_gradient(scene, place, upstream, &mut [], gradient);
            }
        }
        gradients
    }
}

impl<L: Lanes> Room<L> {
    /// Draws and keeps the chunks of a list, whose first face is number `first` of the band.
    #[inline(always)]
    fn take<const FAR: bool, const SLIVERS: bool>(
        &mut self,
        scene: &Scene<L>,
        table: Table<L>,
        tail: L,
        list: &List<L>,
        first: u32,
    ) {
        let zero = splat::<L>(0.0);
        let (mut rows, mut places) = ([Places::FIRST; RING], [zero; RING]);
        let mut rates = [zero; RING];
        let start = self.kept.len();
        for (ahead, Chunk { places: from_origin, at, owner }) in list.chunks(AHEAD).enumerate() {
            let slot = ahead % RING;
            let (px, py) = L::pixels(from_origin);
            let point = closest::<L, SLIVERS>(list.face(owner), px, py);
            let Cell { row, t, rate } = scene.lookup.place::<L, FAR>(point.distance2, point.inside);
            (rows[slot], places[slot], rates[slot]) = (row, t, rate);
            let [_, second, third] = point.weights;
            let weights = [second, third];
            self.kept.push(Kept { dx: point.dx, dy: point.dy, weights });
            self.at.push((at, first + owner as u32));
            if ahead < AHEAD {
                continue;
            }
            let slot = (ahead - AHEAD) % RING;
            let [a, b, c, d] = L::rows(table.values, &rows[slot]);
            let t = places[slot];
            let before = start + ahead - AHEAD;
            (a + t * (b + t * (c + t * d)) - tail)
                .add_to_groups(&mut self.image, self.at[before].0);
            let slope = rates[slot] * (b + t * (c * splat(2.0) + t * (d * splat(3.0))));
            let kept = &mut self.kept[before];
            (kept.dx, kept.dy) = (slope * kept.dx, slope * kept.dy);
        }
        let end = self.kept.len() - AHEAD;
        self.kept.truncate(end);
        self.at.truncate(end);
    }
}

/// Adds sums over the chunks of a face to its corners. The sums have neither the factor -2 nor the share of the first corner, which is
/// what the others leave.
#[inline(always)]
fn flush<L: Lanes>(
    corners: &[[usize; 3]],
    face: u32,
    sums: &[L; 6],
    half: f64,
    gradient: &mut BandGradient<L::Float>,
) {
    let Some(order) = corners.get(face as usize) else { return };
    // From pixels, with y down, to NDC.
    let [right, down] = [-2.0, 2.0].map(|k| L::Float::from_f64(k * half));
    let of_corner = [
        [sums[0] - sums[2] - sums[4], sums[1] - sums[3] - sums[5]],
        [sums[2], sums[3]],
        [sums[4], sums[5]],
    ];
    let own = &mut gradient.corners[face as usize];
    for (&corner, [x, y]) in order.iter().zip(of_corner) {
        own[2 * corner] += x.sum() * right;
        own[2 * corner + 1] += y.sum() * down;
    }
}
