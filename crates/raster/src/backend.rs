//! Fused ops as a burn backend extension, each with its gradient and its second derivative.

use rayon::prelude::*;
use softrast_kernel::{Kernels as _, PixelLoss, task};
use softrast_tensor::{
    Autodiff, Backend, DType, Element, FloatTensor, Shape, Slice, Tensor, TensorData,
    TensorMetadata, TensorPrimitive,
    autodiff::{Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind},
    try_read_sync,
};

use crate::{
    ProfileSum, SilhouetteLoss,
    ops::{ElementaryOp, FusedOp, Numbers, Pass},
};

/// Faces per task of a check.
const FACES: usize = 1 << 14;

fn slice<F: Element>(data: &TensorData) -> &[F] {
    data.as_slice().expect("all tensors of a call have one float type")
}

/// A backend that runs fused ops.
///
/// By default they run on the host, for all CPU backends. The implementation for `Autodiff<B>` makes them twice differentiable: the
/// derivative of each pass is the next pass of `B`. A third order panics. The backward pass reuses the inputs and intermediates such as the
/// faces per row.
///
/// [`Cameras`](crate::Cameras) has an example of code that is generic over backends.
#[diagnostic::on_unimplemented(
    message = "softrast does not draw on the backend `{Self}`",
    note = "it draws on `NdArray`, `Flex`, `softrast_raster::Wgpu` and `softrast_raster::Cuda`, and on `Autodiff` of these, of the features ndarray, flex, wgpu and cuda",
    note = "`Wgpu` and `Cuda` of burn itself are other types where its feature `fusion` is on"
)]
pub trait RasterBackend: Backend {
    /// Whether small ops on small tensors are as fast as on the CPU: false for backends whose tensors are behind a queue, for which
    /// sequences of small ops should run as one op.
    const ON_HOST: bool = true;

    /// The numbers of a tensor in place, in row-major order, if the backend can access them.
    fn numbers<F: Element>(tensor: &FloatTensor<Self>) -> Option<&[F]> {
        let _ = tensor;
        None
    }

    /// How often results are differentiable.
    const ORDERS: usize = 0;

    /// Whether a tensor has a gradient.
    fn is_tracked(tensor: &FloatTensor<Self>) -> bool {
        let _ = tensor;
        false
    }

    /// Runs a pass of an op. Backends whose tensors are not on the host run no [`FusedOp::SilhouetteLoss`] or [`FusedOp::BlendLoss`]. On WebAssembly only
    /// f32 is supported, which makes the module of a page smaller.
    fn run(op: &FusedOp, pass: &Pass, tensors: Vec<FloatTensor<Self>>) -> FloatTensor<Self> {
        match tensors[0].dtype() {
            DType::F32 => on_host::<Self, f32>(op, pass, tensors),
            #[cfg(not(target_family = "wasm"))]
            DType::F64 => on_host::<Self, f64>(op, pass, tensors),
            other => panic!("fused ops work in f32, and outside browsers in f64; found {other:?}"),
        }
    }

    /// Runs `seen` forward; at the outermost level of autodiff the gradient is that of `wide`, below it each op has its own.
    #[doc(hidden)]
    fn straight_through(seen: Call<Self>, wide: Call<Self>) -> FloatTensor<Self> {
        let _ = wide;
        Self::run(&seen.0, &Pass::Forward, seen.1)
    }
}

/// An op and its inputs.
type Call<B> = (FusedOp, Vec<FloatTensor<B>>);

/// The numbers of a tensor, or of its copy.
fn numbers<'a, B: RasterBackend, F: Element>(
    (tensor, copy): (&'a FloatTensor<B>, &'a Option<TensorData>),
) -> &'a [F] {
    match copy {
        Some(copy) => slice(copy),
        None => B::numbers(tensor).expect("numbers where they were"),
    }
}

/// Runs a pass over tensors of one float type on the host.
fn on_host<B: RasterBackend, F: Numbers>(
    op: &FusedOp,
    pass: &Pass,
    tensors: Vec<FloatTensor<B>>,
) -> FloatTensor<B> {
    let device = B::float_device(&tensors[0]);
    let dims: Vec<Vec<usize>> = tensors.iter().map(|tensor| tensor.shape().to_vec()).collect();
    let read = |tensor: &FloatTensor<B>| {
        B::numbers::<F>(tensor).is_none().then(|| {
            try_read_sync(B::float_into_data(tensor.clone()))
                .expect("the host path reads tensors synchronously")
                .expect("tensor data can be read")
        })
    };
    let copies: Vec<Option<TensorData>> = tensors.iter().map(read).collect();
    let slices: Vec<&[F]> = tensors.iter().zip(&copies).map(numbers::<B, F>).collect();
    B::float_from_data(F::run_pass(op, pass, &slices, &dims), &device)
}

#[cfg(any(feature = "ndarray", feature = "gpu"))]
mod ndarray {
    use bytemuck::checked::try_cast_slice;
    use softrast_tensor::{DType, Element, NdArray, NdArrayTensor};

    use super::RasterBackend;

    impl RasterBackend for NdArray<f32> {
        fn numbers<F: Element>(tensor: &NdArrayTensor) -> Option<&[F]> {
            in_place(tensor)
        }
    }
    impl RasterBackend for NdArray<f64> {
        fn numbers<F: Element>(tensor: &NdArrayTensor) -> Option<&[F]> {
            in_place(tensor)
        }
    }

    fn in_place<F: Element>(tensor: &NdArrayTensor) -> Option<&[F]> {
        match (tensor, F::dtype()) {
            (NdArrayTensor::F32(array), DType::F32) => {
                try_cast_slice(array.view().to_slice()?).ok()
            }
            (NdArrayTensor::F64(array), DType::F64) => {
                try_cast_slice(array.view().to_slice()?).ok()
            }
            _ => None,
        }
    }
}
#[cfg(feature = "flex")]
mod flex {
    use bytemuck::checked::try_cast_slice;
    use softrast_tensor::{Element, Flex, FloatTensor};

    use super::RasterBackend;

    impl RasterBackend for Flex {
        fn numbers<F: Element>(tensor: &FloatTensor<Self>) -> Option<&[F]> {
            let (start, end) = tensor.layout().contiguous_offsets()?;
            let numbers = try_cast_slice(tensor.bytes()).ok()?;
            (tensor.dtype() == F::dtype()).then(|| &numbers[start..end])
        }
    }

    #[test]
    fn numbers_are_read_where_they_lie() {
        use softrast_tensor::Tensor;

        let rows = Tensor::<Flex, 2>::from_floats([[1.0, 2.0], [3.0, 4.0]], &Default::default());
        let second = crate::backend::primitive(rows.clone().narrow(0, 1, 1));
        let found = Flex::numbers::<f32>(&second).expect("a row lies in one piece");
        assert_eq!(found, [3.0, 4.0]);
        let whole = crate::backend::primitive(rows.clone());
        let whole = Flex::numbers::<f32>(&whole).expect("as do all rows").as_ptr();
        assert_eq!(found.as_ptr(), whole.wrapping_add(2), "the numbers were copied");
        assert!(Flex::numbers::<f64>(&second).is_none());
        let columns = crate::backend::primitive(rows.transpose());
        assert!(Flex::numbers::<f32>(&columns).is_none());
    }
}

/// Number of pixel-face pairs after culling for `vertices` `[views, vertices, 3]`: each pass over all views visits them.
pub(crate) fn pairs<B: Backend>(op: &ProfileSum, vertices: Tensor<B, 3>) -> usize {
    let [views, _, _] = vertices.dims();
    let data = vertices.swap_dims(1, 2).into_data();
    match data.dtype {
        DType::F32 => f32::pairs(&op.inputs::<f32>(views, slice(&data), &[])),
        #[cfg(not(target_family = "wasm"))]
        DType::F64 => f64::pairs(&op.inputs::<f64>(views, slice(&data), &[])),
        other => panic!("fused ops work in f32, and outside browsers in f64; found {other:?}"),
    }
}

/// Sums `profile(d)` over the faces of each pixel: the op of every silhouette.
///
/// `vertices` is `[views, vertices, 3]`: x and y in NDC and the camera depth, which only determines whether a face is drawn. `table` is
/// `[rows, 4]`, computed by [`Profile::table`](crate::low_level::Profile::table) of the profile that `op` was created for. The result is
/// `[views, height, width]`, top row first.
///
/// # Panics
///
/// If the shapes do not fit or the float types differ.
pub fn profile_sum<B: RasterBackend>(
    op: &ProfileSum,
    vertices: Tensor<B, 3>,
    table: Tensor<B, 2>,
) -> Tensor<B, 3> {
    let (op, inputs) = sum_call(op, vertices, table);
    fused(&op, inputs)
}

/// The sums of `seen` with the vertex gradient of those of `wide`; see [`RasterBackend::straight_through`].
///
/// # Panics
///
/// If the shapes do not fit or the float types differ.
pub(crate) fn straight_through_sum<B: RasterBackend>(
    seen: (&ProfileSum, Tensor<B, 2>),
    wide: (&ProfileSum, Tensor<B, 2>),
    vertices: Tensor<B, 3>,
) -> Tensor<B, 3> {
    assert_eq!(seen.0.size, wide.0.size, "the image and its surrogate differ in size");
    let seen = sum_call(seen.0, vertices.clone(), seen.1.detach());
    let wide = sum_call(wide.0, vertices, wide.1.detach());
    of_primitive(B::straight_through(seen, wide))
}

fn sum_call<B: RasterBackend>(
    op: &ProfileSum,
    vertices: Tensor<B, 3>,
    table: Tensor<B, 2>,
) -> Call<B> {
    check(op, &vertices, &table);
    let inputs = vec![primitive(vertices.swap_dims(1, 2)), primitive(table)];
    (FusedOp::ProfileSum(op.clone()), inputs)
}

/// Panics unless vertices and table fit this op.
fn check<B: RasterBackend>(op: &ProfileSum, vertices: &Tensor<B, 3>, table: &Tensor<B, 2>) {
    let [_, count, three] = vertices.dims();
    assert_eq!(three, 3, "vertices must be [views, vertices, 3], found {:?}", vertices.dims());
    let (found, rows) = (table.dims(), op.grid.rows());
    assert_eq!(found, [rows, 4], "a table of this profile is [{rows}, 4], found {found:?}");
    assert_eq!(vertices.dtype(), table.dtype(), "vertices and table differ in float type");
    let largest = |faces: &[[u32; 3]]| faces.as_flattened().iter().copied().max();
    let largest = op.faces.par_chunks(FACES).map(|faces| task("check", || largest(faces)));
    let largest = largest.max().flatten().map_or(0, |v| v as usize + 1);
    assert!(largest <= count, "a face uses vertex {}, but there are {count}", largest - 1);
}

/// Loss `[views]` between silhouettes of the probabilistic sum and a target `[1 or views, height, width]`, with optional pixel weights of
/// the same shape. Only for tensors on the host; only the vertices may require a gradient.
///
/// # Panics
///
/// If the shapes do not fit or the float types differ.
pub(crate) fn silhouette_loss<B: RasterBackend>(
    op: &ProfileSum,
    loss: PixelLoss,
    vertices: Tensor<B, 3>,
    table: Tensor<B, 2>,
    target: Tensor<B, 3>,
    counted: Option<Tensor<B, 3>>,
) -> Tensor<B, 1> {
    check(op, &vertices, &table);
    let ([views, _, _], weighted) = (vertices.dims(), counted.is_some());
    let images: Vec<Tensor<B, 3>> = [target].into_iter().chain(counted).collect();
    for image in &images {
        let found = image.dims();
        let fits =
            found[1..] == [op.size.height, op.size.width] && (found[0] == 1 || found[0] == views);
        assert!(fits, "a target of {views} views of {:?} cannot be {found:?}", op.size);
        assert_eq!(vertices.dtype(), image.dtype(), "vertices and target differ in float type");
    }
    let mut inputs = vec![primitive(vertices.swap_dims(1, 2)), primitive(table)];
    inputs.extend(images.into_iter().map(primitive));
    let op = SilhouetteLoss { sum: op.clone(), loss, weighted, kept: None };
    fused(&FusedOp::SilhouetteLoss(op), inputs)
}

/// The result of an elementary op.
pub(crate) fn elementary<B: RasterBackend, const D: usize>(
    op: ElementaryOp,
    inputs: Vec<FloatTensor<B>>,
) -> Tensor<B, D> {
    fused(&FusedOp::Elementary(op), inputs)
}

/// The result of an op.
pub(crate) fn fused<B: RasterBackend, const D: usize>(
    op: &FusedOp,
    inputs: Vec<FloatTensor<B>>,
) -> Tensor<B, D> {
    of_primitive(B::run(op, &Pass::Forward, inputs))
}

/// The backend primitive of a tensor.
pub(crate) fn primitive<B: Backend, const D: usize>(tensor: Tensor<B, D>) -> FloatTensor<B> {
    tensor.into_primitive().tensor()
}

fn of_primitive<B: Backend, const D: usize>(tensor: FloatTensor<B>) -> Tensor<B, D> {
    Tensor::from_primitive(TensorPrimitive::Float(tensor))
}

/// Cuts a flat tensor into parts of the given shapes.
fn split<B: Backend>(flat: FloatTensor<B>, shapes: &[Shape]) -> Vec<FloatTensor<B>> {
    if let [shape] = shapes {
        return vec![B::float_reshape(flat, shape.clone())];
    }
    let mut start = 0;
    let part = |shape: &Shape| {
        let end = start + shape.num_elements();
        let part = B::float_slice(flat.clone(), &[Slice::from(start..end)]);
        start = end;
        B::float_reshape(part, shape.clone())
    };
    shapes.iter().map(part).collect()
}

impl<B: RasterBackend, C: CheckpointStrategy> RasterBackend for Autodiff<B, C> {
    const ON_HOST: bool = B::ON_HOST;
    const ORDERS: usize = B::ORDERS + 1;

    fn is_tracked(tensor: &FloatTensor<Self>) -> bool {
        !tensor.node.requirement.is_none()
    }

    fn run(op: &FusedOp, pass: &Pass, tensors: Vec<FloatTensor<Self>>) -> FloatTensor<Self> {
        match tensors.len() {
            1 => recorded::<B, C, 1>(op, pass, tensors),
            2 => recorded::<B, C, 2>(op, pass, tensors),
            3 => recorded::<B, C, 3>(op, pass, tensors),
            4 => recorded::<B, C, 4>(op, pass, tensors),
            5 => recorded::<B, C, 5>(op, pass, tensors),
            6 => recorded::<B, C, 6>(op, pass, tensors),
            7 => recorded::<B, C, 7>(op, pass, tensors),
            many => panic!("no op has {many} inputs"),
        }
    }

    fn straight_through(seen: Call<Self>, wide: Call<Self>) -> FloatTensor<Self> {
        let below = seen.1.into_iter().map(|tensor| tensor.primitive).collect();
        let result = B::run(&seen.0, &Pass::Forward, below);
        recorded_as::<B, C, 2>(&wide.0, &Pass::Forward, wide.1, |_, _| result)
    }
}

/// Autodiff operation of a pass, whose derivative is the next pass.
#[derive(Debug)]
struct Recorded;

/// Arguments of a pass: the op, the pass and its tensors.
type State<B> = (FusedOp, Pass, Vec<FloatTensor<B>>);

impl<B: RasterBackend, const N: usize> Backward<B, N> for Recorded {
    type State = State<B>;

    fn backward(self, ops: Ops<State<B>, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (op, pass, mut tensors) = ops.state;
        tensors.push(grads.consume::<B>(&ops.node));
        let wanted: Vec<bool> = ops.parents.iter().map(Option::is_some).collect();
        let parents = ops.parents.into_iter().zip(&tensors);
        let (parents, shapes): (Vec<_>, Vec<_>) =
            parents.filter_map(|(parent, tensor)| Some((parent?, tensor.shape()))).unzip();
        let next = match pass {
            Pass::Forward => Pass::Vjp { wanted },
            Pass::Vjp { wanted: along } => Pass::VjpOfVjp { along, wanted },
            Pass::VjpOfVjp { .. } => {
                panic!("fused ops are differentiable twice, not three times: use the reference")
            }
        };
        let gradients = split::<B>(B::run(&op, &next, tensors), &shapes);
        for (parent, gradient) in parents.into_iter().zip(gradients) {
            grads.register::<B>(parent.id, gradient);
        }
    }
}

fn recorded<B: RasterBackend, C: CheckpointStrategy, const N: usize>(
    op: &FusedOp,
    pass: &Pass,
    tensors: Vec<FloatTensor<Autodiff<B, C>>>,
) -> FloatTensor<Autodiff<B, C>> {
    recorded_as::<B, C, N>(op, pass, tensors, |op, tensors| B::run(op, pass, tensors))
}

/// The result of `work`, recorded as the result of a pass, so that its gradient is that of the pass.
fn recorded_as<B: RasterBackend, C: CheckpointStrategy, const N: usize>(
    op: &FusedOp,
    pass: &Pass,
    tensors: Vec<FloatTensor<Autodiff<B, C>>>,
    work: impl FnOnce(&FusedOp, Vec<FloatTensor<B>>) -> FloatTensor<B>,
) -> FloatTensor<Autodiff<B, C>> {
    let nodes: Vec<_> = tensors.iter().map(|tensor| tensor.node.clone()).collect();
    let nodes: [_; N] = nodes.try_into().expect("as many nodes as tensors");
    let tensors: Vec<_> = tensors.into_iter().map(|tensor| tensor.primitive).collect();
    match Backward::<B, N>::prepare::<C>(Recorded, nodes).compute_bound().stateful() {
        OpsKind::Tracked(prep) => {
            let op = op.keeping();
            let result = work(&op, tensors.clone());
            prep.finish((op, pass.clone(), tensors), result)
        }
        OpsKind::UnTracked(prep) => prep.finish(work(op, tensors)),
    }
}
