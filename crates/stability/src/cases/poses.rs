//! Failure modes of POSE: too far, too near, too sharp, too small, too fast.

use pose::{Args, Pose, PoseError, Range};
use softrast_cli::{EdgeChoice, Task, Variant};
use softrast_inverse::SolveConfig;
use softrast_inverse::pose::PoseInstance;
use softrast_mesh::{Mesh, icosphere};
use softrast_raster::Orbit;

use super::common::{ORIGINAL, PARAMETER, levels, trials, with_limit};
use crate::{Case, Config, Descended, Level, Tested, Trial, descend};

pub(super) const CASES: &[Case] = &[
    Case {
        id: "O01",
        name: "decay past the optimum",
        scene: "POSE, a lopsided body, 24 x 24, 80 steps of 1, 4 seeds from 15 to 35 degrees",
        perturbation: "softness at the last step from 1e-1 to 1e-7 NDC, from ten times as wide at the \
                       first where it decays",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: past_the_optimum,
    },
    Case {
        id: "O03",
        name: "POSE by angle of the start",
        scene: "POSE, a lopsided body, 24 x 24, 100 steps of 1.2, 8 directions at the right distance",
        perturbation: "angle between start and target, 5 to 90 degrees",
        measure: "degrees that the pose is off at the best step",
        target: "at most 5",
        run: angles,
    },
    Case {
        id: "O04",
        name: "POSE by distance of the start",
        scene: "POSE, a lopsided body, 24 x 24, 100 steps of 1.2, 8 directions at 20 degrees",
        perturbation: "distance of the start over that of the target, 0.5 to 4",
        measure: "degrees that the pose is off at the best step",
        target: "at most 5",
        run: distances,
    },
    Case {
        id: "O07",
        name: "POSE by image size",
        scene: "POSE, a lopsided body, 80 steps of 1, 4 seeds from 15 to 35 degrees, softness 0.02 NDC",
        perturbation: "image of 8 to 128 pixels a side",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: sizes,
    },
    Case {
        id: "O16",
        name: "POSE by learning rate",
        scene: "POSE, a lopsided body, 24 x 24, 80 steps of 1, 4 seeds from 15 to 35 degrees",
        perturbation: "learning rate, about the degrees of a step, from 1e-3 to 10",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: rates,
    },
    Case {
        id: "O17",
        name: "POSE by range of the starts",
        scene: "POSE, a lopsided body, 24 x 24, 80 steps of 1, one start, 8 seeds",
        perturbation: "starts 15-35, 35-55 and 55-75 degrees away",
        measure: "degrees that the returned pose is off",
        target: "at most 5",
        run: ranges,
    },
    Case {
        id: "O22",
        name: "POSE, softness from 1e-12 to 1e3",
        scene: "POSE, a lopsided body, 24 x 24, 60 steps of 1, 2 seeds from 15 to 35 degrees",
        perturbation: "softness from 1e-12 to 1e3 NDC",
        measure: "degrees that the returned pose is off",
        target: "at most 10",
        run: softness,
    },
];

/// The lopsided body as a file, for as long as `work` takes.
fn with_body<R>(mesh: &Mesh, work: impl FnOnce(Args) -> anyhow::Result<R>) -> anyhow::Result<R> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("body.obj");
    mesh.save(&path)?;
    work(Args { mesh: Some(path), raw: true, ..Args::default() })
}

/// Final errors of seeds of the lopsided body, in degrees; a success is 5.
fn degrees(tested: &Tested, range: Range, config: Config) -> anyhow::Result<Vec<Trial>> {
    with_body(&lopsided()?, |args| {
        trials::<Pose>(tested, Args { range: Some(range), ..args }, &config, PARAMETER)
    })
}

const SOLVED: Config =
    Config { size: 24, steps: Some(80), learning_rate: Some(1.0), runs: 4, ..ORIGINAL };

fn past_the_optimum(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7], |scale: f64| {
        let config = Config { scale: Some(scale), ..SOLVED };
        Ok(Level::new(scale, degrees(tested, Range::Near, config)?))
    })
}

fn sizes(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([8, 16, 32, 64, 128], |size: usize| {
        let config = Config { size, scale: Some(0.02), ..SOLVED };
        Ok(Level::new(size as f64, degrees(tested, Range::Near, config)?))
    })
}

fn rates(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1e-3, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0], |rate: f64| {
        let config = Config { learning_rate: Some(rate), ..SOLVED };
        Ok(Level::new(rate, degrees(tested, Range::Near, config)?))
    })
}

fn ranges(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([Range::Near, Range::Middle, Range::Far], |range: Range| {
        let trials = degrees(tested, range, Config { runs: 8, ..SOLVED })?;
        Ok(Level::named(range.name(), trials))
    })
}

fn softness(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    levels([1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e3], |scale: f64| {
        let config = Config { scale: Some(scale), steps: Some(60), runs: 2, ..SOLVED };
        Ok(Level::new(scale, with_limit(degrees(tested, Range::Near, config)?, 10.0)))
    })
}

/// A ball with a nose, a fin and an ear, so that no two poses look alike.
///
/// # Errors
///
/// None, as long as it is a mesh.
pub fn lopsided() -> anyhow::Result<Mesh> {
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

/// A camera at a distance, and a start some degrees off in one of eight directions.
pub fn instance(target: f64, distance: f64, angle_deg: f64, direction: usize) -> PoseInstance {
    let direction = std::f64::consts::TAU * (direction as f64 + 0.3) / 8.0;
    let camera = Orbit { distance: target, elevation_deg: 20.0, azimuth_deg: 35.0, fov_deg: 40.0 };
    let start = Orbit {
        distance,
        elevation_deg: angle_deg * direction.sin(),
        azimuth_deg: angle_deg * direction.cos(),
        fov_deg: 40.0,
    };
    PoseInstance { target: camera, start }
}

/// Solves instances of a mesh side by side.
///
/// # Errors
///
/// If the mesh cannot be written.
pub fn solved(
    tested: &Tested,
    mesh: &Mesh,
    instances: &[PoseInstance],
    steps: usize,
) -> anyhow::Result<Descended> {
    let config = SolveConfig { size: SIDE, steps, learning_rate: 1.2 };
    with_body(mesh, |args| {
        let pose = Pose::new(&args, Variant::Original, &EdgeChoice::default())?;
        descend(&pose, instances, tested.at(0.005), config)
    })
}

fn angle_trials(
    tested: &Tested,
    mesh: &Mesh,
    start: impl Fn(usize) -> PoseInstance,
) -> anyhow::Result<Vec<Trial>> {
    let instances: Vec<PoseInstance> = (0..8).map(start).collect();
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
    levels([5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0], |angle: f64| {
        let start = |direction| instance(DISTANCE, DISTANCE, angle, direction);
        Ok(Level::new(angle, angle_trials(tested, &mesh, start)?))
    })
}

fn distances(tested: &Tested) -> anyhow::Result<Vec<Level>> {
    let mesh = lopsided()?;
    levels([0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0], |factor: f64| {
        let start = |direction| instance(DISTANCE, factor * DISTANCE, 20.0, direction);
        Ok(Level::new(factor, angle_trials(tested, &mesh, start)?))
    })
}
