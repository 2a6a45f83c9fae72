use rand::{Rng, SeedableRng, rngs::StdRng};
use softrast_mesh::Mesh;
use softrast_meta::normal;
use softrast_raster::Orbit;

/// Target and start of one run.
///
/// See [`PoseScene`](super::PoseScene) for an example.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseInstance {
    /// The camera of the target picture, in the frame of the mesh.
    pub target: Orbit,
    /// Start of the search, in the frame of the target camera: elevation and azimuth 0 are the
    /// answer.
    pub start: Orbit,
}

/// Field of view of every target camera.
const FOV_DEG: f64 = 40.0;

/// Angle between further starts and the given one. Poses that look alike are mostly front for back
/// or left for right, so smaller steps rarely leave them.
const AROUND_DEG: f64 = 50.0;

impl PoseInstance {
    /// An instance that depends on `seed` alone.
    ///
    /// Target: distance 2.5 to 4, elevation and azimuth normal with a deviation of 60 degrees,
    /// field of view 40. Start: distance 2 to 10, `least` to `largest` degrees away in a random
    /// direction of (elevation, azimuth), field of view 20 to 60. Uniform unless stated otherwise.
    ///
    /// Source: docs/notes.md, Pose. In the paper distances end at 8; its code goes to 10.
    pub fn seeded(seed: u64, [least, largest]: [f64; 2]) -> Self {
        let mut random = StdRng::seed_from_u64(seed);
        let mut target_angle = || 60.0 * normal(&mut random);
        let [elevation_deg, azimuth_deg] = [target_angle(), target_angle()];
        let distance = 2.5 + 1.5 * random.random::<f64>();
        let target = Orbit { distance, elevation_deg, azimuth_deg, fov_deg: FOV_DEG };

        let distance = 2.0 + 8.0 * random.random::<f64>();
        let direction = std::f64::consts::TAU * random.random::<f64>();
        let angle = least + (largest - least) * random.random::<f64>();
        let start = Orbit {
            distance,
            elevation_deg: angle * direction.sin(),
            azimuth_deg: angle * direction.cos(),
            fov_deg: 20.0 + 40.0 * random.random::<f64>(),
        };
        Self { target, start }
    }

    /// The instance with start `k` of `count`: start 0 is the given one, the others lie on a circle
    /// of 50 degrees around it in the plane of elevation and azimuth, evenly spaced; consecutive
    /// `k` are far apart.
    pub fn around(&self, k: usize, count: usize) -> Self {
        let mut instance = *self;
        if k > 0 {
            // Odd numbers on one half of the circle, even ones opposite.
            let turn = (k - 1) as f64 / (count - 1).max(1) as f64 + (k % 2) as f64;
            let direction = std::f64::consts::TAU * turn / 2.0;
            instance.start.elevation_deg += AROUND_DEG * direction.sin();
            instance.start.azimuth_deg += AROUND_DEG * direction.cos();
        }
        instance
    }
}

/// Finds the orbit camera of a mesh from its target silhouette.
///
/// θ is distance, elevation and azimuth of each instance, as in [`PoseScene`](super::PoseScene). The loss is the soft
/// `IoU` loss against the hard silhouette at the target.
#[derive(Clone, Debug)]
pub struct PoseProblem {
    /// The mesh, in world units.
    pub mesh: Mesh,
    /// Least and largest angle between a start and its target, in degrees.
    pub range_deg: [f64; 2],
    /// Whether the field of view is optimised too, from a random start, instead of known.
    pub optimise_fov: bool,
}

impl PoseProblem {
    /// The poses of a mesh around the origin, from starts 35 to 55 degrees away, with known field of view.
    pub fn new(mesh: &Mesh) -> Self {
        Self { mesh: mesh.clone(), range_deg: [35.0, 55.0], optimise_fov: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_lie_in_the_range_that_was_asked_for() {
        for [least, largest] in [[15.0, 35.0], [35.0, 55.0], [55.0, 75.0]] {
            for seed in 0..200 {
                let PoseInstance { target, start } = PoseInstance::seeded(seed, [least, largest]);
                let angle = start.elevation_deg.hypot(start.azimuth_deg);
                assert!((least..largest).contains(&angle), "seed {seed}: {angle}");
                assert!((2.5..4.0).contains(&target.distance) && target.fov_deg == 40.0);
                assert!((2.0..10.0).contains(&start.distance));
                assert!((20.0..60.0).contains(&start.fov_deg));
            }
        }
    }

    #[test]
    fn further_starts_surround_the_given_one() {
        let given = PoseInstance::seeded(3, [35.0, 55.0]);
        assert_eq!(given.around(0, 8), given);
        let mut mean = [0.0; 2];
        for k in 1..8 {
            let other = given.around(k, 8);
            let up = other.start.elevation_deg - given.start.elevation_deg;
            let side = other.start.azimuth_deg - given.start.azimuth_deg;
            assert!((up.hypot(side) - 50.0).abs() < 1e-9);
            assert_eq!(other.target, given.target);
            mean = [mean[0] + up / 7.0, mean[1] + side / 7.0];
        }
        assert!(mean[0].hypot(mean[1]) < 10.0, "{mean:?}");
    }
}
