//! The loss of a problem with another softness than its own.

use softrast_inverse::{
    Instances, LearnConfig, Method, PoseProblem, ScheduledSoftness, SolveConfig,
};
use softrast_mesh::icosphere;
use softrast_meta::{MetaGradient, TaskDistribution};
use softrast_softness::{EdgeSoftness, Family};
use softrast_tensor::NdArray;
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

#[test]
fn a_problem_follows_another_softness_than_it_was_made_for() {
    let logistic = EdgeSoftness::new(Family::Logistic);
    let method = Method::new("start", ScheduledSoftness::constant(logistic, 0.1));
    let runs = SolveConfig { size: 12, steps: 3, learning_rate: 2.0 };
    let problem = PoseProblem::new(&icosphere(0));
    let instances =
        Instances::<_, B>::new(problem, &method, &runs, &LearnConfig::default()).unwrap();
    let [wide, narrow] = [instances.start(), vec![0.02_f64.ln()]].map(|phi| vector::<B>(&phi));
    let made_for_wide = instances.problem(0, &wide);
    let own = instances.problem(0, &narrow).loss(&narrow);
    let other = made_for_wide.loss(&narrow);
    assert!((other - own).abs() < 1e-3 * own, "{other}, not {own}");
    assert!((made_for_wide.loss(&wide) - own).abs() > 1e-2 * own);
    // Differences of whole runs are therefore no longer 0 for it.
    let es = MetaGradient::EvolutionStrategy { sigma: 0.5, pairs: 2 };
    assert!(numbers(es.estimate(&made_for_wide, &wide, 1).gradient)[0] != 0.0);
}
