//! Functions computed by softrast: their values, and derivatives from its own autodiff.

use std::{fmt, sync::Arc};

use burn::tensor::{DType, TensorData};
use softrast::{
    raster::RasterBackend,
    tensor::{Autodiff, NdArray, Tensor},
};

use crate::numbers::{Number, export, import};

/// A function of tensors, computed by softrast.
pub(crate) trait Function<const D: usize>: fmt::Debug + Send + Sync + 'static {
    /// Number of leading inputs that receive gradients: a softrast op may refuse a constant that requires a gradient.
    const MOVING: usize;

    fn value<B: RasterBackend>(&self, inputs: Vec<Tensor<B, 3>>) -> Tensor<B, D>;
}

/// A [`Function`] on tensor data, independent of the release.
pub(crate) trait Op: fmt::Debug + Send + Sync {
    /// The value.
    fn forward(&self, inputs: Vec<TensorData>) -> TensorData;
    /// The value, and its backward function.
    fn recorded(&self, inputs: Vec<TensorData>) -> (TensorData, Pull);
}

/// Backward function from the gradient of a value to those of its moving inputs; single use, as with every recorded graph.
#[derive(Clone)]
pub(crate) struct Pull(Arc<dyn Fn(TensorData) -> Vec<TensorData> + Send + Sync>);

impl Pull {
    pub(crate) fn back(&self, upstream: TensorData) -> Vec<TensorData> {
        (self.0)(upstream)
    }
}

impl fmt::Debug for Pull {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Pull")
    }
}

/// Runs a body with the backend and the float type of a tensor.
macro_rules! in_float_type {
    ($data:expr, |$backend:ident, $number:ident| $body:expr) => {
        match $data.dtype() {
            DType::F32 => {
                type $backend = NdArray<f32>;
                type $number = f32;
                $body
            }
            DType::F64 => {
                type $backend = NdArray<f64>;
                type $number = f64;
                $body
            }
            other => panic!("softrast works in f32 and f64, found {other:?}"),
        }
    };
}

/// A [`Function`] as an [`Op`].
#[derive(Debug)]
pub(crate) struct Of<T, const D: usize>(pub(crate) T);

impl<T: Function<D>, const D: usize> Op for Of<T, D> {
    fn forward(&self, inputs: Vec<TensorData>) -> TensorData {
        in_float_type!(inputs[0], |B, F| {
            let inputs = inputs.into_iter().map(import::<B, F, 3>).collect();
            export::<B, F, D>(self.0.value(inputs))
        })
    }

    fn recorded(&self, inputs: Vec<TensorData>) -> (TensorData, Pull) {
        in_float_type!(inputs[0], |B, F| recorded::<B, F, T, D>(&self.0, inputs))
    }
}

impl<T: Function<D>, const D: usize> Of<T, D> {
    /// The derivative of the value as the first input moves along `direction`.
    pub(crate) fn jvp(&self, inputs: Vec<TensorData>, direction: TensorData) -> TensorData {
        in_float_type!(inputs[0], |B, F| jvp::<B, F, D>(&self.0, inputs, direction))
    }

    /// The Hessian of `Σ weights · value` with respect to the first input, times `direction`; by default all weights are 1.
    pub(crate) fn hvp(
        &self,
        inputs: Vec<TensorData>,
        weights: Option<TensorData>,
        direction: TensorData,
    ) -> TensorData {
        in_float_type!(inputs[0], |B, F| hvp::<B, F, D>(&self.0, inputs, weights, direction))
    }
}

fn recorded<B: RasterBackend, F: Number, T: Function<D>, const D: usize>(
    function: &T,
    inputs: Vec<TensorData>,
) -> (TensorData, Pull) {
    let mut inputs: Vec<_> = inputs.into_iter().map(import::<Autodiff<B>, F, 3>).collect();
    let leaves: Vec<_> = inputs.drain(..T::MOVING).map(|moving| moving.require_grad()).collect();
    let value = function.value(leaves.iter().cloned().chain(inputs).collect());
    let data = export::<B, F, D>(value.clone().inner());
    let pull = move |upstream| {
        let gradients = (value.clone() * import::<Autodiff<B>, F, D>(upstream)).sum().backward();
        let of = |leaf: &Tensor<Autodiff<B>, 3>| {
            let gradient = leaf.grad(&gradients);
            export::<B, F, 3>(gradient.unwrap_or_else(|| leaf.clone().inner().zeros_like()))
        };
        leaves.iter().map(of).collect()
    };
    (data, Pull(Arc::new(pull)))
}

/// The gradient `Jᵀu` is linear in `u`, so the gradient of `v · Jᵀu` with respect to `u` is `J v`, for any `u`.
fn jvp<B: RasterBackend, F: Number, const D: usize>(
    function: &impl Function<D>,
    inputs: Vec<TensorData>,
    direction: TensorData,
) -> TensorData {
    let inputs: Vec<_> = inputs.into_iter().map(import::<Autodiff<Autodiff<B>>, F, 3>).collect();
    let (leaf, value) = at_leaf(function, inputs);
    let upstream = value.clone().inner().inner().ones_like();
    let upstream = Tensor::<Autodiff<B>, D>::from_inner(upstream).require_grad();
    let sum = (value * Tensor::from_inner(upstream.clone())).sum();
    let gradient = leaf.grad(&sum.backward()).expect("the value depends on its first input");
    let along = (gradient * import::<Autodiff<B>, F, 3>(direction)).sum();
    let derivative = upstream.grad(&along.backward()).expect("a gradient depends on the upstream");
    export::<B, F, D>(derivative)
}

fn hvp<B: RasterBackend, F: Number, const D: usize>(
    function: &impl Function<D>,
    inputs: Vec<TensorData>,
    weights: Option<TensorData>,
    direction: TensorData,
) -> TensorData {
    let mut inputs: Vec<_> = inputs.into_iter().map(import::<Autodiff<B>, F, 3>).collect();
    inputs[0] = inputs[0].clone().require_grad();
    let outer = inputs[0].clone();
    let (leaf, value) = at_leaf(function, inputs.into_iter().map(Tensor::from_inner).collect());
    let value = match weights {
        Some(weights) => value * import::<Autodiff<Autodiff<B>>, F, D>(weights),
        None => value,
    };
    let gradient = leaf.grad(&value.sum().backward()).expect("the value depends on its input");
    let along = (gradient * import::<Autodiff<B>, F, 3>(direction)).sum();
    let product = outer.grad(&along.backward());
    export::<B, F, 3>(product.unwrap_or_else(|| outer.inner().zeros_like()))
}

/// The first input as a leaf, and the value at it.
fn at_leaf<B: RasterBackend, const D: usize>(
    function: &impl Function<D>,
    mut inputs: Vec<Tensor<B, 3>>,
) -> (Tensor<B, 3>, Tensor<B, D>) {
    inputs[0] = inputs[0].clone().require_grad();
    let leaf = inputs[0].clone();
    (leaf, function.value(inputs))
}
