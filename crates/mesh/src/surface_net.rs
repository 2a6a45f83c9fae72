//! Converts a solid, given as a function that is negative inside, to a seamless surface.

use crate::vectors::norm;

/// Least slope of a field assumed in a Newton step: in flatter fields, as where strokes meet, steps are shorter.
const FLATTEST: f64 = 0.5;

/// A box of cubes in which a solid is sampled.
pub(crate) struct Grid {
    /// Lowest corner of the box.
    pub(crate) low: [f64; 3],
    /// Edge of a cube.
    pub(crate) step: f64,
    /// Number of cubes along x, y and z.
    pub(crate) cubes: [usize; 3],
}

/// Vertices and triangles of the surface where `field` is zero, counterclockwise from outside.
///
/// `field` should increase like a distance, and be positive on the sides of the grid. Each cube that the surface crosses has one vertex,
/// each grid edge that it crosses one quadrilateral between the four cubes around it; the vertices are then smoothed on the surface.
///
/// Source: Gibson 1998, Constrained Elastic Surface Nets.
pub(crate) fn surface_net(
    grid: &Grid,
    field: impl Fn([f64; 3]) -> f64,
) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let samples: Vec<f64> = grid.corners().map(|corner| field(grid.point(corner))).collect();
    let sample = |corner: [usize; 3]| samples[grid.number(corner)];
    let mut positions = Vec::new();
    let mut vertex_of_cube = vec![u32::MAX; samples.len()];
    let mut quads = Vec::new();
    for corner in grid.corners() {
        // The cube that starts here: its vertex is the mean of all crossings on its edges.
        if (0..3).all(|k| corner[k] < grid.cubes[k]) {
            let crossings = grid.crossings(corner, sample);
            if !crossings.is_empty() {
                vertex_of_cube[grid.number(corner)] = positions.len() as u32;
                positions.push(mean(&crossings));
            }
        }
        // The edges that start here: all four cubes around them end here or before.
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            if corner[axis] == grid.cubes[axis] || corner[u] == 0 || corner[v] == 0 {
                continue;
            }
            let cube = |(du, dv)| grid.number(moved(moved(corner, u, du), v, dv));
            let around = [(-1, -1), (0, -1), (0, 0), (-1, 0)].map(cube);
            match (sample(corner) < 0.0, sample(moved(corner, axis, 1)) < 0.0) {
                (true, false) => quads.push(around),
                (false, true) => quads.push([around[3], around[2], around[1], around[0]]),
                _ => {}
            }
        }
    }
    let vertices = quads.iter().map(|quad| quad.map(|cube| vertex_of_cube[cube]));
    let quads: Vec<[u32; 4]> = vertices.collect();
    even_out(&mut positions, &quads, grid.step, field);
    let faces = quads.iter().flat_map(|&quad| halves(&positions, quad)).collect();
    (positions, faces)
}

impl Grid {
    /// The corners of all cubes.
    pub(crate) fn corners(&self) -> impl Iterator<Item = [usize; 3]> {
        let [nx, ny, nz] = self.cubes;
        (0..=nz).flat_map(move |z| (0..=ny).flat_map(move |y| (0..=nx).map(move |x| [x, y, z])))
    }

    /// The index of a corner among all.
    pub(crate) fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        x + (self.cubes[0] + 1) * (y + (self.cubes[1] + 1) * z)
    }

    /// Position of a corner.
    pub(crate) fn point(&self, corner: [usize; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| self.low[k] + self.step * corner[k] as f64)
    }

    /// Crossings of the surface with the twelve edges of a cube, by linear interpolation.
    fn crossings(&self, cube: [usize; 3], sample: impl Fn([usize; 3]) -> f64) -> Vec<[f64; 3]> {
        let corners = (0..8).map(|bits| [0, 1, 2].map(|k| cube[k] + (bits >> k & 1)));
        let edges = corners.flat_map(|from| [0, 1, 2].map(|axis| (from, axis)));
        let inside_cube = edges.filter(|(from, axis)| from[*axis] == cube[*axis]);
        let crossing = |(from, axis): ([usize; 3], usize)| {
            let (a, b) = (sample(from), sample(moved(from, axis, 1)));
            let mut point = self.point(from);
            point[axis] += self.step * a / (a - b);
            ((a < 0.0) != (b < 0.0)).then_some(point)
        };
        inside_cube.filter_map(crossing).collect()
    }
}

/// Moves each vertex towards the mean of its neighbours, then back onto the surface.
fn even_out(
    positions: &mut [[f64; 3]],
    quads: &[[u32; 4]],
    step: f64,
    field: impl Fn([f64; 3]) -> f64,
) {
    const ROUNDS: usize = 6;
    const STRENGTH: f64 = 0.5;
    for _ in 0..ROUNDS {
        let mut sums = vec![([0.0; 3], 0.0); positions.len()];
        for quad in quads {
            for k in 0..4 {
                let neighbour = positions[quad[(k + 1) % 4] as usize];
                let (sum, count) = &mut sums[quad[k] as usize];
                *sum = [0, 1, 2].map(|k| sum[k] + neighbour[k]);
                *count += 1.0;
            }
        }
        for (position, (sum, count)) in positions.iter_mut().zip(sums) {
            let even = [0, 1, 2].map(|k| position[k] + STRENGTH * (sum[k] / count - position[k]));
            *position = onto_surface(even, step, &field);
        }
    }
}

/// The result of a few Newton steps from `point` along the gradient of `field`.
fn onto_surface(mut point: [f64; 3], step: f64, field: impl Fn([f64; 3]) -> f64) -> [f64; 3] {
    let h = 1e-4 * step;
    for _ in 0..3 {
        let shifted =
            |k: usize, by: f64| [0, 1, 2].map(|j| point[j] + if j == k { by } else { 0.0 });
        let gradient =
            [0, 1, 2].map(|k| (field(shifted(k, h)) - field(shifted(k, -h))) / (2.0 * h));
        let slope = norm(gradient).max(FLATTEST);
        let along = field(point) / (slope * slope);
        point = [0, 1, 2].map(|k| point[k] - along * gradient[k]);
    }
    point
}

/// Two triangles that cut a quadrilateral along its shorter diagonal.
fn halves(positions: &[[f64; 3]], [a, b, c, d]: [u32; 4]) -> [[u32; 3]; 2] {
    let length = |i: u32, j: u32| {
        norm(crate::vectors::difference(positions[i as usize], positions[j as usize]))
    };
    if length(a, c) <= length(b, d) { [[a, b, c], [a, c, d]] } else { [[b, c, d], [b, d, a]] }
}

fn mean(points: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64)
}

/// The corner `by` steps further along `axis`.
fn moved(mut corner: [usize; 3], axis: usize, by: isize) -> [usize; 3] {
    corner[axis] = corner[axis].wrapping_add_signed(by);
    corner
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vectors::{cross, dot};

    #[test]
    fn net_of_a_ball_is_a_sphere_that_looks_outward() {
        let grid = Grid { low: [-1.25; 3], step: 0.125, cubes: [20; 3] };
        let (positions, faces) = surface_net(&grid, |p| norm(p) - 1.0);
        assert!(positions.iter().all(|&p| (norm(p) - 1.0).abs() < 1e-9));
        assert_eq!(faces.len(), 2 * positions.len() - 4);
        for face in faces {
            let [a, b, c] = face.map(|v| positions[v as usize]);
            assert!(dot(cross(a, b), c) > 0.0);
        }
    }
}
