//! Blocks of chunks, processed from pixels to weights.
//!
//! Each step is a separate function shared by all walks: inlining it into each of them takes minutes to compile.
#![allow(clippy::needless_range_loop)]

use super::{
    depth::{DepthAt, cubic},
    point::Point,
    scene::Blend,
    shown::Shown,
};
use crate::{
    lanes::{Lanes, Places, Work, run},
    list::{LISTED, List},
    pair::{Closest, closest},
    real::{Real, Table, splat},
    table::TablePosition,
};

/// Chunks processed together in each step: the dependency chains of several chunks overlap.
pub(super) const BLOCK: usize = 8;

/// Pairs of faces and eight pixels each, between the steps of a walk.
pub(super) struct Block<T: Real> {
    pub(super) count: usize,
    /// Positions of the pixels in the band, relative to the origin of their face, and the face's index in the list.
    pub(super) at: [[u32; 2]; BLOCK],
    pub(super) places: [[u32; 2]; BLOCK],
    pub(super) owner: [usize; BLOCK],
    /// Closest points of the boundaries.
    closest: [Closest<T>; BLOCK],
    /// Depths of the points, and their barycentric weights on the face itself.
    pub(super) depth: [T; BLOCK],
    pub(super) weights: [[T; 3]; BLOCK],
    /// Positions in the table of the edge softness.
    pub(super) edge_t: [T; BLOCK],
    pub(super) edge_row: [Places; BLOCK],
    /// Logarithms of the softnesses.
    pub(super) log_edge: [T; BLOCK],
    pub(super) log_depth: [T; BLOCK],
    /// For visitors with gradients: points, the derivative of the table position with respect to the squared distance, the derivative of
    /// the logarithm with respect to that distance, and depth weights.
    pub(super) point: [Point<T>; BLOCK],
    edge_rate: [T::Lanes; BLOCK],
    pub(super) edge_slope: [T; BLOCK],
    pub(super) by_depth: [DepthAt<T>; BLOCK],
}

impl<T: Real> Block<T> {
    #[inline(always)]
    pub(super) fn nothing() -> Self {
        let zero = T::constant(splat(0.0));
        Self {
            count: 0,
            at: [[0; 2]; BLOCK],
            places: [[0; 2]; BLOCK],
            owner: [0; BLOCK],
            closest: [Closest::nothing(); BLOCK],
            depth: [zero; BLOCK],
            weights: [[zero; 3]; BLOCK],
            edge_t: [zero; BLOCK],
            edge_row: [Places::FIRST; BLOCK],
            log_edge: [zero; BLOCK],
            log_depth: [zero; BLOCK],
            point: [Point::nothing(); BLOCK],
            edge_rate: [splat(0.0); BLOCK],
            edge_slope: [zero; BLOCK],
            by_depth: [DepthAt::nothing(); BLOCK],
        }
    }
}

impl<T: Real> Block<T> {
    /// Computes the logarithms of the weights from the pixels; with the intermediates of gradients, if visitors need them.
    #[inline(always)]
    pub(super) fn weigh<const PULLS: bool>(
        &mut self,
        blend: &Blend<T>,
        table: Table<T>,
        list: &List<T>,
        shown: &Shown<T>,
    ) {
        if blend.scene.lookup.has_far_cells() || list.slivers {
            run::<T::Lanes, _>(Measure::<T, PULLS, true, true> { blend, list, block: self });
        } else {
            run::<T::Lanes, _>(Measure::<T, PULLS, false, false> { blend, list, block: self });
        }
        run::<T::Lanes, _>(Weigh::<T, PULLS> {
            of: Locate { blend, list, shown, block: self },
            table,
        });
    }

    /// Computes everything but the logarithms and slopes by edge, which are known, for visitors with gradients.
    #[inline(always)]
    pub(super) fn locate(&mut self, blend: &Blend<T>, list: &List<T>, shown: &Shown<T>) {
        let of = Locate { blend, list, shown, block: self };
        if blend.scene.lookup.has_far_cells() || list.slivers {
            run::<T::Lanes, _>(Relocate::<T, true> { of });
        } else {
            run::<T::Lanes, _>(Relocate::<T, false> { of });
        }
    }
}

/// Computes closest points of the boundaries, and positions in the table of the edge softness.
struct Measure<'a, 's, T: Real, const PULLS: bool, const FAR: bool, const SLIVERS: bool> {
    blend: &'a Blend<'s, T>,
    list: &'a List<T>,
    block: &'a mut Block<T>,
}

impl<T: Real, const PULLS: bool, const FAR: bool, const SLIVERS: bool> Work
    for Measure<'_, '_, T, PULLS, FAR, SLIVERS>
{
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { blend, list, block } = self;
        let lookup = blend.scene.lookup;
        let pick = <T::Lanes as Lanes>::pick;
        let zero = splat::<T::Lanes>(0.0);
        for k in 0..block.count.min(BLOCK) {
            let (px, py) = T::Lanes::pixels(&block.places[k]);
            let closest = closest::<T, SLIVERS>(list.face(block.owner[k]), px, py);
            // The table holds the mirrored softness: its inner side is outside the face.
            let outside = zero.less(pick(closest.inside, zero, splat(1.0)));
            let TablePosition { row, t, rate } = lookup.place::<T, FAR>(closest.distance2, outside);
            (block.edge_row[k], block.edge_t[k]) = (row, t);
            if PULLS {
                (block.edge_rate[k], block.closest[k]) = (rate, closest);
            } else {
                block.closest[k].inside = closest.inside;
                block.closest[k].weights = closest.weights;
            }
        }
    }
}

/// Computes points of the faces, their depths, and logarithms of softnesses.
struct Weigh<'a, 's, T: Real, const PULLS: bool> {
    of: Locate<'a, 's, T, PULLS>,
    table: Table<'a, T>,
}

impl<T: Real, const PULLS: bool> Work for Weigh<'_, '_, T, PULLS> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { mut of, table } = self;
        of.locate();
        of.weigh();
        let block = of.block;
        let zero = T::constant(splat(0.0));
        for k in 0..block.count.min(BLOCK) {
            let [value, slope] = cubic(T::rows(table, &block.edge_row[k]), block.edge_t[k]);
            block.log_edge[k] = zero - value;
            if PULLS {
                block.edge_slope[k] = slope.scale(block.edge_rate[k].neg());
            }
        }
    }
}

/// Computes closest points of the boundaries, points of the faces, their depths, and logarithms of depth softnesses.
struct Relocate<'a, 's, T: Real, const SLIVERS: bool> {
    of: Locate<'a, 's, T, true>,
}

impl<T: Real, const SLIVERS: bool> Work for Relocate<'_, '_, T, SLIVERS> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { mut of } = self;
        let Locate { list, block, .. } = &mut of;
        for k in 0..block.count.min(BLOCK) {
            let (px, py) = T::Lanes::pixels(&block.places[k]);
            block.closest[k] = closest::<T, SLIVERS>(list.face(block.owner[k]), px, py);
        }
        of.locate();
        of.weigh();
    }
}

/// Computes points of the faces and their depths, then logarithms of depth softnesses.
struct Locate<'a, 's, T: Real, const PULLS: bool> {
    blend: &'a Blend<'s, T>,
    list: &'a List<T>,
    shown: &'a Shown<T>,
    block: &'a mut Block<T>,
}

impl<T: Real, const PULLS: bool> Locate<'_, '_, T, PULLS> {
    #[inline(always)]
    fn locate(&mut self) {
        let Self { list, shown, block, .. } = self;
        for slot in 0..block.count.min(BLOCK) {
            let owner = block.owner[slot];
            let face = &shown.faces[owner % LISTED];
            let (px, py) = T::Lanes::pixels(&block.places[slot]);
            let [constant, x, y] = &face.planes;
            let mut own = [T::constant(splat(0.0)); 3];
            for k in 0..3 {
                own[k] = constant[k].lanes() + x[k].lanes().scale(px) + y[k].lanes().scale(py);
            }
            let point = Point::new(&block.closest[slot], list.face(owner), own, face.some);
            // 1 / z interpolates linearly on the screen.
            let [r0, r1, r2] = face.per_depth;
            let [l0, l1, l2] = point.barycentric;
            let parts = [l0 * r0.lanes(), l1 * r1.lanes(), l2 * r2.lanes()];
            let depth = T::inverse(parts[0] + parts[1] + parts[2]);
            block.depth[slot] = depth;
            block.weights[slot] = [parts[0] * depth, parts[1] * depth, parts[2] * depth];
            if PULLS {
                block.point[slot] = point;
            }
        }
    }

    #[inline(always)]
    fn weigh(&mut self) {
        let Self { blend, block, .. } = self;
        let (near, per_range) = (T::Lanes::splat(blend.near), T::Lanes::splat(blend.per_range));
        for k in 0..block.count.min(BLOCK) {
            let by_depth = blend.depth.at((T::constant(near) - block.depth[k]).scale(per_range));
            block.log_depth[k] = by_depth.log();
            if PULLS {
                block.by_depth[k] = by_depth;
            }
        }
    }
}
