//! Fused ops on the host, with their first and second derivatives.
//!
//! Each has a forward and a backward pass; over dual numbers these give the second order. Without fusion, a step around the rasterizer
//! would be a hundred small tensor ops, which take longer than the rasterizer.

pub(crate) mod blend;
pub(crate) mod blend_loss;
pub(crate) mod elementary;
pub(crate) mod loss;
pub(crate) mod pass;
pub(crate) mod sum;

use softrast_kernel::Kernels;
use softrast_tensor::{Element, TensorData};

use blend::SoftBlend;
use blend_loss::BlendLoss;
pub use elementary::ElementaryOp;
use elementary::Number;
use loss::SilhouetteLoss;
pub use pass::Pass;
use sum::ProfileSum;

/// An op with custom derivatives.
///
/// The module [`low_level`](crate::low_level) has an example.
#[derive(Clone, Debug)]
pub enum FusedOp {
    /// See [`crate::low_level::profile_sum`].
    ProfileSum(ProfileSum),
    /// See [`crate::ColourRenderer`].
    #[doc(hidden)]
    SoftBlend(SoftBlend),
    /// See [`crate::ColourRenderer::mse_loss`].
    #[doc(hidden)]
    BlendLoss(BlendLoss),
    /// See [`crate::SoftRenderer::mse_loss`].
    #[doc(hidden)]
    SilhouetteLoss(SilhouetteLoss),
    /// An op that is generic over the number type.
    #[doc(hidden)]
    Elementary(ElementaryOp),
}

/// Float types of ops on slices, without tensors: f32 and f64.
///
/// The module [`low_level`](crate::low_level) has an example.
pub trait Numbers: Element {
    /// Runs a pass over `slices` with the shapes `dims`; see [`Pass`] for the inputs that follow those of the op.
    ///
    /// # Panics
    ///
    /// If lengths and shapes do not fit the op.
    fn run_pass(op: &FusedOp, pass: &Pass, slices: &[&[Self]], dims: &[Vec<usize>]) -> TensorData;
}

impl FusedOp {
    /// The op of a call whose passes share a cache: to be run on the same vertices only.
    pub fn keeping(&self) -> Self {
        match self {
            Self::ProfileSum(op) => Self::ProfileSum(op.keeping()),
            Self::SoftBlend(op) => Self::SoftBlend(op.keeping()),
            Self::BlendLoss(op) => Self::BlendLoss(op.keeping()),
            Self::SilhouetteLoss(op) => Self::SilhouetteLoss(op.keeping()),
            Self::Elementary(op) => Self::Elementary(*op),
        }
    }
}

macro_rules! host_float {
    ($float:ty) => {
        // A function without generics, compiled in this crate instead of in each crate that draws.
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
    F: Numbers + Kernels + Number<Float = F>,
{
    match op {
        FusedOp::ProfileSum(op) => op.run(pass, slices, dims),
        FusedOp::SoftBlend(op) => op.run(pass, slices, dims),
        FusedOp::BlendLoss(op) => op.run(pass, slices, dims),
        FusedOp::SilhouetteLoss(op) => op.run(pass, slices, dims),
        FusedOp::Elementary(op) => op.run(pass, slices, dims),
    }
}
