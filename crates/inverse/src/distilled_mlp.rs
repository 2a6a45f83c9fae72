use std::sync::LazyLock;

use softrast_meta::{Adam, Optimizer};
use softrast_raster::HostBackend;
use softrast_softness::{EdgeSoftness, Family, Softness, families::Mlp, initial_mlp};
use softrast_tensor::{Autodiff, Backend, Tensor, numbers, vector};

/// The fit covers distances up to this many scales from the edge, and logits up to this size. That is far above the
/// 14.1 that an MLP needs far outside so that many faces contribute nothing there: see [`initial_mlp`].
const REACH: f64 = 24.0;
/// Sample distances on one side of the edge; the MLP is odd.
const PLACES: usize = 48;
/// Ratio of the sample density at the edge to that at the end, as the argument of a hyperbolic sine.
const DENSER: f64 = 3.0;
/// Steps of the fit, and first and last learning rate.
const STEPS: usize = 3000;
const RATES: [f64; 2] = [0.1, 3e-4];
/// Largest deviation from 1 of the summed coverage on both sides of an edge.
const SYMMETRIC: f64 = 1e-4;

/// Weights `[56]` of an MLP softness that is a logistic of scale 1, to 3e-3.
pub fn distilled_mlp() -> Vec<f64> {
    static FITTED: LazyLock<Vec<f64>> = LazyLock::new(|| {
        let logistic = EdgeSoftness::new(Family::Logistic);
        mlp_like(logistic, &logistic.default_phi(1.0)).unwrap_or_default()
    });
    FITTED.clone()
}

/// Weights `[56]` of an MLP softness that approximates a softness of scale 1; `None` if that is not
/// symmetric about the edge, as an MLP is.
///
/// Fitted by least squares on the logit up to `REACH`, always from the same random weights. The
/// error at a distance is divided by one scale plus the distance: at the edge the logit decides the
/// image, and far from it the logit only has to be large.
///
/// ```
/// use softrast_inverse::mlp_like;
/// use softrast_softness::{EdgeSoftness, Family, Softness};
///
/// let one_sided = EdgeSoftness::new(Family::Gamma);
/// assert_eq!(mlp_like(one_sided, &one_sided.default_phi(1.0)), None);
/// ```
pub fn mlp_like(softness: EdgeSoftness, phi: &[f64]) -> Option<Vec<f64>> {
    type A = Autodiff<HostBackend>;
    let place = |k: usize| {
        let share = (k + 1) as f64 / PLACES as f64;
        REACH * (DENSER * share).sinh() / DENSER.sinh()
    };
    let places: Vec<f64> = (0..PLACES).map(place).collect();
    let counts: Vec<f64> = places.iter().map(|x| 1.0 / (1.0 + x)).collect();
    let [places, counts, phi] = [&places[..], &counts[..], phi].map(vector::<A>);
    let inside = softness.value(phi.clone(), places.clone());
    let both = inside + softness.value(phi.clone(), places.clone().neg());
    if numbers(both.inner()).into_iter().any(|sum| (sum - 1.0).abs() > SYMMETRIC) {
        return None;
    }
    let aim = logit(&softness, &phi, places.clone()).clamp_max(REACH);
    let mut theta = vector::<HostBackend>(&initial_mlp(0, 1.0));
    let mut state = Adam::new(RATES[0]).init(&theta);
    for step in 0..STEPS {
        let part = step as f64 / STEPS as f64;
        let adam = Adam::new(RATES[0] * (RATES[1] / RATES[0]).powf(part));
        let leaf = Tensor::<A, 1>::from_inner(theta.clone()).require_grad();
        let off = (logit(&Mlp, &leaf, places.clone()) - aim.clone()) * counts.clone();
        let grads = (off.clone() * off).mean().backward();
        let grad = leaf.grad(&grads).unwrap_or_else(|| theta.zeros_like());
        (theta, state) = adam.step(theta, grad, state);
    }
    Some(numbers(theta))
}

/// The argument of the sigmoid: `-ln(1 - s)` is its softplus, and it is odd where s is symmetric.
fn logit<B: Backend>(
    softness: &impl Softness,
    phi: &Tensor<B, 1>,
    x: Tensor<B, 1>,
) -> Tensor<B, 1> {
    softness.optical_depth(phi.clone(), x.clone()) - softness.optical_depth(phi.clone(), x.neg())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_distilled_mlp_has_the_logit_of_a_logistic_and_stays_large_beyond() {
        let phi = vector::<HostBackend>(&distilled_mlp());
        let at = |x: f64| numbers(logit(&Mlp, &phi, vector(&[x])))[0];
        for x in [0.1, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 24.0] {
            assert!((at(x) / x - 1.0).abs() < 0.04, "at {x}: {}", at(x));
        }
        assert!(at(100.0) > 20.0, "far: {}", at(100.0));
    }

    #[test]
    fn a_symmetric_softness_has_an_mlp_like_it_and_another_has_none() {
        let like = |family: Family| {
            let softness = EdgeSoftness::new(family);
            mlp_like(softness, &family.default_phi(1.0))
        };
        let gauss = vector::<HostBackend>(&Family::Gauss.default_phi(1.0));
        let mlp = vector::<HostBackend>(&like(Family::Gauss).unwrap());
        let places: Vec<f64> = (-60..=60).map(|k| 0.1 * f64::from(k)).collect();
        let places = vector::<HostBackend>(&places);
        let off = Family::Gauss.value(gauss, places.clone()) - Mlp.value(mlp, places);
        assert!(numbers(off).into_iter().all(|off| off.abs() < 1e-2));
        assert!(like(Family::Exp).is_none());
    }
}
