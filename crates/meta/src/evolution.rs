use std::f64::consts::TAU;

use rand::{Rng, SeedableRng, rngs::StdRng};
use softrast_tensor::{Backend, Tensor, numbers, vector};

use crate::MetaEstimate;

/// The mean of `(L(φ + σ ε) - L(φ - σ ε)) / 2σ · ε` over `pairs` normal ε drawn from `seed`.
///
/// `run` gives the outer loss of a whole run. Both runs of a pair solve the same instance, so that
/// their common noise cancels.
///
/// Source: Salimans et al. 2017; docs/notes.md, Meta-gradients: clipping, for its quality here.
pub(crate) fn evolution<B: Backend>(
    run: impl Fn(&Tensor<B, 1>) -> f64,
    phi: &Tensor<B, 1>,
    sigma: f64,
    pairs: usize,
    seed: u64,
) -> MetaEstimate<B> {
    assert!(sigma > 0.0 && pairs > 0, "an evolution strategy needs a sigma and a pair");
    let mut random = StdRng::seed_from_u64(seed);
    let middle = numbers(phi.clone());
    let (mut loss, mut gradient) = (0.0, vec![0.0; middle.len()]);
    for _ in 0..pairs {
        let noise: Vec<f64> = middle.iter().map(|_| normal(&mut random)).collect();
        let [low, high] = [-sigma, sigma].map(|sigma| {
            let moved: Vec<f64> = middle.iter().zip(&noise).map(|(x, e)| x + sigma * e).collect();
            run(&vector(&moved))
        });
        loss += (low + high) / (2 * pairs) as f64;
        let slope = (high - low) / (2.0 * sigma * pairs as f64);
        gradient.iter_mut().zip(noise).for_each(|(sum, e)| *sum += slope * e);
    }
    MetaEstimate::without_steps(loss, vector(&gradient))
}

/// A standard normal number, by the Box-Muller transform.
pub fn normal(random: &mut StdRng) -> f64 {
    // From (0, 1], where the logarithm is finite.
    let reach = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    reach * (TAU * random.random::<f64>()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_moments_of_a_normal_number() {
        let mut random = StdRng::seed_from_u64(7);
        let noise: Vec<f64> = (0..20_000).map(|_| normal(&mut random)).collect();
        let mean = |power: i32| noise.iter().map(|x| x.powi(power)).sum::<f64>() / 20_000.0;
        // Four standard errors each.
        assert!(
            mean(1).abs() < 0.03 && (mean(2) - 1.0).abs() < 0.04 && (mean(4) - 3.0).abs() < 0.3
        );
    }
}
