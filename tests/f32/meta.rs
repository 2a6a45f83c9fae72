//! Meta-gradients in f32, compared with those in f64.

use softrast_meta::{Adam, BilevelProblem, InnerLoop, MetaGradient, OuterSteps};
use softrast_tensor::{Backend, NdArray};
use softrast_tests::{WAVES, numbers, vector};

fn meta_gradient<B: Backend>(scene: usize, steps: usize) -> Vec<f64> {
    let start: Vec<f64> =
        (0..4).map(|k| 1.5 * (1.7 * scene as f64 + 2.3 * k as f64).sin()).collect();
    let problem = BilevelProblem {
        objective: WAVES,
        // The first step of Adam has almost no derivative with respect to the softness: in f32 it is rounding. The direct term of the outer
        // loss dominates it.
        outer_loss: WAVES,
        inner: InnerLoop { optimizer: Adam::new(0.05), steps },
        start: vector::<B>(&start),
        outer_steps: OuterSteps::Last,
    };
    let mode = MetaGradient::Unrolled { clip: None };
    numbers(mode.estimate(&problem, &vector(&[-0.3, 0.4]), 0).gradient)
}

#[test]
fn single_precision_keeps_two_digits_of_a_gradient_through_ten_steps() {
    // Medians over twelve scenes; source: docs/notes.md, Meta-gradients: checks. After 30 steps a single digit is left: it is printed,
    // without a bound.
    for (steps, bound) in [(1, 1e-5), (10, 2e-2), (30, f64::INFINITY)] {
        let mut errors: Vec<f64> = (0..12)
            .map(|scene| {
                let single = meta_gradient::<NdArray<f32>>(scene, steps);
                let double = meta_gradient::<NdArray<f64>>(scene, steps);
                let norm = |values: Vec<f64>| values.iter().map(|x| x * x).sum::<f64>().sqrt();
                let off = single.iter().zip(&double).map(|(a, b)| a - b).collect();
                norm(off) / norm(double)
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        println!("{steps} steps: median {:.1e}, largest {:.1e}", errors[6], errors[11]);
        assert!(errors[6] <= bound, "{errors:?}");
    }
}
