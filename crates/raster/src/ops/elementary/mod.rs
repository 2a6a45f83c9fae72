//! The trait of elementary ops, which are generic over the number type, and their passes.

mod camera;
mod image;
mod number;
mod op;

use softrast_kernel::{Dual, Float};
use softrast_tensor::{Element, TensorData};

pub(crate) use image::summed;
pub(crate) use number::Number;
pub use op::ElementaryOp;
pub(crate) use op::dual_upstream;

use super::pass::Pass;

/// An op that is generic over the number type. `dims` are the shapes of the inputs.
pub(super) trait Elementary: Sync {
    fn forward<N: Number>(&self, inputs: &[&[N]], dims: &[Vec<usize>]) -> Vec<N>;

    /// The wanted gradients, concatenated.
    fn vjp<N: Number>(
        &self,
        inputs: &[&[N]],
        dims: &[Vec<usize>],
        upstream: &[N::Float],
        wanted: &[bool],
    ) -> Vec<N>;
}

/// Runs a pass of an op; the result is flat.
pub(super) fn run<F>(
    op: &impl Elementary,
    pass: &Pass,
    slices: &[&[F]],
    dims: &[Vec<usize>],
) -> TensorData
where
    F: Element + Float + Number<Float = F>,
{
    match pass {
        Pass::Forward => flat(op.forward(slices, dims)),
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
            // The Hessian is symmetric: with respect to the inputs, the result is the derivative of the gradient along the direction.
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

/// A flat tensor of `values`.
pub(crate) fn flat<F: Element>(values: Vec<F>) -> TensorData {
    let length = values.len();
    TensorData::new(values, [length])
}

/// A tensor `[1 or views, ..]`, as one slice per view.
#[derive(Clone, Copy)]
pub(super) struct Views<'a, N> {
    pub(super) numbers: &'a [N],
    pub(super) length: usize,
    pub(super) shared: bool,
}

impl<'a, N> Views<'a, N> {
    pub(super) fn new(numbers: &'a [N], dims: &[usize]) -> Self {
        let length = dims[1..].iter().product();
        Self { numbers, length, shared: dims[0] == 1 }
    }

    pub(super) fn of(&self, view: usize) -> &'a [N] {
        let start = if self.shared { 0 } else { view * self.length };
        &self.numbers[start..start + self.length]
    }
}
