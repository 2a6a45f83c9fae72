//! Moving and scaling a mesh into the box from -1 to 1.

use crate::Mesh;

impl Mesh {
    /// The mesh centred at the origin and scaled so that the longest side of its box is 2.
    ///
    /// The box is that of [`Mesh::bounds`]: an unused vertex is ignored, and is clamped to the box from -1 to 1 so that it stays finite at
    /// any scale. A mesh without extent is only moved to the origin.
    ///
    /// ```
    /// use softrast_mesh::{airplane, chair, painted_fox};
    ///
    /// for mesh in [airplane(), chair(), painted_fox()] {
    ///     let [low, high] = mesh.normalized().bounds();
    ///     let sides = [0, 1, 2].map(|k| high[k] - low[k]);
    ///     assert_eq!(sides.into_iter().fold(0.0, f64::max), 2.0);
    /// }
    /// ```
    ///
    /// Source: the normalisation of `GenDR`'s loader, with its box centre and one scale for all axes.
    #[must_use]
    pub fn normalized(&self) -> Mesh {
        let [low, high] = self.bounds();
        let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let divisor = if longest > 0.0 { longest } else { 1.0 };
        // Twice (x - centre) as a difference of distances to both sides: the centre is not rounded, so the ends of the longest side are
        // exactly -1 and 1, however far from the origin.
        let scaled = |x: f64, k: usize| ((x - low[k]) - (high[k] - x)) / divisor;
        let place = |p: &[f64; 3]| [0, 1, 2].map(|k| scaled(p[k], k).clamp(-1.0, 1.0));
        let positions = self.positions().iter().map(place).collect();
        self.moved(positions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(positions: [[f64; 3]; 3]) -> Mesh {
        Mesh::new(positions.to_vec(), vec![[0, 1, 2]]).unwrap()
    }

    #[test]
    fn longest_side_becomes_two_at_any_scale_and_offset() {
        let unit = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 1.0]];
        let expected = [[-1.0, -0.5, -0.25], [1.0, -0.5, -0.25], [-1.0, 0.5, 0.25]];
        for (scale, offset) in
            [(1.0, 0.0), (1.0, 1e7), (2f64.powi(90), 0.0), (2f64.powi(-140), 0.0)]
        {
            let mesh = triangle(unit.map(|p| p.map(|x| x * scale + offset)));
            assert_eq!(mesh.normalized(), triangle(expected), "scale {scale}, offset {offset}");
        }
    }

    #[test]
    fn full_range_of_f32_does_not_overflow() {
        let big = f64::from(f32::MAX);
        let mesh = triangle([[-big, -big, 0.0], [big, -big, 0.0], [big, big, 0.0]]);
        let expected = triangle([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]);
        assert_eq!(mesh.normalized(), expected);
    }

    #[test]
    fn mesh_without_extent_moves_to_the_origin() {
        assert_eq!(triangle([[7.0, -3.0, 1e30]; 3]).normalized(), triangle([[0.0; 3]; 3]));
    }

    #[test]
    fn unused_vertices_do_not_shrink_the_mesh_and_stay_finite() {
        let positions = vec![[0.0; 3], [1e-42, 0.0, 0.0], [0.0, 1e-42, 0.0], [3e38, -3e38, 0.0]];
        let mesh = Mesh::new(positions, vec![[0, 1, 2]]).unwrap().normalized();
        let expected = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, -1.0, 0.0]];
        assert_eq!(mesh.positions(), expected);
    }
}
