use anyhow::Context;
use rand::{Rng, SeedableRng, rngs::StdRng};
use serde::Deserialize;

use crate::Range;

/// A camera that orbits the origin and looks at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Distance from the origin, in world units.
    pub distance: f64,
    /// Angle above the ground.
    pub elevation_deg: f64,
    /// Angle around the vertical axis, from -z towards +x.
    pub azimuth_deg: f64,
    /// Half of the field of view.
    pub half_fov_deg: f64,
}

impl Camera {
    /// Distance, elevation, azimuth and half field of view.
    pub fn orbit(&self) -> [f64; 4] {
        [self.distance, self.elevation_deg, self.azimuth_deg, self.half_fov_deg]
    }
}

impl From<[f64; 4]> for Camera {
    fn from([distance, elevation_deg, azimuth_deg, half_fov_deg]: [f64; 4]) -> Self {
        Self { distance, elevation_deg, azimuth_deg, half_fov_deg }
    }
}

/// What one run is asked: from where to where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The camera of the target picture, in the frame of the mesh.
    pub target: Camera,
    /// Where the search starts, in the frame of the target camera: elevation and azimuth 0 are
    /// right.
    pub start: Camera,
}

/// Half the field of view of every target camera.
const HALF_FOV_DEG: f64 = 20.0;

/// How far further starts lie from the given one. Poses that look alike are mostly front for back
/// or left for right, so steps much smaller than a right angle lead out of them.
const AROUND_DEG: f64 = 50.0;

impl Instance {
    /// An instance that depends on `seed` alone.
    ///
    /// Target: distance 2.5 to 4, elevation and azimuth normal with a deviation of 60 degrees, half
    /// field of view 20. Start: distance 2 to 10, at an angle within `range` in a random direction of
    /// (elevation, azimuth), half field of view 10 to 30. Uniform unless said.
    ///
    /// Source: docs/notes.md, Pose. In the paper distances end at 8; its code goes to 10.
    pub fn seeded(seed: u64, range: Range) -> Self {
        let mut random = StdRng::seed_from_u64(seed);
        let mut target_angle = || 60.0 * normal(&mut random);
        let [elevation_deg, azimuth_deg] = [target_angle(), target_angle()];
        let distance = 2.5 + 1.5 * random.random::<f64>();
        let target = Camera { distance, elevation_deg, azimuth_deg, half_fov_deg: HALF_FOV_DEG };

        let [least, largest] = range.degrees();
        let distance = 2.0 + 8.0 * random.random::<f64>();
        let direction = std::f64::consts::TAU * random.random::<f64>();
        let angle = least + (largest - least) * random.random::<f64>();
        let start = Camera {
            distance,
            elevation_deg: angle * direction.sin(),
            azimuth_deg: angle * direction.cos(),
            half_fov_deg: 10.0 + 20.0 * random.random::<f64>(),
        };
        Self { target, start }
    }

    /// The same target from start `k` of `count`: 0 is its own, the others lie on a circle of 50
    /// degrees around it in the plane of elevation and azimuth, evenly spaced; neighbours in `k` are
    /// far apart.
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

    /// The 24 pairs of the released runs.
    ///
    /// # Errors
    ///
    /// If the file that is part of the program is broken.
    pub fn released() -> anyhow::Result<Vec<Self>> {
        #[derive(Deserialize)]
        struct Released {
            targets: Vec<[f64; 4]>,
            starts: Vec<[f64; 4]>,
        }
        let text = include_str!("../instances/released24.json");
        let file: Released = serde_json::from_str(text).context("released24.json is broken")?;
        let pairs = file.targets.into_iter().zip(file.starts);
        Ok(pairs
            .map(|(target, start)| Self { target: target.into(), start: start.into() })
            .collect())
    }
}

/// A standard normal number, by the method of Box and Muller.
fn normal(random: &mut StdRng) -> f64 {
    let [u, v] = [(); 2].map(|()| random.random::<f64>());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_lie_in_the_range_that_was_asked_for() {
        for range in [Range::Near, Range::Middle, Range::Far] {
            let [least, largest] = range.degrees();
            for seed in 0..200 {
                let Instance { target, start } = Instance::seeded(seed, range);
                let angle = start.elevation_deg.hypot(start.azimuth_deg);
                assert!((least..largest).contains(&angle), "seed {seed}: {angle}");
                assert!((2.5..4.0).contains(&target.distance) && target.half_fov_deg == 20.0);
                assert!((2.0..10.0).contains(&start.distance));
                assert!((10.0..30.0).contains(&start.half_fov_deg));
            }
        }
    }

    #[test]
    fn further_starts_surround_the_given_one() {
        let given = Instance::seeded(3, Range::Middle);
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

    #[test]
    fn there_are_24_released_pairs_with_one_field_of_view() {
        let released = Instance::released().unwrap();
        assert_eq!(released.len(), 24);
        assert!(released.iter().all(|instance| instance.target.half_fov_deg == 20.0));
        assert_eq!(released[0].start.distance, 8.061052322387695);
    }
}
