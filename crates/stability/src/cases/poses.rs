//! POSE where it fails: from afar, from too near, too sharp, too small, too fast.

use pose::{Camera, Instance, Pose, PoseError, Scene};
use softrast_mesh::{Mesh, icosphere};
use softrast_runner::{Point, Run, Task, best_step};

use crate::{Case, Descended, Descent, Level, Promise, Tested, Trial, descent::Loss};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "O01",
        name: "decay past the optimum",
        quick: false,
        promise: Promise::Measured,
        scene: "POSE, a lopsided body, 24 x 24, 80 steps of 1, 4 seeds from 15 to 35 degrees",
        perturbation: "softness at the last step from 1e-1 to 1e-7 NDC, from ten times as wide at the \
                       first where it decays",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: past_the_optimum,
    },
    Case {
        id: "O25",
        name: "the best step is what is returned",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "POSE, a lopsided body, 24 x 24, 80 steps of 1, 4 seeds",
        perturbation: "softness at the last step from 1e-2 to 1e-7 NDC",
        measure: "hard IoU loss of what is returned over the lowest of any step",
        target: "1",
        run: best_is_returned,
    },
    Case {
        id: "O03",
        name: "POSE by angle of the start",
        quick: false,
        promise: Promise::Measured,
        scene: "POSE, a lopsided body, 24 x 24, 100 steps of 1.2, 8 directions at the right distance",
        perturbation: "angle between start and target, 5 to 90 degrees",
        measure: "degrees that the pose is off at the best step",
        target: "at most 5",
        run: angles,
    },
    Case {
        id: "O04",
        name: "POSE by distance of the start",
        quick: false,
        promise: Promise::Measured,
        scene: "POSE, a lopsided body, 24 x 24, 100 steps of 1.2, 8 directions at 20 degrees",
        perturbation: "distance of the start over that of the target, 0.5 to 4",
        measure: "degrees that the pose is off at the best step",
        target: "at most 5",
        run: distances,
    },
    Case {
        id: "O05",
        name: "POSE of a ball",
        quick: false,
        promise: Promise::Guaranteed,
        scene: "POSE, a ball, which looks alike from everywhere, 24 x 24, 40 steps",
        perturbation: "angle of the start, 20 and 70 degrees",
        measure: "hard IoU loss at the best step",
        target: "at most 0.15: the image fits, whatever the angle; finite",
        run: ball,
    },
    Case {
        id: "O07",
        name: "POSE by image size",
        quick: false,
        promise: Promise::Measured,
        scene: "POSE, a lopsided body, 80 steps of 1, 4 seeds from 15 to 35 degrees, softness 0.02 NDC",
        perturbation: "image of 8 to 128 pixels a side",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: sizes,
    },
    Case {
        id: "O16",
        name: "POSE by learning rate",
        quick: false,
        promise: Promise::Measured,
        scene: "POSE, a lopsided body, 24 x 24, 80 steps of 1, 4 seeds from 15 to 35 degrees",
        perturbation: "learning rate, about the degrees of a step, from 1e-3 to 10",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: rates,
    },
    Case {
        id: "O17",
        name: "POSE by range of the starts",
        quick: false,
        promise: Promise::Measured,
        scene: "POSE, a lopsided body, 24 x 24, 80 steps of 1, one start, 8 seeds",
        perturbation: "starts 15-35, 35-55 and 55-75 degrees away",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: ranges,
    },
    Case {
        id: "O20",
        name: "object out of view",
        quick: true,
        promise: Promise::Guaranteed,
        scene: "POSE, a lopsided body, 24 x 24, 30 steps; its camera is inside it, or a speck away, or \
                the target has nothing in view",
        perturbation: "distance of the start: 0, 0.01, 0.5, 1, 1e3, 1e6",
        measure: "1 if a loss, pose or image is not a finite number",
        target: "0",
        run: out_of_view,
    },
    Case {
        id: "O22",
        name: "POSE, softness from 1e-12 to 1e3",
        quick: false,
        promise: Promise::Measured,
        scene: "POSE, a lopsided body, 24 x 24, 60 steps of 1, 2 seeds from 15 to 35 degrees",
        perturbation: "softness from 1e-12 to 1e3 NDC",
        measure: "degrees that the returned pose is off",
        target: "at most 10",
        run: softness,
    },
];

/// The point of a run that it returns: where the hard image is best.
pub(super) fn end(run: &Run) -> Option<&Point> {
    best_step(&run.curve, |point| point.extra[0])
}

/// Solves seeds of a task, one trial each; `error` is what the flags of [`Case::target`] are held
/// against: 5 degrees, or no wrong pair.
pub(super) fn trials<T: Task>(
    tested: &Tested,
    flags: &str,
    runs: usize,
    error: impl Fn(&Run) -> f64,
) -> anyhow::Result<Vec<Trial>> {
    let runs = tested.solve::<T>(flags, runs)?;
    let trial = |run: &Run| {
        let error = error(run);
        let numbers: Vec<f64> = run
            .curve
            .iter()
            .flat_map(|p| {
                [p.loss, p.image_error, p.parameter_error].into_iter().chain(p.extra.clone())
            })
            .collect();
        Trial { reached: run.success, ..Trial::at_most(error, f64::INFINITY) }.with(&numbers)
    };
    Ok(runs.iter().map(trial).collect())
}

fn degrees(tested: &Tested, flags: &str, runs: usize) -> anyhow::Result<Vec<Trial>> {
    trials::<Pose>(tested, flags, runs, |run| end(run).map_or(f64::NAN, |end| end.parameter_error))
}

/// Degrees that seeds of the lopsided body end off.
fn of_body(tested: &Tested, flags: &str, runs: usize) -> anyhow::Result<Vec<Trial>> {
    with_body(|body| degrees(tested, &format!("--range 15-35 {body} {flags}"), runs))
}

/// Calls `work` with the flags for the lopsided body.
fn with_body<R>(work: impl FnOnce(&str) -> anyhow::Result<R>) -> anyhow::Result<R> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("body.obj");
    lopsided()?.write_obj(&path)?;
    work(&format!("--mesh {}", path.display()))
}

fn past_the_optimum(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |scale: f64| {
        let flags = format!("--size 24 --steps 80 --learning-rate 1 {}", tested.at(scale));
        Ok(Level::new(scale, of_body(tested, &flags, 4)?))
    };
    [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7].map(level).into_iter().collect()
}

fn best_is_returned(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |scale: f64| {
        let flags =
            format!("--range 15-35 --size 24 --steps 80 --learning-rate 1 {}", tested.at(scale));
        let runs = with_body(|body| tested.solve::<Pose>(&format!("{flags} {body}"), 4))?;
        let trial = |run: &Run| {
            let lowest = run.curve.iter().map(|p| p.extra[0]).fold(f64::INFINITY, f64::min);
            let returned = end(run).map_or(f64::NAN, |end| end.extra[0]);
            // What counts as a success is judged there too.
            let judged = end(run).is_some_and(|end| end.parameter_error <= 5.0) == run.success;
            let ratio = if judged { returned / lowest.max(1e-12) } else { f64::INFINITY };
            Trial::at_most(if judged && returned == lowest { 1.0 } else { ratio }, 1.0)
        };
        Ok(Level::new(scale, runs.iter().map(trial).collect()))
    };
    [1e-2, 1e-5, 1e-7].map(level).into_iter().collect()
}

fn sizes(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |size: u32| {
        let flags = format!("--size {size} --steps 80 --learning-rate 1 {}", tested.at(0.02));
        Ok(Level::new(f64::from(size), of_body(tested, &flags, 4)?))
    };
    [8, 16, 32, 64, 128].map(level).into_iter().collect()
}

fn rates(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |rate: f64| {
        let flags = format!("--size 24 --steps 80 --learning-rate {rate}");
        Ok(Level::new(rate, of_body(tested, &flags, 4)?))
    };
    [1e-3, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0].map(level).into_iter().collect()
}

fn ranges(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |range: &str| {
        let flags = format!("--range {range} --size 24 --steps 80 --learning-rate 1");
        let trials = with_body(|body| degrees(tested, &format!("{flags} {body}"), 8));
        Ok(Level::named(range, trials?))
    };
    ["15-35", "35-55", "55-75"].map(level).into_iter().collect()
}

fn softness(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let level = |scale: f64| {
        let flags = format!("--size 24 --steps 60 --learning-rate 1 {}", tested.at(scale));
        let mut trials = of_body(tested, &flags, 2)?;
        trials.iter_mut().for_each(|trial| trial.reached = trial.finite && trial.value <= 10.0);
        Ok(Level::new(scale, trials))
    };
    [1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e3].map(level).into_iter().collect()
}

/// A ball with a nose, a fin and an ear, so that no two poses look alike.
fn lopsided() -> anyhow::Result<Mesh> {
    let ball = icosphere(1);
    let bumps = [([0.0, 0.2, -1.0], 0.9), ([0.8, 0.6, 0.0], 0.5), ([-0.5, -0.7, 0.5], -0.3)];
    let bumped = |p: &[f64; 3]| {
        let bump = |&(to, by): &([f64; 3], f64)| {
            let along: f64 = (0..3).map(|k| p[k] * to[k]).sum();
            by * along.max(0.0).powi(6)
        };
        let factor = 0.6 * (1.0 + bumps.iter().map(bump).sum::<f64>());
        p.map(|x| factor * x)
    };
    Ok(Mesh::new(ball.positions().iter().map(bumped).collect(), ball.faces().to_vec())?)
}

const SIDE: usize = 24;
const DISTANCE: f64 = 3.5;

fn instance(target: f64, distance: f64, angle_deg: f64, direction: usize) -> Instance {
    let direction = std::f64::consts::TAU * (direction as f64 + 0.3) / 8.0;
    let camera =
        Camera { distance: target, elevation_deg: 20.0, azimuth_deg: 35.0, half_fov_deg: 20.0 };
    let start = Camera {
        distance,
        elevation_deg: angle_deg * direction.sin(),
        azimuth_deg: angle_deg * direction.cos(),
        half_fov_deg: 20.0,
    };
    Instance { target: camera, start }
}

/// Solves instances of a mesh side by side; the poses where each has its best hard image.
fn solved(
    tested: &Tested,
    mesh: &Mesh,
    instances: &[Instance],
    steps: usize,
) -> anyhow::Result<Descended> {
    let scene = Scene::new(mesh, instances, SIDE, false);
    let method = tested.method_at(0.005)?;
    let descent = Descent {
        method: &method,
        faces: scene.faces(),
        size: SIDE,
        steps,
        learning_rate: 1.2,
        loss: Loss::Iou,
        factor: 1.0,
    };
    let views = instances.len();
    Ok(descent.run(
        scene.start().inner().reshape([3 * views]),
        &scene.target().inner(),
        |theta| scene.project(theta.reshape([views, 3])),
        |theta| {
            let theta = burn::tensor::Tensor::from_inner(theta.reshape([views, 3]));
            scene.allowed(theta).inner().reshape([3 * views])
        },
    ))
}

fn angle_trials(
    tested: &Tested,
    mesh: &Mesh,
    start: impl Fn(usize) -> Instance,
) -> anyhow::Result<Vec<Trial>> {
    let instances: Vec<Instance> = (0..8).map(start).collect();
    let solved = solved(tested, mesh, &instances, 100)?;
    let trial = |view: usize| {
        let pose = solved.best(view);
        let error = PoseError::new([pose[0], pose[1], pose[2]], instances[view].target.distance);
        Trial::at_most(error.angle_deg, 5.0).with(&solved.numbers)
    };
    Ok((0..8).map(trial).collect())
}

fn angles(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let mesh = lopsided()?;
    let level = |angle: f64| {
        let start = |direction| instance(DISTANCE, DISTANCE, angle, direction);
        Ok(Level::new(angle, angle_trials(tested, &mesh, start)?))
    };
    [5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0].map(level).into_iter().collect()
}

fn distances(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let mesh = lopsided()?;
    let level = |factor: f64| {
        let start = |direction| instance(DISTANCE, factor * DISTANCE, 20.0, direction);
        Ok(Level::new(factor, angle_trials(tested, &mesh, start)?))
    };
    [0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0].map(level).into_iter().collect()
}

fn ball(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let mesh = icosphere(2);
    let level = |angle: f64| {
        let instances: Vec<_> =
            (0..4).map(|direction| instance(DISTANCE, 1.3 * DISTANCE, angle, direction)).collect();
        let solved = solved(tested, &mesh, &instances, 40)?;
        let trial = |view: usize| Trial::at_most(solved.lowest(view), 0.15).with(&solved.numbers);
        Ok(Level::new(angle, (0..4).map(trial).collect()))
    };
    [20.0, 70.0].map(level).into_iter().collect()
}

fn out_of_view(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let mesh = lopsided()?;
    let level = |distance: f64| {
        let instances = [instance(DISTANCE, distance, 30.0, 1), instance(1e-3, distance, 30.0, 2)];
        let solved = solved(tested, &mesh, &instances, 30)?;
        Ok(Level::new(distance, vec![Trial::at_most(0.0, 0.0).with(&solved.numbers)]))
    };
    [0.0, 0.01, 0.5, 1.0, 1e3, 1e6].map(level).into_iter().collect()
}
