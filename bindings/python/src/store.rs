//! Where the numbers of a call lie: in slices of the host, or in tensors of a device.

use std::borrow::Borrow;

use softrast_raster::low_level::{FusedOp, Pass};

use crate::{
    arrays::{Array, Float, Floats, MIXED, same},
    taped::{Taped, numbers, vector},
};

/// A place and a float type of numbers, with what functions do to them besides running ops.
pub(crate) trait Store: Clone + Send + Sync + 'static {
    /// Numbers that are borrowed.
    type Slice: ?Sized + Sync + ToOwned<Owned = Self::Owned>;
    /// Numbers that are owned.
    type Owned: Borrow<Self::Slice> + Send;
    /// Whether they are read on the host. Losses of silhouettes have a kernel there, and calls are recognised by their numbers.
    const ON_HOST: bool;

    /// Numbers of an array, if they lie here.
    fn known<'a>(floats: &'a Floats<'_>) -> Option<&'a Self::Slice>;
    /// Numbers as those of an array.
    fn floats(values: Self::Owned) -> Floats<'static>;

    fn count(values: &Self::Slice) -> usize;
    /// The numbers in float64, on the host.
    fn wide(values: &Self::Slice) -> Vec<f64>;
    /// Numbers rounded to this type, in the same place as others.
    fn narrow(values: &[f64], beside: &Self::Slice) -> Self::Owned;
    /// A number repeated, in the same place as others.
    fn filled(value: f64, count: usize, beside: &Self::Slice) -> Self::Owned;
    fn sum(a: Self::Owned, b: &Self::Slice) -> Self::Owned;
    /// The products of equal parts of the numbers and the factor of each.
    fn scaled(values: &Self::Slice, factors: &Self::Slice) -> Self::Owned;
    /// All numbers, one array after the other.
    fn concatenated(parts: &[&Self::Slice]) -> Self::Owned;
    /// The inverse of `concatenated`.
    fn split(values: Self::Owned, counts: &[usize]) -> Vec<Self::Owned>;
    fn finite(values: &Self::Slice) -> bool;
    /// Whether both have the same bits. Only on the host.
    fn same(a: &Self::Slice, b: &Self::Slice) -> bool;

    /// Runs a pass over numbers of these shapes, further ones flat. May panic.
    fn run(op: &FusedOp, pass: &Pass, inputs: &[&Self::Slice], dims: &[Vec<usize>]) -> Self::Owned;
    /// Runs a pass of a function of one vector. May panic.
    fn run_taped(of: &Taped, pass: &Pass, inputs: &[&Self::Slice]) -> Self::Owned;
}

/// An array of which it is known where its numbers lie and of what type they are.
pub(crate) struct View<'a, S: Store> {
    pub(crate) dims: Vec<usize>,
    pub(crate) values: &'a S::Slice,
}

// Derived, it would ask for numbers that can be cloned.
impl<S: Store> Clone for View<'_, S> {
    fn clone(&self) -> Self {
        Self { dims: self.dims.clone(), values: self.values }
    }
}

impl<'a> Array<'a> {
    pub(crate) fn view<S: Store>(&'a self) -> Result<View<'a, S>, String> {
        let values = S::known(&self.numbers).ok_or(MIXED)?;
        Ok(View { dims: self.dims.clone(), values })
    }
}

impl<F: Float> Store for F {
    type Slice = [F];
    type Owned = Vec<F>;
    const ON_HOST: bool = true;

    fn known<'a>(floats: &'a Floats<'_>) -> Option<&'a [F]> {
        F::of(floats)
    }

    fn floats(values: Vec<F>) -> Floats<'static> {
        F::any(values)
    }

    fn count(values: &[F]) -> usize {
        values.len()
    }

    fn wide(values: &[F]) -> Vec<f64> {
        values.iter().map(|x| x.elem()).collect()
    }

    fn narrow(values: &[f64], _: &[F]) -> Vec<F> {
        values.iter().map(|x| F::from_elem(*x)).collect()
    }

    fn filled(value: f64, count: usize, _: &[F]) -> Vec<F> {
        vec![F::from_elem(value); count]
    }

    fn sum(a: Vec<F>, b: &[F]) -> Vec<F> {
        a.into_iter().zip(b).map(|(a, b)| a + *b).collect()
    }

    fn scaled(values: &[F], factors: &[F]) -> Vec<F> {
        let mut all = values.to_vec();
        let part = (values.len() / factors.len().max(1)).max(1);
        for (part, factor) in all.chunks_mut(part).zip(factors) {
            part.iter_mut().for_each(|x| *x = *x * *factor);
        }
        all
    }

    fn concatenated(parts: &[&[F]]) -> Vec<F> {
        parts.concat()
    }

    fn split(mut values: Vec<F>, counts: &[usize]) -> Vec<Vec<F>> {
        let mut next = |&count: &usize| {
            let behind = values.split_off(count);
            std::mem::replace(&mut values, behind)
        };
        counts.iter().map(&mut next).collect()
    }

    fn finite(values: &[F]) -> bool {
        values.iter().all(|x| x.elem::<f64>().is_finite())
    }

    fn same(a: &[F], b: &[F]) -> bool {
        same(a, b)
    }

    fn run(op: &FusedOp, pass: &Pass, inputs: &[&[F]], dims: &[Vec<usize>]) -> Vec<F> {
        F::run_pass(op, pass, inputs, dims).into_vec().expect("results in the type of the inputs")
    }

    /// In float64, whatever type the arrays have.
    fn run_taped(of: &Taped, pass: &Pass, inputs: &[&[F]]) -> Vec<F> {
        let inputs = inputs.iter().map(|values| vector(&Self::wide(values))).collect();
        numbers(of.run(pass, inputs)).into_iter().map(F::from_elem).collect()
    }
}
