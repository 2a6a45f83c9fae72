//! The faces of a list for colour passes: numbers shared by all pairs of a face.
#![allow(clippy::needless_range_loop)]

use super::{point::planes, scene::Blend};
use crate::{
    face::Face,
    float::Float as _,
    lanes::Lanes,
    list::LISTED,
    real::{Float, Real, everywhere},
    scene::BandRef,
};

/// A number of a face.
#[derive(Clone, Copy)]
pub(super) struct Number<T: Real> {
    value: Float<T>,
    tangent: Float<T>,
}

impl<T: Real> Number<T> {
    pub(super) const ONE: Self = Self { value: Float::<T>::ONE, tangent: Float::<T>::ZERO };

    /// The first lane.
    #[inline(always)]
    fn of(lanes: T) -> Self {
        Self { value: lanes.value().array()[0], tangent: lanes.output().array()[0] }
    }

    /// The number in all lanes.
    #[inline(always)]
    pub(super) fn lanes(self) -> T {
        T::new(T::Lanes::splat(self.value), T::Lanes::splat(self.tangent))
    }
}

/// Numbers shared by all pairs of a face, except its edges.
#[derive(Clone, Copy)]
pub(super) struct FaceAttributes<T: Real> {
    /// Barycentric weights on the screen: `constant + x px + y py` each.
    pub(super) planes: [[Number<T>; 3]; 3],
    /// Whether the area is large enough to divide by.
    pub(super) some: bool,
    /// The original number of each corner here.
    pub(super) order: [usize; 3],
    /// One over the depth of each corner.
    pub(super) per_depth: [Number<T>; 3],
    /// Logarithm of the largest depth weight.
    pub(super) log: Float<T>,
}

/// The faces of a list, and the numbers of the attributes at their corners.
pub(super) struct Shown<T: Real> {
    pub(super) faces: [FaceAttributes<T>; LISTED],
    /// Face by face.
    attributes: Vec<[Number<T>; 3]>,
    numbers: usize,
}

impl<T: Real> Shown<T> {
    /// The attributes at the corners of a face.
    #[inline(always)]
    pub(super) fn attributes(&self, owner: usize) -> &[[Number<T>; 3]] {
        &self.attributes[owner * self.numbers..(owner + 1) * self.numbers]
    }
}

impl<T: Real> FaceAttributes<T> {
    /// A placeholder before any face is known.
    fn nothing() -> Self {
        let one = Number::ONE;
        Self {
            planes: [[one; 3]; 3],
            some: false,
            order: [0, 1, 2],
            per_depth: [one; 3],
            log: Float::<T>::ZERO,
        }
    }
}

impl<T: Real> Shown<T> {
    /// Room for a list of faces with this many numbers at each corner.
    pub(super) fn new(numbers: usize) -> Self {
        Self {
            faces: [FaceAttributes::nothing(); LISTED],
            attributes: vec![[Number::ONE; 3]; LISTED * numbers],
            numbers,
        }
    }

    /// Sets face `owner` of the list, number `number` of the scene.
    #[inline(always)]
    pub(super) fn set(
        &mut self,
        blend: &Blend<T>,
        place: &BandRef<T>,
        view: usize,
        face: Face<T>,
        owner: usize,
        number: u32,
    ) {
        let own = &mut self.faces[owner % LISTED];
        own.order = face.corners();
        let (corners, entries) =
            (blend.scene.faces[number as usize], blend.entries[number as usize]);
        let depths = 2 * (place.vertices.len() / 3);
        let first = blend.first_attribute(view);
        let attributes = &mut self.attributes[owner * self.numbers..(owner + 1) * self.numbers];
        for k in 0..3 {
            let at = depths + corners[own.order[k]] as usize;
            own.per_depth[k] =
                Number::of(T::inverse(everywhere(place.vertices, place.tangents, at)));
            let start = first + entries[own.order[k]] as usize * blend.numbers;
            for (c, attribute) in attributes.iter_mut().enumerate() {
                let [values, tangents] = blend.attributes;
                let tangent = if T::DUAL { tangents[start + c] } else { Float::<T>::ZERO };
                attribute[k] = Number { value: values[start + c], tangent };
            }
        }
        let (planes, some) = planes(face, blend.least_area);
        own.some = some;
        for j in 0..3 {
            for k in 0..3 {
                own.planes[j][k] = Number::of(planes[j][k]);
            }
        }
    }
}
