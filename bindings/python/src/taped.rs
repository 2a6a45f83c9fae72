//! Functions of one vector that are tensor ops: their gradients come from automatic differentiation, in f64.

use softrast_raster::{
    TConorm,
    low_level::{Pass, Silhouette, WeightTables},
};
use softrast_softness::EdgeSoftness;
use softrast_tensor::{Autodiff, Backend, DType, NdArray, Tensor, TensorData};

/// Which function.
#[derive(Clone, Debug)]
pub(crate) enum Taped {
    /// Parameters φ to a table, row by row.
    Table(Box<Silhouette<EdgeSoftness>>),
    /// Parameters of the softnesses by edge, of which there are so many, and by depth to their tables, row by row.
    Weights(Box<WeightTables>, usize),
    /// Sums to coverage, each by itself.
    Coverage(TConorm),
}

impl Taped {
    fn of<B: Backend>(&self, x: Tensor<B, 1>) -> Tensor<B, 1> {
        let table = match self {
            Self::Table(silhouette) => silhouette.table(x),
            Self::Weights(tables, split) => tables.of(both(x, *split)),
            Self::Coverage(t_conorm) => return t_conorm.coverage(x),
        };
        let count = table.shape().num_elements();
        table.reshape([count])
    }

    /// The values.
    pub(crate) fn forward(&self, x: &[f64]) -> Vec<f64> {
        numbers(self.of(vector(x)))
    }

    /// The gradient of `Σ upstream · f(x)`.
    pub(crate) fn vjp(&self, x: &[f64], upstream: &[f64]) -> Vec<f64> {
        numbers(self.gradient(vector(x), vector(upstream)))
    }

    /// The gradients of `Σ direction · vjp` to x and to the upstream.
    pub(crate) fn vjp_of_vjp(
        &self,
        x: &[f64],
        upstream: &[f64],
        direction: &[f64],
    ) -> [Vec<f64>; 2] {
        self.change([x, upstream, direction].map(vector)).map(numbers)
    }

    /// A pass over tensors of any backend: x, the upstream and the direction, as far as it has them.
    pub(crate) fn run<B: Backend>(&self, pass: &Pass, inputs: Vec<Tensor<B, 1>>) -> Tensor<B, 1> {
        let mut inputs = inputs.into_iter();
        let mut next = || inputs.next().expect("all inputs of the pass");
        match pass {
            Pass::Forward => self.of(next()),
            Pass::Vjp { .. } => self.gradient(next(), next()),
            Pass::VjpOfVjp { wanted, .. } => {
                let parts = self.change([next(), next(), next()]).into_iter().zip(wanted);
                let chosen = parts.filter(|&(_, &wanted)| wanted);
                Tensor::cat(chosen.map(|(part, _)| part).collect(), 0)
            }
        }
    }

    fn gradient<B: Backend>(&self, x: Tensor<B, 1>, upstream: Tensor<B, 1>) -> Tensor<B, 1> {
        let x = Tensor::<Autodiff<B>, 1>::from_inner(x).require_grad();
        let gradients = (self.of(x.clone()) * Tensor::from_inner(upstream)).sum().backward();
        x.grad(&gradients).unwrap_or_else(|| x.inner().zeros_like())
    }

    fn change<B: Backend>(&self, given: [Tensor<B, 1>; 3]) -> [Tensor<B, 1>; 2] {
        let [x, upstream, direction] = given.map(Tensor::<Autodiff<B>, 1>::from_inner);
        let leaves = [x, upstream].map(Tensor::require_grad);
        let inner =
            Tensor::<Autodiff<Autodiff<B>>, 1>::from_inner(leaves[0].clone()).require_grad();
        let sum = (self.of(inner.clone()) * Tensor::from_inner(leaves[1].clone())).sum();
        let Some(gradient) = inner.grad(&sum.backward()) else {
            return leaves.map(|leaf| leaf.inner().zeros_like());
        };
        let gradients = (gradient * direction).sum().backward();
        leaves.map(|leaf| leaf.grad(&gradients).unwrap_or_else(|| leaf.inner().zeros_like()))
    }
}

/// A vector in float64.
pub(crate) fn vector(values: &[f64]) -> Tensor<NdArray<f64>, 1> {
    let data = TensorData::new(values.to_vec(), [values.len()]);
    // Whatever float type the device has by default.
    Tensor::from_data(data, (&Default::default(), DType::F64))
}

/// The numbers of such a vector.
pub(crate) fn numbers(tensor: Tensor<NdArray<f64>, 1>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}

/// Both φ of a vector that has one behind the other.
pub(crate) fn both<B: Backend>(phi: Tensor<B, 1>, split: usize) -> [Tensor<B, 1>; 2] {
    let [count] = phi.dims();
    [phi.clone().narrow(0, 0, split), phi.narrow(0, split, count - split)]
}
