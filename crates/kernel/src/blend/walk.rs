//! The walk over the pixel-face pairs of a band in colour, block by block. What is done with them is up to a visitor.
//!
//! Loops run over numbers of corners and channels, as in `lanes`, so that all of them become vectors.
#![allow(clippy::needless_range_loop)]

use super::{
    depth::{DepthAt, cubic},
    point::Point,
    scene::Blend,
    shown::{FaceAttributes, Shown},
};
use crate::{
    float::Float as _,
    lanes::{Lanes, Places, Work},
    list::{Chunk, LISTED, List},
    pair::{Closest, closest},
    real::{Float, Real, splat},
    scene::{BandRef, Scene},
    table::TablePosition,
};

/// Chunks that are taken through each step together: the chains of one wait for each other, those of several do not.
pub(super) const BLOCK: usize = 8;

/// Pairs of faces and eight pixels each, on their way through the steps of a walk.
pub(super) struct Block<T: Real> {
    pub(super) count: usize,
    /// Where pixels lie in the band, seen from the origin of their face, and which face of the list that is.
    pub(super) at: [[u32; 2]; BLOCK],
    places: [[u32; 2]; BLOCK],
    pub(super) owner: [usize; BLOCK],
    /// Closest points of the boundaries.
    closest: [Closest<T>; BLOCK],
    /// Depths of the points, and their barycentric weights on the face itself.
    pub(super) depth: [T; BLOCK],
    pub(super) weights: [[T; 3]; BLOCK],
    /// Places in the table of the edge softness.
    pub(super) edge_t: [T; BLOCK],
    pub(super) edge_row: [Places; BLOCK],
    /// Logarithms of the softnesses.
    pub(super) log_edge: [T; BLOCK],
    pub(super) log_depth: [T; BLOCK],
    /// For visitors that pull: points, how the place in the table moves with the squared distance, the derivative of the logarithm by that
    /// distance, and what depths count.
    pub(super) point: [Point<T>; BLOCK],
    edge_rate: [T::Lanes; BLOCK],
    pub(super) edge_slope: [T; BLOCK],
    pub(super) by_depth: [DepthAt<T>; BLOCK],
}

impl<T: Real> Block<T> {
    #[inline(always)]
    fn nothing() -> Self {
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

/// What is done to every pair.
pub(super) trait Visitor<T: Real> {
    /// Whether it reads what blocks hold for those that pull.
    const PULLS: bool;

    /// Whether pairs of a face at these places of the band count for nothing.
    #[inline(always)]
    fn skips(&self, face: &FaceAttributes<T>, at: [u32; 2]) -> bool {
        let _ = (face, at);
        false
    }

    /// Takes pairs of a list whose first face is number `first` of the band. Those of a face follow each other.
    fn take(&mut self, blend: &Blend<T>, shown: &Shown<T>, block: &Block<T>, first: usize);

    /// Has taken all pairs of a list whose first face is number `first` of the band.
    #[inline(always)]
    fn ends(&mut self, scene: &Scene<T>, shown: &Shown<T>, first: usize) {
        let _ = (scene, shown, first);
    }
}

/// A walk over the pairs of a band.
pub(super) struct Walk<'a, 's, T: Real, V> {
    pub(super) blend: &'a Blend<'s, T>,
    pub(super) place: BandRef<'a, T>,
    pub(super) view: usize,
    /// Logarithm of the largest weight by depth of each face.
    pub(super) logs: &'a [f32],
    pub(super) visitor: &'a mut V,
}

impl<T: Real, V: Visitor<T>> Work for Walk<'_, '_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let blend = self.blend;
        let mut list = List::new();
        let mut shown = Shown::new(blend.numbers);
        let mut block = Block::nothing();
        for (k, numbers) in self.place.view.faces(self.place.band).chunks(LISTED).enumerate() {
            list.fill(&blend.scene, &self.place, numbers);
            let listed = (&list, numbers, k * LISTED);
            if blend.scene.lookup.has_far_cells() || list.slivers {
                self.take::<true, true>(listed, &mut shown, &mut block);
            } else {
                self.take::<false, false>(listed, &mut shown, &mut block);
            }
            self.visitor.ends(&blend.scene, &shown, k * LISTED);
        }
    }
}

impl<T: Real, V: Visitor<T>> Walk<'_, '_, T, V> {
    /// Takes the pairs of a list, given with the numbers of its faces in the scene and that of its first face in the band, block by block.
    #[inline(always)]
    fn take<const FAR: bool, const SLIVERS: bool>(
        &mut self,
        (list, numbers, first): (&List<T>, &[u32], usize),
        shown: &mut Shown<T>,
        block: &mut Block<T>,
    ) {
        let blend = self.blend;
        let mut met = None;
        for (k, Chunk { places, at, owner }) in list.chunks(0).enumerate() {
            if met != Some(owner) {
                shown.set(blend, &self.place, self.view, list.face(owner), owner, numbers[owner]);
                shown.faces[owner % LISTED].log =
                    Float::<T>::from_f64(f64::from(self.logs[numbers[owner] as usize]));
                met = Some(owner);
            }
            if !self.visitor.skips(&shown.faces[owner % LISTED], at) {
                let slot = block.count % BLOCK;
                (block.at[slot], block.places[slot], block.owner[slot]) = (at, *places, owner);
                block.count = slot + 1;
            }
            if block.count == BLOCK || k + 1 == list.len() {
                self.measure::<FAR, SLIVERS>(block, list);
                self.locate(block, list, shown);
                self.weigh(block);
                self.visitor.take(blend, shown, block, first);
                block.count = 0;
            }
        }
    }

    /// Closest points of the boundaries, and places in the table of the edge softness.
    #[inline(always)]
    fn measure<const FAR: bool, const SLIVERS: bool>(&self, block: &mut Block<T>, list: &List<T>) {
        let lookup = self.blend.scene.lookup;
        let pick = <T::Lanes as Lanes>::pick;
        let zero = splat::<T::Lanes>(0.0);
        for k in 0..block.count.min(BLOCK) {
            let (px, py) = T::Lanes::pixels(&block.places[k]);
            let closest = closest::<T, SLIVERS>(list.face(block.owner[k]), px, py);
            // The table is that of the mirrored softness, so that its inner side is outside the face.
            let outside = zero.less(pick(closest.inside, zero, splat(1.0)));
            let TablePosition { row, t, rate } = lookup.place::<T, FAR>(closest.distance2, outside);
            (block.edge_row[k], block.edge_t[k]) = (row, t);
            if V::PULLS {
                (block.edge_rate[k], block.closest[k]) = (rate, closest);
            } else {
                block.closest[k].inside = closest.inside;
                block.closest[k].weights = closest.weights;
            }
        }
    }

    /// Points of the faces, and their depths.
    #[inline(always)]
    fn locate(&self, block: &mut Block<T>, list: &List<T>, shown: &Shown<T>) {
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
            // 1 / z is what interpolates linearly on the screen.
            let [r0, r1, r2] = face.per_depth;
            let [l0, l1, l2] = point.barycentric;
            let parts = [l0 * r0.lanes(), l1 * r1.lanes(), l2 * r2.lanes()];
            let depth = T::inverse(parts[0] + parts[1] + parts[2]);
            block.depth[slot] = depth;
            block.weights[slot] = [parts[0] * depth, parts[1] * depth, parts[2] * depth];
            if V::PULLS {
                block.point[slot] = point;
            }
        }
    }

    /// Logarithms of softnesses.
    #[inline(always)]
    fn weigh(&self, block: &mut Block<T>) {
        let blend = self.blend;
        let zero = T::constant(splat(0.0));
        let table = self.place.table;
        let (near, per_range) = (T::Lanes::splat(blend.near), T::Lanes::splat(blend.per_range));
        for k in 0..block.count.min(BLOCK) {
            let [value, slope] = cubic(T::rows(table, &block.edge_row[k]), block.edge_t[k]);
            block.log_edge[k] = zero - value;
            let by_depth = blend.depth.at((T::constant(near) - block.depth[k]).scale(per_range));
            block.log_depth[k] = by_depth.log();
            if V::PULLS {
                block.edge_slope[k] = slope.scale(block.edge_rate[k].neg());
                block.by_depth[k] = by_depth;
            }
        }
    }
}

impl<T: Real> Blend<'_, T> {
    /// Weights of pairs relative to those of the logarithm `largest`: all of it, and the part that the edge softness makes before its
    /// floor is taken off.
    #[inline(always)]
    pub(super) fn weight(&self, log_edge: T, log_depth: T, largest: T::Lanes) -> [T; 2] {
        let by_depth = log_depth - T::constant(largest);
        let whole = (log_edge + by_depth).power_of_e();
        if self.floor == Float::<T>::ZERO {
            return [whole, whole];
        }
        let rest = T::Lanes::splat(Float::<T>::ONE / (Float::<T>::ONE - self.floor));
        // A face that does not count may be nearer than all that do: then this is anything, and masked.
        let floor = by_depth.power_of_e().scale(T::Lanes::splat(self.floor));
        let some = T::Lanes::splat(self.counts_from).less(log_edge.value());
        [(whole - floor).scale(rest).masked(some), whole.scale(rest).masked(some)]
    }
}
