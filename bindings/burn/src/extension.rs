//! One op of burn 0.22 for all computations of softrast.

// NdArray is deprecated by burn, and offered while it exists. The macro's own code names it, so a narrower `allow` does not suffice.
#![cfg_attr(feature = "ndarray", allow(deprecated))]

use std::sync::Arc;

#[cfg(feature = "flex")]
use burn::backend::Flex;
#[cfg(feature = "ndarray")]
use burn::backend::NdArray;
use burn::{
    Tensor,
    backend::{
        Autodiff, Backend, Dispatch, TensorMetadata,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind},
        },
        backend_extension,
        tensor::FloatTensor,
    },
    tensor::{TensorData, read_sync},
};

use crate::op::{Function, Of, Op};

/// A backend whose tensor data is passed to softrast. The op has one or two inputs: an extension accepts no list of tensors.
#[backend_extension(
    Autodiff,
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray")
)]
pub(crate) trait HostBackend: Backend {
    fn of_one(input: FloatTensor<Self>, op: Arc<dyn Op>) -> FloatTensor<Self> {
        forward::<Self, 1>([input], &op)
    }

    fn of_two(
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        op: Arc<dyn Op>,
    ) -> FloatTensor<Self> {
        forward::<Self, 2>([first, second], &op)
    }
}

#[cfg(feature = "flex")]
impl HostBackend for Flex {}

#[cfg(feature = "ndarray")]
impl HostBackend for NdArray {}

impl<B: HostBackend, C: CheckpointStrategy> HostBackend for Autodiff<B, C> {
    fn of_one(input: FloatTensor<Self>, op: Arc<dyn Op>) -> FloatTensor<Self> {
        recorded::<B, C, 1>([input], &op)
    }

    fn of_two(
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        op: Arc<dyn Op>,
    ) -> FloatTensor<Self> {
        recorded::<B, C, 2>([first, second], &op)
    }
}

/// The value of a function of one tensor.
pub(crate) fn of_one<const D: usize>(function: impl Function<D>, input: Tensor<3>) -> Tensor<D> {
    let op = Arc::new(Of::<_, D>(function));
    Tensor::from_dispatch(<Dispatch as HostBackend>::of_one(input.into_dispatch(), op))
}

/// The value of a function of two tensors.
pub(crate) fn of_two<const D: usize>(
    function: impl Function<D>,
    inputs: [Tensor<3>; 2],
) -> Tensor<D> {
    let op = Arc::new(Of::<_, D>(function));
    let [first, second] = inputs.map(Tensor::into_dispatch);
    Tensor::from_dispatch(<Dispatch as HostBackend>::of_two(first, second, op))
}

fn forward<B: Backend, const N: usize>(
    inputs: [FloatTensor<B>; N],
    op: &Arc<dyn Op>,
) -> FloatTensor<B> {
    let device = inputs[0].device();
    B::float_from_data(op.forward(inputs.map(read::<B>).into()), &device)
}

fn recorded<B: Backend, C: CheckpointStrategy, const N: usize>(
    inputs: [FloatTensor<Autodiff<B, C>>; N],
    op: &Arc<dyn Op>,
) -> FloatTensor<Autodiff<B, C>> {
    let nodes = inputs.each_ref().map(|input| input.node());
    let inputs = inputs.map(|input| input.into_primitive());
    match Backward::<B, N>::prepare::<C>(PullBack, nodes).compute_bound().stateful() {
        OpsKind::UnTracked(prep) => prep.finish(forward::<B, N>(inputs, op)),
        OpsKind::Tracked(prep) => {
            let device = inputs[0].device();
            let (value, pull) = op.recorded(inputs.map(read::<B>).into());
            prep.finish(pull, B::float_from_data(value, &device))
        }
    }
}

#[derive(Debug)]
struct PullBack;

impl<B: Backend, const N: usize> Backward<B, N> for PullBack {
    type State = crate::op::Pull;

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let upstream = grads.consume::<B>(&ops.node);
        let device = upstream.device();
        let gradients = ops.state.back(read::<B>(upstream));
        for (parent, gradient) in ops.parents.into_iter().zip(gradients) {
            if let Some(node) = parent {
                grads.register::<B>(node.id, B::float_from_data(gradient, &device));
            }
        }
    }
}

fn read<B: Backend>(tensor: FloatTensor<B>) -> TensorData {
    read_sync(B::float_into_data(tensor)).expect("a CPU backend has its numbers at hand")
}
