//! A custom softness with one method, over runs: solved with, learned, and saved to a file.

use occlusion::Occlusion;
use shape2d::colour::Coloured;
use softrast_cli::{EdgeChoice, Task, Variant};
use softrast_inverse::{
    InverseProblem, LearnConfig, Method, PoseProblem, ScaleSchedule, ScheduledSoftness,
    SolveConfig, learn, minimize,
};
use softrast_meta::MetaGradient;
use softrast_raster::{Projected, low_level::Rasterizer};
use softrast_softness::Softness;
use softrast_tensor::{Backend, NdArray, Tensor};
use softrast_tests::{Arctan, lopsided_mesh, vector};

type B = NdArray<f64>;

/// Mean hard loss at the start and the end of a run.
fn solved<P: InverseProblem>(
    problem: &P,
    softness: ScheduledSoftness<Arctan>,
    config: &SolveConfig,
) -> [f64; 2] {
    let method = Method::new("arctan", softness);
    let mut seen = Vec::new();
    minimize::<_, B>(problem, &[problem.instance(0).unwrap()], &method, config, |iterate, _| {
        seen.push(iterate.hard_loss[0]);
        Ok(())
    })
    .unwrap();
    [seen[0], seen[seen.len() - 1]]
}

#[test]
fn colours_and_depths_are_found_under_an_own_softness_of_edges() {
    let decay = ScheduledSoftness::decay(Arctan, 0.01, 0.0005);
    let args = shape2d::Args { triangles: Some(30), ..shape2d::Args::default() };
    let task = Coloured::new(&args, Variant::Original, &EdgeChoice::default()).unwrap();
    let config = SolveConfig { size: 32, steps: 40, learning_rate: 0.01 };
    let [first, last] = solved(&task, decay, &config);
    assert!(last < 0.8 * first, "colours: {first:?} to {last:?}");

    let task = Occlusion::new(&Default::default(), Variant::Original, &EdgeChoice::default());
    let config = SolveConfig { size: 16, steps: 60, learning_rate: 0.1 };
    let narrow = ScheduledSoftness::constant(Arctan, 0.0005);
    let [first, last] = solved(&task.unwrap(), narrow, &config);
    assert!(last < 0.2 * first, "depths: {first:?} to {last:?}");
}

/// An [`Arctan`] of the squared distance.
#[derive(Clone, Debug)]
struct Squared;

impl Softness for Squared {
    fn value<B: Backend, const D: usize>(
        &self,
        phi: Tensor<B, 1>,
        x: Tensor<B, D>,
    ) -> Tensor<B, D> {
        Arctan.value(phi, x.clone() * x.abs())
    }

    fn scale_is_squared(&self) -> bool {
        true
    }
}

#[test]
fn the_floor_of_a_schedule_is_squared_with_the_scale_of_an_own_softness() {
    let schedule = Some(ScaleSchedule { knots: vec![-20.0], floor_px: 0.5 });
    let softness = ScheduledSoftness { schedule, ..ScheduledSoftness::constant(Squared, 1.0) };
    let scale = f64::exp(-20.0) + 1.0 / 4096.0;
    assert!((softness.scale_at(0.5, 64) / scale - 1.0).abs() < 1e-12);
    assert!((softness.width_at(0.5, 64) / scale.sqrt() - 1.0).abs() < 1e-12);
}

#[test]
fn an_own_softness_is_learned_and_draws_the_same_out_of_its_file() {
    let start = Method::new("start", ScheduledSoftness::decay(Arctan, 0.3, 0.02));
    let runs = SolveConfig { size: 16, steps: 8, learning_rate: 2.0 };
    let estimator = Some(MetaGradient::default());
    let (updates, batch, validation_runs) = (4, 4, 4);
    let usual = LearnConfig::default();
    let config =
        LearnConfig { estimator, updates, batch, validation_runs, outer_rate: 0.2, ..usual };
    let mut losses = Vec::new();
    let problem = PoseProblem::new(&lopsided_mesh());
    let learned = learn::<_, B, _>(problem, &start, &runs, &config, |record| {
        losses.extend(record.validation_loss);
        Ok(())
    })
    .unwrap();
    assert!(losses[losses.len() - 1] < losses[0], "{losses:?}");
    assert_ne!(learned.schedule, start.softness.schedule);

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arctan.json");
    learned.save(&path).unwrap();
    let read = ScheduledSoftness::load_own(Arctan, &path).unwrap();
    assert_eq!(read, learned);
    let corners = vector::<B>(&[-0.6, -0.5, 1.0, 0.7, -0.4, 1.0, 0.1, 0.6, 1.0]);
    let drawn = |softness: &ScheduledSoftness<Arctan>| {
        let renderer = softness.renderer_at(0.5, Rasterizer::new(16), [[0, 1, 2]].into());
        renderer.silhouette(Projected::new(corners.clone().reshape([1, 3, 3]))).into_data()
    };
    assert_eq!(drawn(&read), drawn(&learned));
}
