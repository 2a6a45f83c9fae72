use rand::{Rng, SeedableRng, rngs::StdRng};
use softrast_mesh::{Mesh, vectors};

/// Elevations of the cameras in degrees, in the order of the seeds; `solve` uses the first.
pub(crate) const ELEVATIONS_DEG: [f64; 5] = [30.0, 60.0, 0.0, -30.0, -60.0];

/// Cameras and start of one run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Elevation of all cameras.
    pub elevation_deg: f64,
    /// Seed of the rotation of the template; 0 does not rotate it.
    pub turn: u64,
}

impl Instance {
    /// The instance of `seed`, at `elevation_deg` if given.
    ///
    /// Otherwise seeds 0 to 4 are elevations 30, 60, 0, -30 and -60, seeds 5 to 9 the same with the
    /// template rotated at random, and so on: the only randomness of the paper's task is the order
    /// of sums, which further seeds vary by the rotation. Not in the paper: the rotation.
    pub fn seeded(seed: u64, elevation_deg: Option<f64>) -> Self {
        let count = ELEVATIONS_DEG.len() as u64;
        match elevation_deg {
            Some(elevation_deg) => Self { elevation_deg, turn: seed },
            None => {
                Self { elevation_deg: ELEVATIONS_DEG[(seed % count) as usize], turn: seed / count }
            }
        }
    }

    /// The start vertices of `template` in this instance: scaled to a box whose longest side is 1,
    /// around the origin, then rotated.
    pub(crate) fn start(&self, template: &Mesh) -> Vec<[f64; 3]> {
        let rotation = rotation(self.turn);
        let placed =
            |p: &[f64; 3]| rotation.map(|row| 0.5 * (0..3).map(|k| row[k] * p[k]).sum::<f64>());
        template.normalized().positions().iter().map(placed).collect()
    }
}

/// A uniformly random rotation, by a unit quaternion; the identity for 0.
fn rotation(turn: u64) -> [[f64; 3]; 3] {
    if turn == 0 {
        return [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    }
    let mut random = StdRng::seed_from_u64(turn);
    // The direction of a point in the 4-dimensional ball is uniform.
    let (q, square) = loop {
        let q = [(); 4].map(|()| random.random_range(-1.0..1.0));
        let square = q.iter().map(|x: &f64| x * x).sum::<f64>();
        if (0.01..1.0).contains(&square) {
            break (q, square);
        }
    };
    vectors::rotation(q.map(|part| part / square.sqrt()))
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;

    #[test]
    fn five_seeds_cover_the_elevations_and_the_next_five_turn_the_template() {
        let instances: Vec<_> = (0..10).map(|seed| Instance::seeded(seed, None)).collect();
        let elevations: Vec<f64> = instances.iter().map(|i| i.elevation_deg).collect();
        assert_eq!(elevations[..5], ELEVATIONS_DEG);
        assert_eq!(elevations[5..], ELEVATIONS_DEG);
        assert!(instances.iter().enumerate().all(|(k, i)| i.turn == k as u64 / 5));
        let one = Instance { elevation_deg: 12.0, turn: 7 };
        assert_eq!(Instance::seeded(7, Some(12.0)), one);
    }

    #[test]
    fn a_turned_sphere_is_a_sphere() {
        let sphere = icosphere(1);
        let starts = [0, 1, 2].map(|turn| Instance { elevation_deg: 0.0, turn }.start(&sphere));
        for p in starts.iter().flatten() {
            let square: f64 = p.iter().map(|x| x * x).sum();
            assert!((square - 0.25).abs() < 1e-12);
        }
        assert_ne!(starts[1], starts[2]);
        for (p, unit) in starts[0].iter().zip(sphere.positions()) {
            assert!((0..3).all(|k| (p[k] - 0.5 * unit[k]).abs() < 1e-12));
        }
    }
}
