use burn::{
    module::{Module, Param},
    tensor::{DType, Tensor, TensorData, backend::Backend},
};

use crate::{EdgeSoftness, Softness};

/// A softness that owns its parameters, for use inside a network.
///
/// Everything else in this library takes φ as an explicit vector; this wraps the two for burn's
/// optimisers and recorders. The choice of family is not recorded: loading a record keeps that of
/// the module it is loaded into.
#[derive(Module, Debug)]
pub struct SoftStep<B: Backend> {
    /// The parameters φ, `[parameters]`.
    pub phi: Param<Tensor<B, 1>>,
    /// Which softness they belong to.
    #[module(skip)]
    pub softness: EdgeSoftness,
}

impl<B: Backend> SoftStep<B> {
    /// A step that begins with the parameters `phi`, in the float type `dtype`.
    ///
    /// The type is asked for, because burn's default is that of the first tensor of the process.
    ///
    /// # Panics
    ///
    /// If `phi` has another length than `softness` has parameters.
    pub fn new(softness: EdgeSoftness, phi: &[f64], dtype: DType, device: &B::Device) -> Self {
        assert_eq!(phi.len(), softness.parameters(), "wrong number of parameters for {softness:?}");
        let data = TensorData::new(phi.to_vec(), [phi.len()]);
        let phi = Tensor::from_data(data, (device, dtype));
        Self { phi: Param::from_tensor(phi), softness }
    }

    /// Coverage in [0, 1] at signed distances `x`, same shape.
    pub fn forward<const D: usize>(&self, x: Tensor<B, D>) -> Tensor<B, D> {
        self.softness.value(self.phi.val(), x)
    }
}

#[cfg(test)]
mod tests {
    use burn::{
        backend::{Autodiff, NdArray},
        module::AutodiffModule,
    };

    use super::*;
    use crate::Family;

    type B = Autodiff<NdArray<f64>>;

    fn step() -> SoftStep<B> {
        let softness = EdgeSoftness { family: Family::Logistic, squared: false };
        SoftStep::new(softness, &softness.default_phi(0.5), DType::F64, &Default::default())
    }

    #[test]
    fn a_step_passes_gradients_to_its_parameters() {
        let step = step();
        let x = Tensor::from_data([[0.5_f64]], (&Default::default(), DType::F64));
        let grads = step.forward::<2>(x).sum().backward();
        let found: f64 = step.phi.grad(&grads).unwrap().into_scalar();
        // ds / d ln(scale) = -u s (1 - s) at u = 1.
        let s = 1.0 / (1.0 + (-1.0_f64).exp());
        assert!((found + s * (1.0 - s)).abs() < 1e-15);
    }

    #[test]
    fn a_record_restores_the_parameters_and_leaves_the_family() {
        let trained = step();
        let mut other = step();
        other.phi = other.phi.map(|phi| phi + 1.0);
        other.softness.family = Family::Gauss;
        let other = other.load_record(trained.clone().into_record());
        assert_eq!(other.phi.val().into_data(), trained.phi.val().into_data());
        assert_eq!(other.softness.family, Family::Gauss);
        assert_eq!(trained.valid().softness, trained.softness);
    }
}
