//! `profile_sum` as a burn backend extension: one op with its gradient and the gradient of that.

use std::sync::Arc;

use burn::{
    backend::{
        Autodiff,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind},
        },
    },
    tensor::{
        DType, Shape, Slice, Tensor, TensorData, TensorMetadata, TensorPrimitive, backend::Backend,
        ops::FloatTensor, try_read_sync,
    },
};

use crate::kernel::{self, Float, Grid, Inputs};

/// What stays the same over the calls of the op: faces, image size and the places of the knots.
#[derive(Clone, Debug)]
pub struct ProfileSum {
    pub(crate) faces: Arc<[[u32; 3]]>,
    pub(crate) grid: Grid,
    pub(crate) size: usize,
    pub(crate) near: f64,
    #[cfg(feature = "wgpu")]
    pub(crate) topology: crate::gpu::Topology,
}

impl ProfileSum {
    /// Number of pixel-face pairs that culling leaves for `vertices` `[views, vertices, 3]`: what
    /// each pass over all views visits.
    pub(crate) fn pairs<B: Backend>(&self, vertices: Tensor<B, 3>) -> usize {
        let [views, _, _] = vertices.dims();
        let data = vertices.swap_dims(1, 2).into_data();
        self.pairs_of(views, &data)
    }

    fn pairs_of(&self, views: usize, vertices: &TensorData) -> usize {
        match vertices.dtype {
            DType::F32 => kernel::pairs(&self.inputs::<f32>(views, slice(vertices), &[])),
            DType::F64 => kernel::pairs(&self.inputs::<f64>(views, slice(vertices), &[])),
            other => panic!("profile_sum works in f32 and f64, found {other:?}"),
        }
    }

    fn inputs<'a, F>(&'a self, views: usize, vertices: &'a [F], table: &'a [F]) -> Inputs<'a, F> {
        Inputs {
            vertices,
            table,
            faces: &self.faces,
            grid: self.grid,
            size: self.size,
            near: self.near,
            views,
        }
    }
}

/// A backend that can add up profiles over faces.
///
/// The defaults run on the host and serve every CPU backend; the implementation for `Autodiff<B>`
/// makes the op differentiable twice: `forward` differentiates by `B`'s `vjp`, and `vjp` by `B`'s
/// `vjp_of_vjp`. A third order panics. Saved for the backward pass are the inputs alone.
///
/// Shapes: `vertices` `[views, 3, vertices]` (x and y in NDC, depth in world units), `table`
/// `[rows, 4]`, sums `[views, size, size]`, top row first.
pub trait RasterBackend: Backend {
    /// Whether the op and little tensors are as quick on the CPU anyway: false where a tensor lies
    /// behind a queue, and what is computed of it in many little ops should come in one piece.
    const ON_HOST: bool = true;

    /// The numbers of a tensor, row by row, for a kernel on the host.
    fn host_data(tensor: FloatTensor<Self>) -> TensorData {
        read::<Self>(tensor)
    }

    /// Sums of the profile over the faces of each pixel.
    fn profile_sum(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        host::<Self>(op, vec![vertices, table], Pass::Forward)
    }

    /// Gradients of `Σ upstream · sums` to vertices and table, as one flat tensor in this order. The
    /// table's part is 0 unless `wrt_table`.
    fn profile_sum_vjp(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
        wrt_table: bool,
    ) -> FloatTensor<Self> {
        host::<Self>(op, vec![vertices, table, upstream], Pass::Vjp { wrt_table })
    }

    /// Pullback of `direction`, shaped like the result of [`RasterBackend::profile_sum_vjp`],
    /// through that function: gradients to vertices, table and upstream, flat, in this order.
    fn profile_sum_vjp_of_vjp(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
        direction: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        host::<Self>(op, vec![vertices, table, upstream, direction], Pass::VjpOfVjp)
    }
}

#[cfg(any(feature = "ndarray", feature = "wgpu"))]
impl RasterBackend for burn::backend::NdArray<f32> {
    fn host_data(tensor: FloatTensor<Self>) -> TensorData {
        ndarray_data::<Self>(tensor)
    }
}
#[cfg(any(feature = "ndarray", feature = "wgpu"))]
impl RasterBackend for burn::backend::NdArray<f64> {
    fn host_data(tensor: FloatTensor<Self>) -> TensorData {
        ndarray_data::<Self>(tensor)
    }
}
#[cfg(feature = "flex")]
impl RasterBackend for burn::backend::Flex {}

fn read<B: Backend>(tensor: FloatTensor<B>) -> TensorData {
    try_read_sync(B::float_into_data(tensor))
        .expect("the host path reads tensors synchronously")
        .expect("tensor data can be read")
}

/// Like [`read`], which copies number by number where a tensor is shared.
#[cfg(any(feature = "ndarray", feature = "wgpu"))]
fn ndarray_data<B>(tensor: FloatTensor<B>) -> TensorData
where
    B: Backend<FloatTensorPrimitive = burn::backend::ndarray::NdArrayTensor>,
{
    use burn::backend::ndarray::NdArrayTensor;

    let shape = tensor.shape();
    let copy = match &tensor {
        NdArrayTensor::F32(array) => {
            array.view().as_slice().map(|values| TensorData::new(values.to_vec(), shape))
        }
        NdArrayTensor::F64(array) => {
            array.view().as_slice().map(|values| TensorData::new(values.to_vec(), shape))
        }
        _ => None,
    };
    copy.unwrap_or_else(|| read::<B>(tensor))
}

/// Sums `profile(d)` over the faces of each pixel: the one op under every silhouette.
///
/// `vertices` is `[views, vertices, 3]`: x and y in NDC and the camera depth, which only decides
/// whether a face is drawn. `table` `[rows, 4]` comes from [`Profile::table`](crate::Profile::table)
/// of the profile that `op` was made for. The result is `[views, size, size]`, top row first.
///
/// # Panics
///
/// If the shapes do not fit or the float types differ.
pub fn profile_sum<B: RasterBackend>(
    op: &ProfileSum,
    vertices: Tensor<B, 3>,
    table: Tensor<B, 2>,
) -> Tensor<B, 3> {
    let [_, count, three] = vertices.dims();
    assert_eq!(three, 3, "vertices must be [views, vertices, 3], found {:?}", vertices.dims());
    assert_eq!(table.dims(), [op.grid.rows(), 4], "the table belongs to another profile");
    assert_eq!(vertices.dtype(), table.dtype(), "vertices and table differ in float type");
    let largest = op.faces.iter().flatten().max().map_or(0, |&v| v as usize + 1);
    assert!(largest <= count, "a face uses vertex {}, but there are {count}", largest - 1);
    let sums = B::profile_sum(op, primitive(vertices.swap_dims(1, 2)), primitive(table));
    Tensor::from_primitive(TensorPrimitive::Float(sums))
}

fn primitive<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> FloatTensor<B> {
    tensor.into_primitive().tensor()
}

enum Pass {
    Forward,
    Vjp { wrt_table: bool },
    VjpOfVjp,
}

/// Runs a pass on the host in the float type of the tensors.
fn host<B: RasterBackend>(
    op: &ProfileSum,
    tensors: Vec<FloatTensor<B>>,
    pass: Pass,
) -> FloatTensor<B> {
    let device = B::float_device(&tensors[0]);
    let views = tensors[0].shape()[0];
    let data: Vec<TensorData> = tensors.into_iter().map(B::host_data).collect();
    B::float_from_data(run(op, views, &data, &pass), &device)
}

/// Runs a pass in the float type of the data. Not generic, so that the kernels are compiled with
/// this crate and not again with everything that uses it.
fn run(op: &ProfileSum, views: usize, data: &[TensorData], pass: &Pass) -> TensorData {
    match data[0].dtype {
        DType::F32 => run_in::<f32>(op, views, data, pass),
        DType::F64 => run_in::<f64>(op, views, data, pass),
        other => panic!("profile_sum works in f32 and f64, found {other:?}"),
    }
}

fn slice<F: burn::tensor::Element>(data: &TensorData) -> &[F] {
    data.as_slice().expect("all tensors of a call have one float type")
}

fn run_in<F: Float + burn::tensor::Element>(
    op: &ProfileSum,
    views: usize,
    data: &[TensorData],
    pass: &Pass,
) -> TensorData {
    let slices: Vec<&[F]> = data.iter().map(slice).collect();
    let inputs = op.inputs(views, slices[0], slices[1]);
    let flat = |values: Vec<F>| {
        let length = values.len();
        TensorData::new(values, [length])
    };
    match pass {
        Pass::Forward => TensorData::new(kernel::forward(&inputs), [views, op.size, op.size]),
        Pass::Vjp { wrt_table } => flat(kernel::vjp(&inputs, slices[2], *wrt_table)),
        Pass::VjpOfVjp => flat(kernel::vjp_of_vjp(&inputs, slices[2], slices[3])),
    }
}

/// Cuts a flat tensor into parts of the given shapes.
fn split<B: Backend, const N: usize>(
    flat: FloatTensor<B>,
    shapes: [Shape; N],
) -> [FloatTensor<B>; N] {
    let mut start = 0;
    shapes.map(|shape| {
        let end = start + shape.num_elements();
        let part = B::float_slice(flat.clone(), &[Slice::from(start..end)]);
        start = end;
        B::float_reshape(part, shape)
    })
}

impl<B: RasterBackend, C: CheckpointStrategy> RasterBackend for Autodiff<B, C> {
    const ON_HOST: bool = B::ON_HOST;

    fn profile_sum(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Sum;

        impl<B: RasterBackend> Backward<B, 2> for Sum {
            type State = (ProfileSum, FloatTensor<B>, FloatTensor<B>);

            fn backward(
                self,
                ops: Ops<Self::State, 2>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let (op, vertices, table) = ops.state;
                let upstream = grads.consume::<B>(&ops.node);
                let shapes = [vertices.shape(), table.shape()];
                let wrt_table = ops.parents[1].is_some();
                let flat = B::profile_sum_vjp(&op, vertices, table, upstream, wrt_table);
                for (parent, grad) in ops.parents.into_iter().zip(split::<B, 2>(flat, shapes)) {
                    if let Some(parent) = parent {
                        grads.register::<B>(parent.id, grad);
                    }
                }
            }
        }

        let nodes = [vertices.node.clone(), table.node.clone()];
        match Sum.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let (vertices, table) = (vertices.primitive, table.primitive);
                let sums = B::profile_sum(op, vertices.clone(), table.clone());
                prep.finish((op.clone(), vertices, table), sums)
            }
            OpsKind::UnTracked(prep) => {
                prep.finish(B::profile_sum(op, vertices.primitive, table.primitive))
            }
        }
    }

    fn profile_sum_vjp(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
        wrt_table: bool,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Vjp;

        impl<B: RasterBackend> Backward<B, 3> for Vjp {
            type State = (ProfileSum, FloatTensor<B>, FloatTensor<B>, FloatTensor<B>);

            fn backward(
                self,
                ops: Ops<Self::State, 3>,
                grads: &mut Gradients,
                _checkpointer: &mut Checkpointer,
            ) {
                let (op, vertices, table, upstream) = ops.state;
                let direction = grads.consume::<B>(&ops.node);
                let shapes = [vertices.shape(), table.shape(), upstream.shape()];
                let flat = B::profile_sum_vjp_of_vjp(&op, vertices, table, upstream, direction);
                for (parent, grad) in ops.parents.into_iter().zip(split::<B, 3>(flat, shapes)) {
                    if let Some(parent) = parent {
                        grads.register::<B>(parent.id, grad);
                    }
                }
            }
        }

        let nodes = [vertices.node.clone(), table.node.clone(), upstream.node.clone()];
        match Vjp.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let state = (
                    op.clone(),
                    vertices.primitive.clone(),
                    table.primitive.clone(),
                    upstream.primitive.clone(),
                );
                let flat = B::profile_sum_vjp(
                    op,
                    vertices.primitive,
                    table.primitive,
                    upstream.primitive,
                    wrt_table,
                );
                prep.finish(state, flat)
            }
            OpsKind::UnTracked(prep) => prep.finish(B::profile_sum_vjp(
                op,
                vertices.primitive,
                table.primitive,
                upstream.primitive,
                wrt_table,
            )),
        }
    }

    fn profile_sum_vjp_of_vjp(
        op: &ProfileSum,
        vertices: FloatTensor<Self>,
        table: FloatTensor<Self>,
        upstream: FloatTensor<Self>,
        direction: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Third;

        impl<B: Backend> Backward<B, 4> for Third {
            type State = ();

            fn backward(self, _: Ops<(), 4>, _: &mut Gradients, _: &mut Checkpointer) {
                panic!("profile_sum is differentiable twice, not three times: use the reference");
            }
        }

        let nodes = [&vertices, &table, &upstream, &direction].map(|tensor| tensor.node.clone());
        let flat = B::profile_sum_vjp_of_vjp(
            op,
            vertices.primitive,
            table.primitive,
            upstream.primitive,
            direction.primitive,
        );
        Third.prepare::<C>(nodes).compute_bound().stateless(flat)
    }
}
