use softrast_meta::Objective;
use softrast_tensor::{Backend, Tensor};

/// A loss in closed form: `Σ exp(φ0) log cosh(θ - 0.2) + φ1 sin(θ) θ_next`, at step t times `1 + 0.1 t`.
///
/// It is smooth, coupled, not convex, and varies with the step.
#[derive(Clone, Copy, Debug)]
pub struct Waves {
    /// Whether the last parameter has no effect.
    pub dead: bool,
}

/// Every parameter has an effect.
pub const WAVES: Waves = Waves { dead: false };

impl<B: Backend> Objective<B> for Waves {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, step: usize) -> Tensor<B, 1> {
        let count = theta.dims()[0] - usize::from(self.dead);
        let theta = theta.narrow(0, 0, count);
        let next = Tensor::cat(
            vec![theta.clone().narrow(0, 1, count - 1), theta.clone().narrow(0, 0, 1)],
            0,
        );
        let off = theta.clone() - 0.2;
        let valley = ((off.clone().exp() + off.neg().exp()) * 0.5).log().sum();
        let [width, tilt] = [0, 1].map(|k| phi.clone().narrow(0, k, 1));
        let loss = valley * width.exp() + (theta.sin() * next).sum() * tilt;
        loss * (1.0 + 0.1 * step as f64)
    }
}
