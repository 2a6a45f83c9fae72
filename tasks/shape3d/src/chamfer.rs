use rand::{Rng, SeedableRng, rngs::StdRng};
use softrast_kernel::Nearest;
use softrast_mesh::vectors::{norm, normal};

/// Points per surface.
const POINTS: usize = 10_000;
/// Seeds of the points on the target and on the other surface: the same in every run, so that
/// numbers compare, and different from each other, so that no two surfaces share their points.
const SEEDS: [u64; 2] = [1, 2];
/// Factor of the reported distance: squared distances are small.
const FACTOR: f64 = 1e3;

/// Chamfer distance of surfaces to one target.
///
/// 10,000 points are spread over each surface, evenly by area, one in each of 10,000 parts of equal
/// area. The distance is the mean over the points of one surface of the squared distance to the
/// nearest point of the other, averaged over both directions, times 1000; in squared world units. A
/// surface of area `a` has a distance of about `1000 a / (π · 10000)` to itself, because its two
/// sets of points differ: 0.016 for an area of 0.5.
///
/// The paper names the Chamfer distance without defining it; this definition is ours.
pub struct Chamfer {
    target: Nearest,
}

impl Chamfer {
    /// Prepares the target with these vertices and faces.
    ///
    /// # Panics
    ///
    /// If there is no face, or a face uses a missing vertex.
    pub fn new(positions: &[[f64; 3]], faces: &[[u32; 3]]) -> Self {
        Self { target: Nearest::new(spread(positions, faces, SEEDS[0])) }
    }

    /// The distance of the surface with these vertices and faces.
    ///
    /// # Panics
    ///
    /// As [`Chamfer::new`].
    pub fn distance(&self, positions: &[[f64; 3]], faces: &[[u32; 3]]) -> f64 {
        let surface = Nearest::new(spread(positions, faces, SEEDS[1]));
        let there = surface.mean_squared_distance(&self.target);
        0.5 * FACTOR * (there + self.target.mean_squared_distance(&surface))
    }
}

/// Points on a surface, evenly by area.
fn spread(positions: &[[f64; 3]], faces: &[[u32; 3]], seed: u64) -> Vec<[f64; 3]> {
    let corners = |face: usize| faces[face].map(|v| positions[v as usize]);
    let areas: Vec<f64> = (0..faces.len()).map(|face| 0.5 * norm(normal(corners(face)))).collect();
    let total: f64 = areas.iter().sum();
    let mut random = StdRng::seed_from_u64(seed);
    let (mut face, mut passed) = (0, areas[0]);
    (0..POINTS)
        .map(|k| {
            let at = (k as f64 + random.random::<f64>()) / POINTS as f64 * total;
            while passed < at && face + 1 < faces.len() {
                face += 1;
                passed += areas[face];
            }
            let root = random.random::<f64>().sqrt();
            let along = random.random::<f64>();
            let weights = [1.0 - root, root * (1.0 - along), root * along];
            let corners = corners(face);
            [0, 1, 2].map(|axis| (0..3).map(|k| weights[k] * corners[k][axis]).sum())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;

    const SQUARE: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

    fn square(size: f64, height: f64) -> [[f64; 3]; 4] {
        [[0.0, 0.0], [size, 0.0], [size, size], [0.0, size]].map(|[x, y]| [x, y, height])
    }

    #[test]
    fn parallel_squares_are_as_far_as_the_square_of_their_distance() {
        let chamfer = Chamfer::new(&square(1.0, 0.0), &SQUARE);
        let found = chamfer.distance(&square(1.0, 0.5), &SQUARE);
        // Points are not exactly opposite each other, which adds a little.
        assert!((250.0..250.1).contains(&found), "{found}");
    }

    #[test]
    fn a_surface_is_as_far_from_itself_as_its_points_from_one_another() {
        let sphere = icosphere(2);
        let chamfer = Chamfer::new(sphere.positions(), sphere.faces());
        let found = chamfer.distance(sphere.positions(), sphere.faces());
        let expected = FACTOR * sphere.area() / (std::f64::consts::PI * POINTS as f64);
        assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
    }

    #[test]
    fn either_direction_counts() {
        // From the small square to the large one it is near, but not in reverse.
        let chamfer = Chamfer::new(&square(1.0, 0.0), &SQUARE);
        let found = chamfer.distance(&square(0.5, 0.0), &SQUARE);
        // Beyond one edge: 1/4 of the area, mean square 1/12; beyond the corner: the same twice.
        let expected = 0.5 * FACTOR * (0.25 + 0.25 + 0.25 * 2.0) / 12.0;
        assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    }

    #[test]
    fn surfaces_without_area_are_finite() {
        let chamfer = Chamfer::new(&[[1.0; 3]], &[[0, 0, 0]]);
        assert!((chamfer.distance(&[[1.0; 3]], &[[0, 0, 0]])).abs() < 1e-9);
    }
}
