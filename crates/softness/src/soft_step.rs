use softrast_tensor::{
    Backend, DType, Tensor, TensorData,
    burn::{
        self,
        module::{Module, Param},
    },
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
