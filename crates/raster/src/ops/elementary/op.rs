//! The ops that are generic over the number type.

use softrast_kernel::{Dual, Float, Judged, PixelLoss};
use softrast_tensor::{Element, TensorData};

use super::{
    Elementary,
    camera::{OrbitMatrix, Perspective},
    image::{Coverage, Iou, SquaredError},
    number::Number,
    run,
};

use crate::ops::pass::Pass;

/// An op that is generic over the number type.
#[derive(Clone, Copy, Debug)]
pub enum ElementaryOp {
    /// Orbits to matrices.
    OrbitMatrix,
    /// Perspective projection of points.
    Perspective,
    /// Sums to coverage.
    Coverage,
    /// The loss of an image relative to a target.
    Loss(PixelLoss),
}

impl ElementaryOp {
    #[cfg(feature = "gpu")]
    pub(crate) fn is_iou(self) -> bool {
        matches!(self, Self::Loss(PixelLoss::Iou))
    }

    /// The shape of the result.
    pub(crate) fn shape(self, dims: &[Vec<usize>]) -> Vec<usize> {
        match self {
            Self::OrbitMatrix => vec![dims[0][0], 3, 4],
            Self::Perspective => vec![dims[1][0], 3, dims[0][1]],
            Self::Coverage => dims[0].clone(),
            Self::Loss(_) => vec![dims[0][0].max(dims[1][0])],
        }
    }

    /// Runs a pass over `slices` with the shapes `dims`.
    pub(crate) fn run<F>(self, pass: &Pass, slices: &[&[F]], dims: &[Vec<usize>]) -> TensorData
    where
        F: Element + Float + Number<Float = F>,
    {
        let mut result = match self {
            Self::OrbitMatrix => run(&OrbitMatrix, pass, slices, dims),
            Self::Perspective => run(&Perspective, pass, slices, dims),
            Self::Coverage => run(&Coverage, pass, slices, dims),
            Self::Loss(PixelLoss::SquaredError) => run(&SquaredError, pass, slices, dims),
            Self::Loss(PixelLoss::Iou) => run(&Iou, pass, slices, dims),
        };
        if matches!(pass, Pass::Forward) {
            result.shape = self.shape(dims).into();
        }
        result
    }
}

/// The derivatives of `Σ upstream · loss` with respect to sums of profiles `[views, height, width]`, whose coverages a loss compares with a
/// target, and their derivatives as the sums move by `moved`. `dims` are the shapes of the image and of the target.
pub(crate) fn dual_upstream<F>(
    loss: PixelLoss,
    [sums, moved]: [&[F]; 2],
    Judged { target, counted }: Judged<F>,
    upstream: &[F],
    dims: &[Vec<usize>],
) -> [Vec<F>; 2]
where
    F: Float + Number<Float = F>,
{
    let dual = |(&value, &tangent)| Dual { value, tangent };
    let sums: Vec<_> = sums.iter().zip(moved).map(dual).collect();
    let target: Vec<_> = target.iter().map(|&value| Dual::constant(value)).collect();
    let share = |k: usize| counted.map_or(F::ONE, |counted| counted[k % counted.len()]);
    let mut coverage = Coverage.forward(&[&sums], &dims[..1]);
    let slopes: Vec<_> = coverage.iter().map(|&c| Dual::constant(F::ONE) - c).collect();
    for (k, coverage) in coverage.iter_mut().enumerate() {
        *coverage = coverage.scale(share(k));
    }
    let (inputs, wanted) = ([&coverage[..], &target[..]], [true, false]);
    let by_coverage = match loss {
        PixelLoss::Iou => Iou.vjp(&inputs, dims, upstream, &wanted),
        PixelLoss::SquaredError => SquaredError.vjp(&inputs, dims, upstream, &wanted),
    };
    let by_sums = by_coverage.into_iter().zip(slopes).enumerate();
    let by_sums = by_sums.map(|(k, (by, slope))| (by * slope).scale(share(k)));
    let (values, tangents) = by_sums.map(|number| (number.value, number.tangent)).unzip();
    [values, tangents]
}
