//! Poses under a softness of one's own. `minimize` judges hard images in f32, as programs do, so this is not tested in f64.

use softrast_inverse::{
    InverseProblem, Method, PoseProblem, ScheduledSoftness, SolveConfig, minimize,
};
use softrast_tensor::NdArray;
use softrast_tests::{Arctan, lopsided_mesh};

#[test]
fn poses_come_nearer_along_the_schedule_of_an_own_softness_and_of_its_surrogate() {
    let config = SolveConfig { size: 24, steps: 40, learning_rate: 2.0 };
    let problem = PoseProblem::new(&lopsided_mesh());
    let instances: Vec<_> = (0..8).map(|seed| problem.instance(seed).unwrap()).collect();
    let decay = ScheduledSoftness::decay(Arctan, 0.05, 0.002);
    for softness in [decay.clone(), decay.with_surrogate_scale(0.1)] {
        let method = Method::new("arctan", softness);
        let mut seen = Vec::new();
        minimize::<_, NdArray>(&problem, &instances, &method, &config, false, |iterate, _| {
            seen.push((iterate.hard_loss.iter().sum::<f64>() / 8.0, iterate.scale));
            Ok(())
        })
        .unwrap();
        let ((first, wide), (last, narrow)) = (seen[0], seen[seen.len() - 1]);
        assert!((wide - 0.05).abs() < 1e-12 && (narrow - 0.002).abs() < 1e-12);
        assert!(last < 0.9 * first, "{first} to {last}");
    }
}
