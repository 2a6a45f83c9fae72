use softrast_tensor::{Backend, Tensor};

use crate::{
    Softness,
    softness::{curve, forward},
};

/// A softness with bounded support: the coverage is 0 from `reach` scales outside the edge on, and 1 from as many inside.
///
/// The step in between is stretched to go from 0 to 1: `(s(x) - s(-r)) / (s(r) - s(-r))` with `r` the reach times the scale. This is the
/// remedy for a heavy tail such as that of an arctangent, whose coverage decreases with one over the distance. Without truncation every
/// face is drawn at every pixel, and hundreds of tails add up to an image that is opaque everywhere.
///
/// ```
/// use softrast_softness::{Family, Softness, Truncated};
/// use softrast_tensor::{NdArray, numbers, vector};
///
/// let softness = Truncated::new(Family::Cauchy, 3.0);
/// let phi = vector::<NdArray>(&softness.default_phi(0.1));
/// let coverage = numbers(softness.value(phi, vector(&[-0.31, 0.0, 0.31])));
/// assert_eq!(coverage, [0.0, 0.5, 1.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truncated<S> {
    softness: S,
    reach: f64,
}

impl<S: Softness> Truncated<S> {
    /// Truncates `softness` at `reach` times its scale on both sides of the edge.
    ///
    /// # Panics
    ///
    /// If `reach` is not positive and finite, or the first parameter of the softness is not the logarithm of its scale.
    pub fn new(softness: S, reach: f64) -> Self {
        assert!(reach > 0.0 && reach.is_finite(), "a reach of {reach} scales is not positive");
        assert!(softness.logarithms() > 0, "{softness:?} has no scale to count a reach in");
        Self { softness, reach }
    }
}

impl<S: Softness> Softness for Truncated<S> {
    curve!(self.value(phi, x) => {
        let scale = phi.clone().narrow(0, 0, 1).exp();
        let end = scale.clone() * self.reach;
        let ends = self.softness.value(phi.clone(), Tensor::cat(vec![end.clone().neg(), end], 0));
        let [low, high] = [0, 1].map(|k| ends.clone().narrow(0, k, 1).reshape([1; D]));
        let scale = scale.reshape([1; D]);
        let x = (x / scale.clone()).clamp(-self.reach, self.reach) * scale;
        let step = (self.softness.value(phi, x) - low.clone()) / (high - low);
        // Only rounding errors at the ends are outside.
        step.clamp(0.0, 1.0)
    });

    forward!(softness);

    fn scale_is_squared(&self) -> bool {
        self.softness.scale_is_squared()
    }
}

#[cfg(test)]
mod tests {
    use softrast_tensor::{DType, NdArray, numbers};

    use super::*;
    use crate::{Family, support};

    type B = NdArray<f64>;

    fn tensor(values: &[f64]) -> Tensor<B, 1> {
        Tensor::from_data(values, (&Default::default(), DType::F64))
    }

    #[test]
    fn a_heavy_tail_ends_where_the_reach_says() {
        let excess = 1e-8;
        let cauchy = Family::Cauchy.default_phi(0.01);
        let whole = support::<B>(&Family::Cauchy, &cauchy, excess, &Default::default()).outer;
        let cut = Truncated::new(Family::Cauchy, 4.0);
        let ended = support::<B>(&cut, &cauchy, excess, &Default::default()).outer;
        assert!(whole > 1e4, "{whole}");
        assert!((ended / 0.04 - 1.0).abs() < 1e-6, "{ended}");
    }

    #[test]
    fn the_step_is_that_of_the_softness_stretched_to_go_from_0_to_1() {
        let (scale, reach) = (0.1, 2.0);
        let cut = Truncated::new(Family::Cauchy, reach);
        let phi = tensor(&cut.default_phi(scale));
        let x = [-1e3, -0.2, -0.05, 0.0, 0.13, 0.2, 7.0];
        let expected = x.map(|x: f64| {
            let u = (x / scale).clamp(-reach, reach);
            0.5 + u.atan() / (2.0 * reach.atan())
        });
        for (found, expected) in numbers(cut.value(phi, tensor(&x))).iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14, "{found}, not {expected}");
        }
    }

    #[test]
    fn density_and_hazard_are_those_of_differences_and_0_beyond_the_ends() {
        let cut = Truncated::new(Family::Cauchy, 2.0);
        let phi = tensor(&cut.default_phi(0.1));
        let (x, h) = ([-0.5, -0.15, 0.03, 0.17, 0.5], 1e-6);
        for (name, curve, slope) in [
            (
                "density",
                &|x| cut.value(phi.clone(), x) as Tensor<B, 1>,
                cut.density(phi.clone(), tensor(&x)),
            ),
            ("hazard", &|x| cut.optical_depth(phi.clone(), x), cut.hazard(phi.clone(), tensor(&x))),
        ]
            as [(&str, &dyn Fn(Tensor<B, 1>) -> Tensor<B, 1>, Tensor<B, 1>); 2]
        {
            let [less, more] = [-h, h].map(|h| numbers(curve(tensor(&x.map(|x| x + h)))));
            for (k, found) in numbers(slope).into_iter().enumerate() {
                let expected = (more[k] - less[k]) / (2.0 * h);
                assert!(
                    (found - expected).abs() < 1e-6 * expected.abs().max(1.0),
                    "{name}: {found}, not {expected}"
                );
            }
        }
    }

    #[test]
    #[should_panic(expected = "a reach of 0 scales is not positive")]
    fn a_reach_of_nothing_is_refused() {
        Truncated::new(Family::Cauchy, 0.0);
    }
}
