//! Numbers of the pixels of a band, plane by plane.

use crate::{
    float::Float as _,
    lanes::{GROUP, LANES, Lanes},
    real::{Float, Real},
};

/// Planes of numbers, with tangents where numbers have any. A plane is as long as a band, and filled up to whole vectors.
pub(super) struct Planes<T: Real> {
    values: Vec<Float<T>>,
    tangents: Vec<Float<T>>,
    length: usize,
}

impl<T: Real> Planes<T> {
    /// So many planes of zeros for a band of this length.
    pub(super) fn new(count: usize, length: usize) -> Self {
        let length = length.next_multiple_of(LANES);
        let zeros = |there: bool| vec![Float::<T>::ZERO; if there { count * length } else { 0 }];
        Self { values: zeros(true), tangents: zeros(T::DUAL), length }
    }

    /// Planes without tangents, for a band of this length.
    pub(super) fn of(values: &[Float<T>], length: usize) -> Self {
        Self {
            values: values.to_vec(),
            tangents: Vec::new(),
            length: length.next_multiple_of(LANES),
        }
    }

    /// All values, plane by plane.
    pub(super) fn values(&self) -> &[Float<T>] {
        &self.values
    }

    /// Vectors in a plane.
    pub(super) fn vectors(&self) -> usize {
        self.length / LANES
    }

    /// The numbers of two groups of pixels.
    #[inline(always)]
    pub(super) fn groups(&self, plane: usize, at: [u32; 2]) -> T {
        let start = (plane * self.length) as u32;
        let at = [start + at[0], start + at[1]];
        let value = groups::<T>(&self.values, at);
        T::new(value, if T::DUAL { groups::<T>(&self.tangents, at) } else { value })
    }

    /// Adds to two groups of pixels.
    #[inline(always)]
    pub(super) fn add(&mut self, plane: usize, at: [u32; 2], numbers: T) {
        let start = (plane * self.length) as u32;
        let at = [start + at[0], start + at[1]];
        numbers.value().add_to_groups(&mut self.values, at);
        if T::DUAL {
            numbers.output().add_to_groups(&mut self.tangents, at);
        }
    }

    /// The larger of what is there and these numbers, the first group first.
    #[inline(always)]
    pub(super) fn raise(&mut self, at: [u32; 2], numbers: T::Lanes) {
        let numbers = numbers.array();
        for (half, at) in at.into_iter().enumerate() {
            for i in 0..GROUP {
                let place = &mut self.values[at as usize + i];
                let number = numbers[half * GROUP + i];
                *place = if number > *place { number } else { *place };
            }
        }
    }

    /// Vector `k` of a plane.
    #[inline(always)]
    pub(super) fn vector(&self, plane: usize, k: usize) -> T {
        let at = plane * self.length + k * LANES;
        let value = vector::<T>(&self.values, at);
        T::new(value, if T::DUAL { vector::<T>(&self.tangents, at) } else { value })
    }

    /// Sets vector `k` of a plane.
    #[inline(always)]
    pub(super) fn set(&mut self, plane: usize, k: usize, numbers: T) {
        let at = plane * self.length + k * LANES;
        self.values[at..at + LANES].copy_from_slice(&numbers.value().array());
        if T::DUAL {
            self.tangents[at..at + LANES].copy_from_slice(&numbers.output().array());
        }
    }

    /// Fills the first plane with one number.
    pub(super) fn fill(&mut self, number: Float<T>) {
        self.values[..self.length].fill(number);
    }

    /// What a kernel gives back of a plane: tangents if there are any, else values.
    pub(super) fn output(&self, plane: usize) -> &[Float<T>] {
        let numbers = if T::DUAL { &self.tangents } else { &self.values };
        &numbers[plane * self.length..(plane + 1) * self.length]
    }

    /// The values of a plane, to be written.
    pub(super) fn values_mut(&mut self, plane: usize) -> &mut [Float<T>] {
        &mut self.values[plane * self.length..(plane + 1) * self.length]
    }
}

// Functions, since closures have not the features of their callers.

#[inline(always)]
fn groups<T: Real>(numbers: &[Float<T>], [low, high]: [u32; 2]) -> T::Lanes {
    let low: &[Float<T>; GROUP] =
        numbers[low as usize..low as usize + GROUP].try_into().expect("a group of pixels");
    let high: &[Float<T>; GROUP] =
        numbers[high as usize..high as usize + GROUP].try_into().expect("a group of pixels");
    T::Lanes::of_groups(low, high)
}

#[inline(always)]
fn vector<T: Real>(numbers: &[Float<T>], at: usize) -> T::Lanes {
    T::Lanes::of(numbers[at..at + LANES].try_into().expect("a vector of pixels"))
}
