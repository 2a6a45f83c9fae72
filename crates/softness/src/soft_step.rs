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
/// All other code of this library takes φ as an explicit vector; this type wraps softness and φ for burn's optimisers and recorders. The
/// family is not recorded: loading a record keeps that of the module it is loaded into.
///
/// ```
/// use softrast_softness::{EdgeSoftness, Family, SoftStep, Softness};
/// use softrast_tensor::{DType, NdArray, burn::module::Module, numbers, vector};
///
/// let softness = EdgeSoftness::new(Family::Logistic);
/// let phi = softness.default_phi(0.02);
/// let step = SoftStep::<NdArray>::new(softness, &phi, DType::F32, &Default::default());
/// assert_eq!(numbers(step.forward(vector(&[0.0, 1.0]))), [0.5, 1.0]);
/// assert_eq!(step.num_params(), 1);
/// ```
#[derive(Module, Debug)]
pub struct SoftStep<B: Backend> {
    /// The parameters φ, `[parameters]`.
    pub phi: Param<Tensor<B, 1>>,
    /// The softness of the parameters.
    #[module(skip)]
    pub softness: EdgeSoftness,
}

impl<B: Backend> SoftStep<B> {
    /// A step with the initial parameters `phi`, in the float type `dtype`.
    ///
    /// The type is an argument because burn's default is that of the first tensor of the process.
    ///
    /// # Panics
    ///
    /// If the length of `phi` is not the number of parameters of `softness`.
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
