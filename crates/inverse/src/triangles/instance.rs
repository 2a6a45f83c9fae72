use std::f64::consts::TAU;

use rand::{Rng, SeedableRng, rngs::StdRng};
use softrast_raster::ImageSize;

/// Start of the triangles of one run.
///
/// See [`Scene`](super::Scene) for an example.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Corners in NDC, three to a triangle.
    pub corners: Vec<[f64; 2]>,
}

/// Total area of the triangles relative to that of the image.
const COVER: f64 = 0.5;

impl Instance {
    /// An instance that depends only on `seed`, the number of triangles and the proportions of the image.
    ///
    /// Equilateral triangles of one size are spread evenly over the image, each with a random
    /// rotation. Their areas add up to half the image. Their centres are Halton points with bases 2
    /// and 3, shifted by a random offset that wraps around.
    ///
    /// Unlike the released code (docs/notes.md, 2D shape), whose centres fill a wider box and whose
    /// triangles are unequal and all of one shape.
    pub fn seeded(seed: u64, triangles: usize, size: impl Into<ImageSize>) -> Self {
        let size = size.into();
        let half = [size.width, size.height].map(|side| side as f64 / size.shorter() as f64);
        let mut random = StdRng::seed_from_u64(seed);
        let offset = [(); 2].map(|()| random.random::<f64>());
        let radius =
            (COVER * 4.0 * half[0] * half[1] / triangles as f64 / (0.75 * 3f64.sqrt())).sqrt();
        let corners = (0..triangles).flat_map(|k| {
            let centre = [0, 1].map(|axis| {
                let base = [2, 3][axis];
                half[axis] * (2.0 * (radical_inverse(k + 1, base) + offset[axis]).fract() - 1.0)
            });
            let turn = TAU * random.random::<f64>();
            [0.0, 1.0, 2.0].map(|corner| {
                let (sin, cos) = (turn + TAU * corner / 3.0).sin_cos();
                [centre[0] + radius * cos, centre[1] + radius * sin]
            })
        });
        Self { corners: corners.collect() }
    }
}

/// The digits of `k` in this base, mirrored at the point. Source: Halton 1960.
fn radical_inverse(mut k: usize, base: usize) -> f64 {
    let (mut result, mut digit) = (0.0, 1.0);
    while k > 0 {
        digit /= base as f64;
        result += digit * (k % base) as f64;
        k /= base;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_spread_evenly_and_cover_half_the_area_of_the_image() {
        let corners = Instance::seeded(3, 800, 8).corners;
        let area = |t: &[[f64; 2]]| {
            let [u, v] = [1, 2].map(|k| [t[k][0] - t[0][0], t[k][1] - t[0][1]]);
            0.5 * (u[0] * v[1] - u[1] * v[0]).abs()
        };
        let total: f64 = corners.chunks(3).map(area).sum();
        assert!((total - 2.0).abs() < 1e-9, "{total}");
        for quarter in 0..4 {
            let inside = |p: &[[f64; 2]]| {
                let sum = [0, 1].map(|k| p[0][k] + p[1][k] + p[2][k] > 0.0);
                usize::from(sum[0]) + 2 * usize::from(sum[1]) == quarter
            };
            let count = corners.chunks(3).filter(|t| inside(t)).count();
            assert!((190..=210).contains(&count), "{count}");
        }
    }

    #[test]
    fn a_seed_gives_the_same_triangles_and_another_seed_others() {
        assert_eq!(Instance::seeded(1, 9, 8), Instance::seeded(1, 9, 8));
        assert_ne!(Instance::seeded(1, 9, 8), Instance::seeded(2, 9, 8));
    }

    #[test]
    fn triangles_fill_a_wide_image() {
        let corners = Instance::seeded(3, 800, [10, 20]).corners;
        let beyond = |limit: f64| corners.iter().filter(|corner| corner[0].abs() > limit).count();
        assert!((1100..1300).contains(&beyond(1.0)) && beyond(2.1) == 0, "{}", beyond(1.0));
    }
}
