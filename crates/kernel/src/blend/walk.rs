//! The walk over the pixel-face pairs of a band in colour, block by block, for a visitor.
//!
//! Loops run over numbers of corners and channels, as in `lanes`, so that all of them become vectors.
#![allow(clippy::needless_range_loop)]

use super::{
    block::{BLOCK, Block},
    scene::{Band, Blend},
    shown::{FaceAttributes, Shown},
};
use crate::{
    float::Float as _,
    lanes::{Lanes, Work},
    list::{Chunk, LISTED, List},
    real::{Float, Real},
    scene::{BandRef, Scene},
};

/// An operation on every pair.
pub(super) trait Visitor<T: Real> {
    /// Whether the visitor needs the intermediates of gradients in blocks.
    const PULLS: bool;

    /// Whether pairs of a face at these positions of the band are negligible.
    #[inline(always)]
    fn skips(&self, face: &FaceAttributes<T>, at: [u32; 2]) -> bool {
        let _ = (face, at);
        false
    }

    /// Visits pairs of a list whose first face is number `first` of the band. Pairs of a face are consecutive.
    fn take(&mut self, blend: &Blend<T>, shown: &Shown<T>, block: &Block<T>, first: usize);

    /// Called after all pairs of a list whose first face is number `first` of the band.
    #[inline(always)]
    fn ends(&mut self, scene: &Scene<T>, shown: &Shown<T>, first: usize) {
        let _ = (scene, shown, first);
    }
}

/// A walk over the pairs of a band.
pub(super) struct Walk<'a, 's, 'v, T: Real, V> {
    pub(super) of: Band<'a, 's, T>,
    pub(super) place: BandRef<'a, T>,
    pub(super) visitor: &'v mut V,
}

impl<T: Real, V: Visitor<T>> Work for Walk<'_, '_, '_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let blend = self.of.blend;
        let mut list = List::new();
        let mut shown = Shown::new(blend.numbers);
        let mut block = Block::nothing();
        let lists = self.place.numbers.chunks(LISTED).enumerate();
        for (k, numbers) in lists.skip(self.place.first_list) {
            list.fill(&blend.scene, &self.place, numbers);
            self.take((&list, numbers, k * LISTED), &mut shown, &mut block);
            self.visitor.ends(&blend.scene, &shown, k * LISTED);
        }
    }
}

impl<T: Real, V: Visitor<T>> Walk<'_, '_, '_, T, V> {
    /// Walks over the pairs of a list block by block, given the numbers of its faces in the scene and that of its first face in the band.
    #[inline(always)]
    pub(super) fn take(
        &mut self,
        (list, numbers, first): (&List<T>, &[u32], usize),
        shown: &mut Shown<T>,
        block: &mut Block<T>,
    ) {
        let Band { blend, view, logs, .. } = self.of;
        let mut met = None;
        for (k, Chunk { places, at, owner }) in list.chunks(0).enumerate() {
            if met != Some(owner) {
                shown.set(blend, &self.place, view, list.face(owner), owner, numbers[owner]);
                shown.faces[owner % LISTED].log =
                    Float::<T>::from_f64(f64::from(logs[numbers[owner] as usize]));
                met = Some(owner);
            }
            if !self.visitor.skips(&shown.faces[owner % LISTED], at) {
                let slot = block.count % BLOCK;
                (block.at[slot], block.places[slot], block.owner[slot]) = (at, *places, owner);
                block.count = slot + 1;
            }
            if block.count == BLOCK || k + 1 == list.len() {
                let table = self.place.table;
                if V::PULLS {
                    block.weigh::<true>(blend, table, list, shown);
                } else {
                    block.weigh::<false>(blend, table, list, shown);
                }
                self.visitor.take(blend, shown, block, first);
                block.count = 0;
            }
        }
    }
}

impl<T: Real> Blend<'_, T> {
    /// Weights of pairs relative to those of the logarithm `largest`: the weight, and its part before the floor of the edge softness is
    /// subtracted.
    #[inline(always)]
    pub(super) fn weight(&self, log_edge: T, log_depth: T, largest: T::Lanes) -> [T; 2] {
        let by_depth = log_depth - T::constant(largest);
        let whole = (log_edge + by_depth).power_of_e();
        if self.floor == Float::<T>::ZERO {
            return [whole, whole];
        }
        let rest = T::Lanes::splat(Float::<T>::ONE / (Float::<T>::ONE - self.floor));
        // A face that does not count may be nearer than all that do; its weight is then arbitrary, and masked.
        let floor = by_depth.power_of_e().scale(T::Lanes::splat(self.floor));
        let some = T::Lanes::splat(self.counts_from).less(log_edge.value());
        [(whole - floor).scale(rest).masked(some), whole.scale(rest).masked(some)]
    }
}
