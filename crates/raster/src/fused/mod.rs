//! Ops that run in one piece on the host, with their first and second derivatives.
//!
//! Each is written once, for a pass forward and one back. Run over dual numbers, the two give the second order. What a step does
//! around the rasterizer would else be a hundred small tensor ops, which take longer than the rasterizer.

mod camera;
mod image;
mod number;
pub(crate) mod pass;

use burn::tensor::{Element, TensorData};

use camera::{OrbitMatrix, Perspective};
use image::{Coverage, Iou, SquaredError};
pub(crate) use number::Number;
pub use pass::Pass;

use crate::{
    ProfileSum, SilhouetteLoss, SoftBlend,
    kernel::{self, Dual, Float, Inputs},
};

/// An op with derivatives of its own.
#[derive(Clone, Debug)]
pub enum FusedOp {
    /// See [`crate::profile_sum`].
    ProfileSum(ProfileSum),
    /// See [`crate::ColourRenderer`].
    #[doc(hidden)]
    SoftBlend(SoftBlend),
    /// See [`crate::SoftRenderer::mse_loss`].
    #[doc(hidden)]
    SilhouetteLoss(SilhouetteLoss),
    /// One that is written for any number.
    #[doc(hidden)]
    Elementary(ElementaryOp),
}

/// Floats that an op can run on without tensors, for callers that hold slices: f32 and f64.
pub trait Numbers: Element {
    /// Runs a pass over `slices` with the shapes `dims`; see [`Pass`] for what stands behind the inputs.
    ///
    /// # Panics
    ///
    /// If lengths and shapes do not fit the op.
    fn run_pass(op: &FusedOp, pass: &Pass, slices: &[&[Self]], dims: &[Vec<usize>]) -> TensorData;
}

impl FusedOp {
    /// The op of one call whose passes share what they find out: to be run on the same vertices only.
    pub fn keeping(&self) -> Self {
        match self {
            Self::ProfileSum(op) => Self::ProfileSum(op.keeping()),
            Self::SoftBlend(op) => Self::SoftBlend(op.keeping()),
            Self::SilhouetteLoss(op) => Self::SilhouetteLoss(op.keeping()),
            Self::Elementary(op) => Self::Elementary(*op),
        }
    }
}

/// Those that are written for any number.
#[derive(Clone, Copy, Debug)]
pub enum ElementaryOp {
    /// Orbits to matrices.
    OrbitMatrix,
    /// Points to what cameras see.
    Perspective,
    /// Sums to coverage.
    Coverage,
    /// Mean squared difference.
    SquaredError,
    /// One less the overlap over the union.
    Iou,
}

/// An op that is written for any number. `dims` are the shapes of the inputs.
trait Elementary: Sync {
    fn shape(&self, dims: &[Vec<usize>]) -> Vec<usize>;

    fn forward<N: Number>(&self, inputs: &[&[N]], dims: &[Vec<usize>]) -> Vec<N>;

    /// The gradients that are wanted, one after the other.
    fn vjp<N: Number>(
        &self,
        inputs: &[&[N]],
        dims: &[Vec<usize>],
        upstream: &[N::Float],
        wanted: &[bool],
    ) -> Vec<N>;
}

/// Floats of the ops that run on the host.
pub(crate) trait HostFloat: Numbers + Float + Number<Float = Self> {
    /// Number of pixel-face pairs that a walk visits.
    fn pairs(inputs: &Inputs<Self>) -> usize;
}

macro_rules! host_float {
    ($float:ty) => {
        // Functions that are not generic, so that the kernels are compiled here and not again in every crate that draws.
        impl HostFloat for $float {
            fn pairs(inputs: &Inputs<Self>) -> usize {
                kernel::pairs(inputs)
            }
        }

        impl Numbers for $float {
            fn run_pass(
                op: &FusedOp,
                pass: &Pass,
                slices: &[&[Self]],
                dims: &[Vec<usize>],
            ) -> TensorData {
                run(op, pass, slices, dims)
            }
        }
    };
}

host_float!(f32);
host_float!(f64);

fn run<F>(op: &FusedOp, pass: &Pass, slices: &[&[F]], dims: &[Vec<usize>]) -> TensorData
where
    F: Numbers + Float + Number<Float = F>,
{
    use ElementaryOp::{
        Coverage as C, Iou as I, OrbitMatrix as O, Perspective as P, SquaredError as E,
    };

    match op {
        FusedOp::ProfileSum(op) => op.run(pass, slices, dims),
        FusedOp::SoftBlend(op) => op.run(pass, slices, dims),
        FusedOp::SilhouetteLoss(op) => op.run(pass, slices, dims),
        FusedOp::Elementary(O) => elementary(&OrbitMatrix, pass, slices, dims),
        FusedOp::Elementary(P) => elementary(&Perspective, pass, slices, dims),
        FusedOp::Elementary(C) => elementary(&Coverage, pass, slices, dims),
        FusedOp::Elementary(E) => elementary(&SquaredError, pass, slices, dims),
        FusedOp::Elementary(I) => elementary(&Iou, pass, slices, dims),
    }
}

/// The derivatives of `Σ upstream · loss` by sums of profiles `[views, height, width]`, whose coverages a loss compares with a target, and how
/// they change as the sums move by `moved`. `dims` are the shapes of both images.
pub(crate) fn dual_upstream<F>(
    loss: ElementaryOp,
    [sums, moved, target, upstream]: [&[F]; 4],
    dims: &[Vec<usize>],
) -> [Vec<F>; 2]
where
    F: Float + Number<Float = F>,
{
    let dual = |(&value, &tangent)| Dual { value, tangent };
    let sums: Vec<_> = sums.iter().zip(moved).map(dual).collect();
    let target: Vec<_> = target.iter().map(|&value| Dual::constant(value)).collect();
    let coverage = Coverage.forward(&[&sums], &dims[..1]);
    let (inputs, wanted) = ([&coverage[..], &target[..]], [true, false]);
    let by_coverage = match loss {
        ElementaryOp::Iou => Iou.vjp(&inputs, dims, upstream, &wanted),
        _ => SquaredError.vjp(&inputs, dims, upstream, &wanted),
    };
    let one = Dual::constant(F::ONE);
    let by_sums = by_coverage.into_iter().zip(coverage).map(|(by, c)| by * (one - c));
    let (values, tangents) = by_sums.map(|number| (number.value, number.tangent)).unzip();
    [values, tangents]
}

fn elementary<F>(
    op: &impl Elementary,
    pass: &Pass,
    slices: &[&[F]],
    dims: &[Vec<usize>],
) -> TensorData
where
    F: Element + Float + Number<Float = F>,
{
    match pass {
        Pass::Forward => TensorData::new(op.forward(slices, dims), op.shape(dims)),
        Pass::Vjp { wanted } => {
            let (upstream, inputs) = slices.split_last().expect("an upstream");
            flat(op.vjp(inputs, dims, upstream, wanted))
        }
        Pass::VjpOfVjp { along, wanted } => {
            let [inputs @ .., upstream, direction] = slices else { panic!("a direction") };
            let mut direction = *direction;
            let dual = |(input, &along): (&&[F], &bool)| -> Vec<Dual<F>> {
                if !along {
                    return input.iter().map(|&value| Dual::constant(value)).collect();
                }
                let (own, rest) = direction.split_at(input.len());
                direction = rest;
                let number = |(&value, &tangent)| Dual { value, tangent };
                input.iter().zip(own).map(number).collect()
            };
            let duals: Vec<_> = inputs.iter().zip(along).map(dual).collect();
            let duals: Vec<_> = duals.iter().map(Vec::as_slice).collect();
            let (to_upstream, wanted) = wanted.split_last().expect("one for the upstream");
            // The Hessian is symmetric: to the inputs, it is the derivative of the gradient along the direction.
            let mut gradient = Vec::new();
            if wanted.contains(&true) {
                gradient = op.vjp(&duals, dims, upstream, wanted);
            }
            if *to_upstream {
                gradient.extend(op.forward(&duals, dims));
            }
            flat(gradient.into_iter().map(|number| number.tangent).collect())
        }
    }
}

pub(crate) fn flat<F: Element>(values: Vec<F>) -> TensorData {
    let length = values.len();
    TensorData::new(values, [length])
}

/// Parts of a tensor `[1 or views, ..]`, one for each view.
#[derive(Clone, Copy)]
struct Views<'a, N> {
    numbers: &'a [N],
    length: usize,
    shared: bool,
}

impl<'a, N> Views<'a, N> {
    fn new(numbers: &'a [N], dims: &[usize]) -> Self {
        let length = dims[1..].iter().product();
        Self { numbers, length, shared: dims[0] == 1 }
    }

    fn range(&self, view: usize) -> std::ops::Range<usize> {
        let start = if self.shared { 0 } else { view * self.length };
        start..start + self.length
    }

    fn of(&self, view: usize) -> &'a [N] {
        &self.numbers[self.range(view)]
    }

    fn of_mut<'b>(&self, numbers: &'b mut [N], view: usize) -> &'b mut [N] {
        &mut numbers[self.range(view)]
    }
}
