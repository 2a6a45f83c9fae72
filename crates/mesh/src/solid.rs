//! The surface of a solid by marching tetrahedra, which is manifold.

use std::collections::HashMap;

use rayon::prelude::*;

use crate::{Mesh, MeshError, surface_net::Grid};

/// Least distance of a vertex from both corners of its edge, as a fraction of the edge, so that no two coincide.
const APART: f64 = 0.05;
/// Corners of the six tetrahedra of a cube, by the bits of x, y and z. All share its diagonal, so neighbouring cubes meet in whole faces.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

impl Mesh {
    /// The surface of a solid within a box (lowest and highest corner, world units), with this many cells along its longest side: closed,
    /// counterclockwise from outside, and manifold, so that it is a valid [`ClosedSurface`](crate::ClosedSurface).
    ///
    /// `field` is negative inside the solid, and increases approximately like a distance. Parts of the solid that reach the sides of the
    /// box are cut off half a cell before them.
    ///
    /// ```
    /// use softrast_mesh::Mesh;
    ///
    /// let ball = |[x, y, z]: [f64; 3]| (x * x + y * y + z * z).sqrt() - 0.8;
    /// let ball = Mesh::of_solid([[-1.0; 3], [1.0; 3]], 20, ball)?;
    /// let area = 4.0 * std::f64::consts::PI * 0.8 * 0.8;
    /// assert!((ball.area() / area - 1.0).abs() < 0.03);
    /// # Ok::<(), softrast_mesh::MeshError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// If the box contains no part of the solid, or has no extent.
    ///
    /// Source: Doi and Koide 1991.
    pub fn of_solid(
        [low, high]: [[f64; 3]; 2],
        cells: usize,
        field: impl Fn([f64; 3]) -> f64 + Sync,
    ) -> Result<Self, MeshError> {
        let sides = [0, 1, 2].map(|k| high[k] - low[k]);
        let step = sides.iter().copied().fold(0.0, f64::max) / cells.max(1) as f64;
        if !(step > 0.0 && step.is_finite()) {
            return Err(MeshError::Empty);
        }
        let cubes = sides.map(|side| (side / step).ceil() as usize);
        let beyond = |p: [f64; 3]| {
            (0..3).map(|k| (p[k] - high[k]).max(low[k] - p[k])).fold(f64::NEG_INFINITY, f64::max)
        };
        let within = |p: [f64; 3]| field(p).max(beyond(p) + 0.5 * step);
        let (positions, faces) = surface(&Grid { low, step, cubes }, within);
        Self::new(positions, faces)
    }
}

/// Vertices and triangles of the surface where `field` is zero.
fn surface(grid: &Grid, field: impl Fn([f64; 3]) -> f64 + Sync) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let corners: Vec<[usize; 3]> = grid.corners().collect();
    let samples: Vec<f64> = corners.par_iter().map(|&corner| field(grid.point(corner))).collect();
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    let mut vertices: HashMap<[usize; 2], u32> = HashMap::new();
    for cube in corners.into_iter().filter(|cube| (0..3).all(|k| cube[k] < grid.cubes[k])) {
        let corner = |bits: usize| [0, 1, 2].map(|k| cube[k] + (bits >> k & 1));
        let numbers: [usize; 8] = std::array::from_fn(|bits| grid.number(corner(bits)));
        let inside = numbers.map(|number| samples[number] < 0.0);
        if inside == [inside[0]; 8] {
            continue;
        }
        let mut crossing = |from: usize, to: usize| {
            let key = [numbers[from].min(numbers[to]), numbers[from].max(numbers[to])];
            *vertices.entry(key).or_insert_with(|| {
                let [a, b] = [from, to].map(|bits| samples[numbers[bits]]);
                let part = (a / (a - b)).clamp(APART, 1.0 - APART);
                let [p, q] = [from, to].map(|bits| grid.point(corner(bits)));
                positions.push([0, 1, 2].map(|k| p[k] + part * (q[k] - p[k])));
                (positions.len() - 1) as u32
            })
        };
        for tetrahedron in TETRAHEDRA {
            triangles(tetrahedron, &inside, &mut crossing, &mut faces);
        }
    }
    (positions, faces)
}

/// Adds the triangles between the inside and the outside of a tetrahedron with positive orientation: its first three corners are
/// counterclockwise from outside.
fn triangles(
    corners: [usize; 4],
    inside: &[bool; 8],
    crossing: &mut impl FnMut(usize, usize) -> u32,
    faces: &mut Vec<[u32; 3]>,
) {
    // An even permutation that puts the inside corners first keeps the orientation.
    let [a, b, c, d] = corners;
    let order = [
        [a, b, c, d],
        [a, c, d, b],
        [a, d, b, c],
        [b, a, d, c],
        [b, c, a, d],
        [b, d, c, a],
        [c, a, b, d],
        [c, b, d, a],
        [c, d, a, b],
        [d, a, c, b],
        [d, b, a, c],
        [d, c, b, a],
    ];
    let count = corners.iter().filter(|&&corner| inside[corner]).count();
    let first = |order: &&[usize; 4]| order[..count].iter().all(|&corner| inside[corner]);
    let Some(&[a, b, c, d]) = order.iter().find(first) else { return };
    match count {
        1 => faces.push([crossing(a, b), crossing(a, c), crossing(a, d)]),
        2 => {
            let [ac, ad, bc, bd] = [crossing(a, c), crossing(a, d), crossing(b, c), crossing(b, d)];
            faces.push([ac, ad, bd]);
            faces.push([ac, bd, bc]);
        }
        3 => faces.push([crossing(a, d), crossing(b, d), crossing(c, d)]),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ClosedSurface, vectors::norm};

    #[test]
    fn a_solid_is_a_mesh_and_nothing_is_none() {
        let bounds = [[-1.5, -1.5, -1.2], [1.5, 1.5, 1.2]];
        let ball = Mesh::of_solid(bounds, 20, |p| norm(p) - 1.0).unwrap();
        assert!((ball.area() / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.02);
        assert!(matches!(Mesh::of_solid(bounds, 20, |_| 1.0), Err(MeshError::Empty)));
        // A ball clipped by the box on all sides is closed there.
        let cut = Mesh::of_solid([[-1.0; 3], [1.0; 3]], 20, |p| norm(p) - 1.2).unwrap();
        ClosedSurface::new(&cut, 0.1, 0).unwrap();
        let [low, high] = cut.bounds();
        assert!((0..3).all(|k| (high[k] - 0.95).abs() < 1e-3 && (low[k] + 0.95).abs() < 1e-3));
        assert!(matches!(Mesh::of_solid([[0.0; 3]; 2], 20, |_| -1.0), Err(MeshError::Empty)));
    }

    #[test]
    fn the_surface_looks_outwards_and_branches_nowhere() {
        // Independent values at corners, on a grid so coarse that all cases occur.
        for seed in 0..20 {
            let noise = |p: [f64; 3]| {
                let at = p.map(|x| (x * 8.0).round() + f64::from(seed));
                ((12.9898 * at[0] + 78.233 * at[1] + 37.719 * at[2]).sin() * 43758.5453).fract()
            };
            let mesh = Mesh::of_solid([[0.0; 3], [1.0; 3]], 8, noise).unwrap();
            ClosedSurface::new(&mesh, 0.1, 0).unwrap();
        }
        let ball = Mesh::of_solid([[-1.2; 3], [1.2; 3]], 9, |p| norm(p) - 1.0).unwrap();
        for [a, b, c] in ball.triangles() {
            let outwards = crate::vectors::dot(crate::vectors::cross(a, b), c);
            assert!(outwards > 0.0, "{outwards}");
        }
    }
}
