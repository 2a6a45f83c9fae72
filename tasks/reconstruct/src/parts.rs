//! Messages between the parts of a step: gradients, and the states that a forward pass updates, as plain numbers.

use softrast_tensor::{
    AutodiffBackend, Tensor, TensorData,
    burn::{
        module::{Module, ModuleMapper, ModuleVisitor, Param},
        optim::GradientsParams,
    },
};

/// Gradients of a module, 0 if missing, and its states, in the order of its parameters.
pub(crate) fn sent<B: AutodiffBackend, M: Module<B>>(
    module: &M,
    gradients: &GradientsParams,
) -> Vec<f32> {
    let mut sender = Sender { gradients, numbers: Vec::new() };
    module.visit(&mut sender);
    sender.numbers
}

/// The module with other states, and the gradients, from the numbers of [`sent`].
pub(crate) fn received<B: AutodiffBackend, M: Module<B>>(
    module: M,
    numbers: &[f32],
) -> (M, GradientsParams) {
    let mut receiver = Receiver { gradients: GradientsParams::new(), numbers };
    let module = module.map(&mut receiver);
    assert!(receiver.numbers.is_empty(), "numbers are those of another module");
    (module, receiver.gradients)
}

struct Sender<'a> {
    gradients: &'a GradientsParams,
    numbers: Vec<f32>,
}

impl<B: AutodiffBackend> ModuleVisitor<B> for Sender<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        let value = param.val();
        let sent = match value.is_require_grad() {
            false => value.inner(),
            true => {
                let gradient = self.gradients.get::<B::InnerBackend, D>(param.id);
                gradient.unwrap_or_else(|| value.inner().zeros_like())
            }
        };
        self.numbers.extend(sent.into_data().iter::<f32>());
    }
}

struct Receiver<'a> {
    gradients: GradientsParams,
    numbers: &'a [f32],
}

impl<B: AutodiffBackend> ModuleMapper<B> for Receiver<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let value = param.val();
        let (numbers, rest) = self.numbers.split_at(value.shape().num_elements());
        self.numbers = rest;
        let data = TensorData::new(numbers.to_vec(), value.shape()).convert_dtype(value.dtype());
        let options = (&value.device(), value.dtype());
        if value.is_require_grad() {
            let gradient = Tensor::<B::InnerBackend, D>::from_data(data, options);
            self.gradients.register::<B::InnerBackend, D>(param.id, gradient);
            return param;
        }
        let (id, _, mapper) = param.consume();
        Param::from_mapped_value(id, Tensor::from_data(data, options), mapper)
    }
}
