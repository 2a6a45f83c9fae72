//! Losses of silhouettes and their gradients with respect to the vertices, in one pass over the bands.
//!
//! The forward pass caches the per-pair intermediates of the gradient, so that nothing is computed twice.

mod pixel;

use std::ops::Range;

use rayon::prelude::*;

use self::pixel::{Compared, PARTS, overlap_and_union, squared_error};
pub use self::pixel::{EMPTY, PixelLoss};
use super::{
    bands::{Bands, View, bands_of_view},
    face::Face,
    float::{Float as _, Vectors, on_vectors},
    gather::{Part, gather as gather_corners},
    lanes::{LANES, Lanes, Work, run},
    list::{LISTED, List, group},
    pair::CornerSums,
    real::splat,
    rooms,
    scene::{BandRef, Scene},
    sum::Inputs,
    tasks::{filled, task},
    walk::{Gradient, Image, Pair, TOGETHER, Visitor, walk},
};
use crate::ImageSize;

/// Most chunks cached per band, of 140 bytes in f32 and 268 in f64: at most 4.6 or 8.8 MB per thread. Lists beyond that are walked twice. A
/// power of two, like the capacities of a growing vector.
const KEPT: usize = 1 << 15;

/// Pixels of a band, so that its cached data stays in the processor's cache.
const PIXELS: usize = 1 << 12;
/// Fewest rows of a band on the average in images that have more.
const LEAST_ROWS: usize = 16;

/// Number of bands that each view is cut into.
pub fn bands_of_losses(views: usize, size: ImageSize) -> usize {
    let rows = PIXELS.div_ceil(size.width.max(1)).max(LEAST_ROWS);
    size.height.div_ceil(rows).max(bands_of_view(views, size))
}

/// Images that silhouettes are compared with, each `[1 or views, height, width]`.
///
/// See [`PixelLoss`] for an example.
#[derive(Clone, Copy)]
pub struct Judged<'a, F> {
    /// The image that the coverage is compared with.
    pub target: &'a [F],
    /// The weight of each pixel, which multiplies its coverage; 1 if absent.
    pub counted: Option<&'a [F]>,
}

impl<'a, F> Judged<'a, F> {
    /// Both images, restricted to some pixels of a view.
    fn part(self, view: usize, pixels: usize, range: Range<usize>) -> Self {
        let of = |image: &'a [F]| {
            let first = if image.len() > pixels { view * pixels } else { 0 };
            &image[first + range.start..first + range.end]
        };
        Self { target: of(self.target), counted: self.counted.map(of) }
    }
}

/// See [`Kernels::losses`](crate::Kernels::losses).
pub(crate) fn losses<F: Vectors>(
    inputs: &Inputs<F>,
    bands: &Bands,
    judged: Judged<F>,
    loss: PixelLoss,
    with_gradient: bool,
) -> [Vec<F>; 2] {
    let asked = (loss, with_gradient);
    on_vectors!(of_views::<F>(&inputs.scene([&[]; 2]), bands, judged, asked))
}

fn of_views<L: Lanes>(
    scene: &Scene<L>,
    bands: &Bands,
    judged: Judged<L::Float>,
    (loss, with_gradient): (PixelLoss, bool),
) -> [Vec<L::Float>; 2] {
    let zero = L::Float::ZERO;
    let (views, pixels) = (bands.views.len(), scene.size.pixels());
    let in_band = |view: usize, band: usize| {
        let place = scene.place(&bands.views[view], view, views, band);
        let (rows, width) = (place.rows(), scene.size.width);
        let judged = judged.part(view, pixels, rows.start * width..rows.end * width);
        let whole = bands.count == 1;
        task("loss of a band", || {
            let mut room = rooms::taken();
            let work = Band { scene, place, judged, loss, with_gradient, whole, room: &mut room };
            let done = run::<L, _>(work);
            rooms::leave(room);
            done
        })
    };
    let count = scene.vertices.len();
    let mut gradient = filled(zero, count);
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

/// Results of a band: its sums over pixels, and parts of the gradient with respect to x and y of the corners of each of its faces.
struct Walked<F> {
    sums: [F; PARTS],
    /// Whether the band is its whole view: then there is one part, which already includes its factor.
    whole: bool,
    parts: Vec<Vec<[F; 6]>>,
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
    let mut all = Vec::new();
    for (band, Walked { whole, parts, .. }) in walked.iter().enumerate() {
        for (corners, &factor) in parts.iter().zip(&factors) {
            let factor = if *whole { L::Float::ONE } else { factor };
            all.push(Part { faces: view.faces(band), corners, factor });
        }
    }
    gather_corners(scene.faces, &all, gradient);
    value
}

/// Cached data of eight pixels and a face: the offset from the closest point to the pixel, times the rate at which the profile changes with
/// the squared distance, and the point's weights on the second and the third corner.
#[derive(Clone, Copy)]
struct Kept<L> {
    offset: [L; 2],
    weights: [L; 2],
}

/// Buffers that bands reuse.
struct Room<L: Lanes> {
    kept: Vec<Kept<L>>,
    /// For each chunk its positions in the band, and the number of its face in the band.
    at: Vec<([u32; 2], u32)>,
    /// For each face the original numbers of its corners.
    corners: Vec<[usize; 3]>,
    image: Vec<L::Float>,
    target: Vec<L::Float>,
    counted: Vec<L::Float>,
    parts: [Vec<L::Float>; PARTS],
}

impl<L: Lanes> Default for Room<L> {
    fn default() -> Self {
        let parts = [Vec::new(), Vec::new()];
        let (kept, at, corners) = (Vec::new(), Vec::new(), Vec::new());
        let [image, target, counted] = [const { Vec::new() }; 3];
        Self { kept, at, corners, image, target, counted, parts }
    }
}

/// One band of one view.
struct Band<'a, 's, L: Lanes> {
    scene: &'a Scene<'s, L>,
    place: BandRef<'a, L>,
    judged: Judged<'a, L::Float>,
    loss: PixelLoss,
    with_gradient: bool,
    /// Whether the band is its whole view.
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
    /// Draws the band and caches the intermediates of its gradient for the first lists of faces; returns their number.
    #[inline(always)]
    fn draw(&mut self) -> usize {
        let Self { scene, place, room, .. } = self;
        let length = place.length(scene).next_multiple_of(LANES);
        room.kept.clear();
        room.at.clear();
        room.corners.clear();
        room.corners.resize(place.numbers.len(), [0, 1, 2]);
        room.image.clear();
        room.image.resize(length, place.empty(&scene.grid));
        let tail = place.tail(&scene.grid);
        let Room { kept, at, corners, image, .. } = &mut **room;
        let image = Image { image, tail };
        let listed = walk(scene, *place, &mut Keep { image, kept, at, corners });
        if listed * LISTED < place.numbers.len() {
            let place = BandRef { first_list: listed, ..*place };
            walk(scene, place, &mut Image { image: &mut room.image, tail });
        }
        listed
    }

    /// Sums over the pixels. Writes the derivatives with respect to the sums of profiles to the parts; if the band is its whole view, only
    /// to the first part, with all factors included.
    #[inline(always)]
    fn compare(&mut self) -> [L::Float; PARTS] {
        let (width, stride) = (self.scene.size.width, self.scene.stride());
        let Room { image, target, counted, parts, .. } = &mut *self.room;
        let length = image.len();
        let in_rows = |room: &mut Vec<L::Float>, own: &[L::Float]| {
            room.clear();
            room.resize(length, L::Float::ZERO);
            for (row, own) in own.chunks(width).enumerate() {
                room[row * stride..row * stride + width].copy_from_slice(own);
            }
        };
        in_rows(target, self.judged.target);
        if let Some(own) = self.judged.counted {
            in_rows(counted, own);
        }
        let [first, second] = parts;
        for part in [&mut *first, &mut *second] {
            part.resize(image.len(), L::Float::ZERO);
        }
        // Numbers that belong to no pixel have coverage 0, and add nothing to the sums.
        let rows = self.judged.target.len() / width.max(1);
        let beside = |numbers: &mut [L::Float]| {
            numbers[rows * stride..].fill(L::Float::ZERO);
            for row in numbers[..rows * stride].chunks_mut(stride) {
                row[width..].fill(L::Float::ZERO);
            }
        };
        beside(image);
        let counted = self.judged.counted.map(|_| &counted[..]);
        let compared = Compared { sums: &image[..], target: &target[..], counted };
        let sums = match self.loss {
            PixelLoss::SquaredError => squared_error::<L>(compared, first),
            PixelLoss::Iou => overlap_and_union::<L>(compared, first, second),
        };
        let sums = [sums[0].sum(), sums[1].sum()];
        if self.whole {
            let (_, [by_first, by_second]) = self.loss.of_sums(sums, self.judged.target.len());
            let [by_first, by_second] = [L::splat(by_first), L::splat(by_second)];
            let of_first = first.as_chunks_mut().0.iter_mut();
            match self.loss {
                // The second part holds numbers of an earlier band, maybe not finite.
                PixelLoss::SquaredError => {
                    of_first.for_each(|first| *first = (L::of(first) * by_first).array());
                }
                PixelLoss::Iou => {
                    for (first, second) in of_first.zip(second.as_chunks().0) {
                        *first = (L::of(first) * by_first + L::of(second) * by_second).array();
                    }
                }
            }
        }
        beside(first);
        beside(second);
        sums
    }

    /// The gradients of the sums of `COUNT` parts times the sums of profiles, with respect to the corners of the faces.
    #[inline(always)]
    fn pull<const COUNT: usize>(&mut self, listed: usize) -> Vec<Vec<[L::Float; 6]>> {
        let Self { scene, place, room, .. } = self;
        let faces = place.numbers.len();
        let mut gradients = vec![vec![[L::Float::ZERO; 6]; faces]; COUNT];
        let (mut sums, mut last) = ([CornerSums::nothing(); COUNT], None);
        for (k, (kept, &(at, face))) in room.kept.iter().zip(&room.at).enumerate() {
            if let Some(last) = last
                && (last != face || k % TOGETHER == 0)
            {
                flush(last, room.corners[last as usize], scene.half, &mut sums, &mut gradients);
            }
            last = Some(face);
            for (sums, upstream) in sums.iter_mut().zip(&room.parts) {
                let pull = L::of_groups(group(upstream, at[0]), group(upstream, at[1]));
                let [x, y] = kept.offset;
                sums.add([pull * x, pull * y], kept.weights);
            }
        }
        if let Some(last) = last {
            flush(last, room.corners[last as usize], scene.half, &mut sums, &mut gradients);
        }
        if listed * LISTED < faces {
            let place = BandRef { first_list: listed, ..*place };
            for (corners, upstream) in gradients.iter_mut().zip(&room.parts) {
                walk(scene, place, &mut Gradient::new(scene, upstream, corners));
            }
        }
        gradients
    }
}

/// Adds the sums of each part to the corners of a face, in the original order. A function, since closures lack the target features of their
/// callers.
#[inline(always)]
fn flush<L: Lanes>(
    face: u32,
    order: [usize; 3],
    half: f64,
    sums: &mut [CornerSums<L>],
    gradients: &mut [Vec<[L::Float; 6]>],
) {
    for (sums, corners) in sums.iter_mut().zip(gradients) {
        sums.flush(order, half, &mut corners[face as usize]);
    }
}

/// Draws pairs and caches them for the gradient, while there is room.
struct Keep<'a, L: Lanes> {
    image: Image<'a, L>,
    kept: &'a mut Vec<Kept<L>>,
    at: &'a mut Vec<([u32; 2], u32)>,
    corners: &'a mut [[usize; 3]],
}

impl<L: Lanes> Visitor<L> for Keep<'_, L> {
    const MOVES: bool = true;

    #[inline(always)]
    fn begins(&mut self, list: &List<L>) -> bool {
        self.kept.len() + list.len() <= KEPT
    }

    #[inline(always)]
    fn pair(&mut self, pair: &Pair<L>) {
        self.image.pair(pair);
        let slope = pair.slope(splat(1.0));
        let [x, y] = pair.offset;
        self.kept.push(Kept { offset: [slope * x, slope * y], weights: pair.weights });
        self.at.push((pair.at, pair.face as u32));
    }

    #[inline(always)]
    fn face(&mut self, number: usize, face: Face<L>) {
        self.corners[number] = face.corners();
    }
}
