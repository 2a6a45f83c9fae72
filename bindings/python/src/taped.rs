//! Functions of one vector that are tensor ops: their gradients come from automatic differentiation, in f64.

use softrast_raster::{
    TConorm,
    low_level::{Silhouette, WeightTables},
};
use softrast_softness::EdgeSoftness;
use softrast_tensor::{Autodiff, Backend, DType, NdArray, Tensor, TensorData};

type Plain = NdArray<f64>;
type Once = Autodiff<Plain>;
type Twice = Autodiff<Once>;

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
        numbers(self.of(vector::<Plain>(x)))
    }

    /// The gradient of `Σ upstream · f(x)`.
    pub(crate) fn vjp(&self, x: &[f64], upstream: &[f64]) -> Vec<f64> {
        let x = vector::<Once>(x).require_grad();
        let gradients = (self.of(x.clone()) * vector(upstream)).sum().backward();
        numbers(x.grad(&gradients).unwrap_or_else(|| x.inner().zeros_like()))
    }

    /// The gradients of `Σ direction · vjp` to x and to the upstream.
    pub(crate) fn vjp_of_vjp(
        &self,
        x: &[f64],
        upstream: &[f64],
        direction: &[f64],
    ) -> [Vec<f64>; 2] {
        let [outer, weights] = [x, upstream].map(|numbers| vector::<Once>(numbers).require_grad());
        let inner = Tensor::<Twice, 1>::from_inner(outer.clone()).require_grad();
        let sum = (self.of(inner.clone()) * Tensor::from_inner(weights.clone())).sum();
        let nothing = || [x, upstream].map(|numbers| vec![0.0; numbers.len()]);
        let Some(gradient) = inner.grad(&sum.backward()) else { return nothing() };
        let gradients = (gradient * vector(direction)).sum().backward();
        [outer, weights]
            .map(|leaf| numbers(leaf.grad(&gradients).unwrap_or_else(|| leaf.inner().zeros_like())))
    }
}

fn vector<B: Backend>(values: &[f64]) -> Tensor<B, 1> {
    let data = TensorData::new(values.to_vec(), [values.len()]);
    // Whatever float type the device has by default.
    Tensor::from_data(data, (&Default::default(), DType::F64))
}

fn numbers(tensor: Tensor<Plain, 1>) -> Vec<f64> {
    tensor.into_data().iter().collect()
}

/// Both φ of a vector that has one behind the other.
pub(crate) fn both<B: Backend>(phi: Tensor<B, 1>, split: usize) -> [Tensor<B, 1>; 2] {
    let [count] = phi.dims();
    [phi.clone().narrow(0, 0, split), phi.narrow(0, split, count - split)]
}
