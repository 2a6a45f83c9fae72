//! A band that is compared with a target as soon as it is drawn. While it is drawn, what is found in tables is recorded for the gradient.

use std::ops::Range;

use super::{
    band::Walked,
    block::{BLOCK, Block},
    pull::Pull,
    scene::{Band, Blend},
    shown::Shown,
    sums::Sums,
    walk::{Visitor, Walk},
};
use crate::{
    float::Float as _,
    lanes::{Lanes, Work, run},
    list::{Chunk, LISTED, List},
    real::splat,
    rooms,
};

/// Compares pixels of a view with what they should be: given the view, its pixels, and their image `[channels + 1][pixels]`, returns their
/// share of the loss of the view, and writes its derivatives with respect to the image over zeros. Several threads call it, each for other
/// pixels.
pub type Judge<'a, F> = dyn Fn(usize, Range<usize>, &[Vec<F>], &mut [Vec<F>]) -> F + Sync + 'a;

/// Most chunks recorded per band, of 82 bytes in f32 and 146 in f64: some 3 or 5 MB per thread. Lists beyond that are walked twice.
const RECORDED: usize = 1 << 15;

/// Numbers of eight pixels and a face that the gradient would have to look up again. Geometry is computed again: to read it from memory takes
/// longer.
#[derive(Clone, Copy)]
struct Record<L> {
    /// Logarithm of the edge softness.
    log_edge: L,
    /// Its derivative with respect to the squared distance.
    slope: L,
}

/// Lists of the faces of a band, and a record of each of their chunks.
struct Records<L: Lanes> {
    lists: Vec<List<L>>,
    /// Number of lists that are recorded, from the first of the band on.
    count: usize,
    pairs: Vec<Record<L>>,
}

impl<L: Lanes> Default for Records<L> {
    fn default() -> Self {
        Self { lists: Vec::new(), count: 0, pairs: Vec::new() }
    }
}

/// A band, its loss, and its gradients that are wanted; those of tables are not available.
pub(super) struct JudgedBand<'a, 's, L: Lanes> {
    pub(super) of: Band<'a, 's, L>,
    pub(super) judge: &'a Judge<'a, L::Float>,
    pub(super) wanted: [bool; 5],
}

impl<L: Lanes> Work for JudgedBand<'_, '_, L> {
    type Output = Walked<L::Float>;

    #[inline(always)]
    fn run(self) -> Walked<L::Float> {
        let Self { of, judge, wanted } = self;
        let mut records: Box<Records<L>> = rooms::taken();
        let faces = of.place().numbers.len();
        let sums = of.summed_by(|sums| {
            run::<L, _>(Draw { of, sums, records: &mut records });
            if records.count * LISTED < faces {
                of.walk_from(records.count, sums);
            }
        });
        let texels = of.blend.no_texels(Some(wanted));
        let mut walked = Walked { texels, ..Walked::default() };
        let image = of.image(&sums);
        let mut upstream: Vec<_> =
            image.iter().map(|plane| vec![L::Float::ZERO; plane.len()]).collect();
        walked.loss = judge(of.view, of.pixels(), &image, &mut upstream);
        let upstream = of.padded(upstream.iter().map(Vec::as_slice));
        of.pull(&sums, &upstream, wanted, &mut walked, |pull| {
            run::<L, _>(Replay { of, records: &records, pull });
            if records.count * LISTED < faces {
                of.walk_from(records.count, pull);
            }
        });
        rooms::leave(records);
        walked
    }
}

/// Adds up a band, and records its pairs while there is room.
struct Draw<'a, 's, 'v, 'w, L: Lanes> {
    of: Band<'a, 's, L>,
    sums: &'v mut Sums<'w, L>,
    records: &'v mut Records<L>,
}

impl<L: Lanes> Work for Draw<'_, '_, '_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { of, sums, records: Records { lists, count, pairs } } = self;
        *count = 0;
        pairs.clear();
        let place = of.place();
        let mut shown = Shown::new(of.blend.numbers);
        let mut block = Block::nothing();
        let mut walk = Walk { of, place, visitor: &mut Recorder { sums, pairs } };
        for (k, numbers) in place.numbers.chunks(LISTED).enumerate() {
            if lists.len() == k {
                lists.push(List::new());
            }
            let list = &mut lists[k];
            list.fill(&of.blend.scene, &place, numbers);
            if walk.visitor.pairs.len() + list.len() > RECORDED {
                lists.truncate(k);
                break;
            }
            walk.take((list, numbers, k * LISTED), &mut shown, &mut block);
            *count += 1;
        }
    }
}

/// Sums weights and records pairs.
struct Recorder<'v, 'w, L: Lanes> {
    sums: &'v mut Sums<'w, L>,
    pairs: &'v mut Vec<Record<L>>,
}

impl<L: Lanes> Visitor<L> for Recorder<'_, '_, L> {
    const PULLS: bool = true;

    #[inline(always)]
    fn take(&mut self, blend: &Blend<L>, shown: &Shown<L>, block: &Block<L>, first: usize) {
        self.sums.take(blend, shown, block, first);
        for k in 0..block.count.min(BLOCK) {
            self.pairs.push(Record { log_edge: block.log_edge[k], slope: block.edge_slope[k] });
        }
    }
}

/// Visits the recorded pairs, except those that are negligible at the nearest corner of their face.
struct Replay<'a, 's, 'v, 'w, L: Lanes> {
    of: Band<'a, 's, L>,
    records: &'v Records<L>,
    pull: &'v mut Pull<'w, L>,
}

impl<L: Lanes> Work for Replay<'_, '_, '_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { of, records: Records { lists, count, pairs }, pull } = self;
        let Band { blend, view, logs, .. } = of;
        let place = of.place();
        let mut shown = Shown::new(blend.numbers);
        let mut block = Block::nothing();
        let mut rest = &pairs[..];
        let lists = lists[..*count].iter().zip(place.numbers.chunks(LISTED));
        for (k, (list, numbers)) in lists.enumerate() {
            let own;
            (own, rest) = rest.split_at(list.len());
            let (mut met, mut shows, mut highest) = (None, false, splat::<L>(0.0));
            let chunks = list.chunks(0).zip(own).zip(1..);
            for ((Chunk { places, at, owner }, &Record { log_edge, slope }), so_far) in chunks {
                if met != Some(owner) {
                    highest = splat(f64::from(logs[numbers[owner] as usize]));
                    (met, shows) = (Some(owner), false);
                }
                if pull.counts(at, log_edge + highest) {
                    if !shows {
                        shown.set(blend, &place, view, list.face(owner), owner, numbers[owner]);
                        shows = true;
                    }
                    let slot = block.count % BLOCK;
                    (block.at[slot], block.places[slot], block.owner[slot]) = (at, *places, owner);
                    (block.log_edge[slot], block.edge_slope[slot]) = (log_edge, slope);
                    block.count = slot + 1;
                }
                if block.count == BLOCK || so_far == list.len() {
                    block.locate(blend, list, &shown);
                    pull.take(blend, &shown, &block, k * LISTED);
                    block.count = 0;
                }
            }
            pull.ends(&blend.scene, &shown, k * LISTED);
        }
    }
}
