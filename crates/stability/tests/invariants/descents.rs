//! Whole descents: no shape in the target, any number of threads, the object out of view.

use softrast_inverse::SolveConfig;
use softrast_inverse::pose::PoseInstance;
use softrast_mesh::icosphere;
use stability::{
    Level, Trial,
    cases::{
        SCALE,
        poses::{instance, lopsided, solved},
        triangle::{Loss, MOVED, Moved, Triangles, target},
    },
    descend,
    planar_scene::PlanarScene,
};

use crate::hold_for_the_paper;

const SIDE: usize = 32;
const DISTANCE: f64 = 3.5;

/// O27: empty, full, one pixel, its own image.
#[test]
fn targets_without_a_shape_end_with_finite_numbers() {
    hold_for_the_paper(|tested| {
        let filled = |at: &dyn Fn(usize) -> f64| (0..SIDE * SIDE).map(at).collect::<Vec<f64>>();
        let one_pixel = filled(&|k| f64::from(u8::from(k == 5 * SIDE + 7)));
        let targets = [filled(&|_| 0.0), filled(&|_| 1.0), one_pixel, target()];
        let level = |target: Vec<f64>| {
            let trial = |loss: Loss| {
                let end = Moved { distance: 0.0, steps: 40, loss, ..MOVED }.run(tested, &target)?;
                Ok(Trial::at_most(0.0, 0.0).with(&end.numbers))
            };
            let trials: anyhow::Result<Vec<Trial>> =
                [Loss::Iou, Loss::Mse].map(trial).into_iter().collect();
            Ok(Level::named("target", trials?))
        };
        targets.map(level).into_iter().collect()
    });
}

/// O19: three bands of pixels, so that there is work for several threads.
#[test]
fn a_descent_has_the_same_bits_on_any_number_of_threads() {
    const SIDE: usize = 100;
    hold_for_the_paper(|tested| {
        let target = (0..SIDE * SIDE).map(|k| f64::from(u8::from(k % SIDE < k / SIDE))).collect();
        let flat = PlanarScene::random(31, 100);
        let problem = Triangles { flat, target, loss: Loss::Mse, factor: 1.0 };
        let config = SolveConfig { size: SIDE, steps: 2, learning_rate: 0.02 };
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
            pool.install(|| descend(&problem, &[()], tested.at(SCALE), config))
        };
        let one = run(1)?.numbers;
        let level = |threads: usize| {
            Ok(Level::new(threads as f64, vec![differing(&run(threads)?.numbers, &one)]))
        };
        [2, 5].map(level).into_iter().collect()
    });
}

/// O18.
#[test]
fn a_descent_run_twice_has_the_same_bits() {
    hold_for_the_paper(|tested| {
        let run = || Moved { steps: 30, ..MOVED }.run(tested, &target());
        Ok(vec![Level::named("again", vec![differing(&run()?.numbers, &run()?.numbers)])])
    });
}

fn differing(found: &[f64], expected: &[f64]) -> Trial {
    let same = found.iter().zip(expected).filter(|(a, b)| a.to_bits() == b.to_bits()).count();
    Trial::at_most((found.len().max(expected.len()) - same) as f64, 0.0).with(found)
}

/// O05: there is no pose to be found, but the distance.
#[test]
fn a_ball_is_found_from_any_angle() {
    hold_for_the_paper(|tested| {
        let level = |angle: f64| {
            let start = |direction| instance(DISTANCE, 1.3 * DISTANCE, angle, direction);
            let instances: Vec<PoseInstance> = (0..4).map(start).collect();
            let found = solved(tested, &icosphere(2), &instances, 40)?;
            let trial = |k: usize| Trial::at_most(found.lowest(k), 0.15).with(&found.numbers);
            Ok(Level::new(angle, (0..4).map(trial).collect()))
        };
        [20.0, 70.0].map(level).into_iter().collect()
    });
}

/// O20: cameras in the middle of the object and far from it.
#[test]
fn an_object_out_of_view_ends_with_finite_numbers() {
    hold_for_the_paper(|tested| {
        let mesh = lopsided()?;
        let level = |distance: f64| {
            let away = [instance(DISTANCE, distance, 30.0, 1), instance(1e-3, distance, 30.0, 2)];
            let found = solved(tested, &mesh, &away, 30)?;
            Ok(Level::new(distance, vec![Trial::at_most(0.0, 0.0).with(&found.numbers)]))
        };
        [0.0, 0.01, 0.5, 1.0, 1e3, 1e6].map(level).into_iter().collect()
    });
}
