/// Grid cells along each axis.
pub(crate) const CELLS: usize = 32;

/// Occupancy of a grid of `32³` cells.
///
/// The centre of cell `i` along an axis lies at `(i - 15.5) / 31` world units, so that the outermost centres are at
/// ±0.5. A cell is full if its centre is inside the shape. Stored in the order of the public files: y rises with the
/// first index, x with the second, and z falls with the third.
///
/// Source: docs/notes.md, Reconstruction (grid of 32³). Not in the paper: thin surfaces do not fill the cells that they
/// touch, because only the rule of centres can be tested against solids of known volume.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Voxels(Vec<bool>);

/// World coordinate of the centre of a cell.
fn centre(cell: usize) -> f64 {
    (cell as f64 - 15.5) / 31.0
}

/// Index of cell `[x, y, z]`.
fn place([x, y, z]: [usize; 3]) -> usize {
    (y * CELLS + x) * CELLS + (CELLS - 1 - z)
}

impl Voxels {
    /// The cells whose centres satisfy `inside`.
    pub fn of_solid(inside: impl Fn([f64; 3]) -> bool) -> Self {
        let mut full = vec![false; CELLS.pow(3)];
        for x in 0..CELLS {
            for y in 0..CELLS {
                for z in 0..CELLS {
                    full[place([x, y, z])] = inside([x, y, z].map(centre));
                }
            }
        }
        Self(full)
    }

    /// The cells with a non-zero winding number of the closed surface of `faces`, in either
    /// direction; the surface may intersect itself.
    ///
    /// Crossings of rays along z are counted with their signs. Two faces that share an edge test it
    /// identically, so that no ray slips between them or is counted twice.
    ///
    /// # Panics
    ///
    /// If a face uses a missing vertex.
    pub fn of_mesh(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Self {
        let mut winding = vec![0_i32; CELLS.pow(3)];
        for face in faces {
            let corners = face.map(|v| vertices[v as usize]);
            let [columns, rows] = [0, 1].map(|axis| cells_between(corners.map(|p| p[axis])));
            for x in columns {
                for y in rows.clone() {
                    let Some((sign, height)) = crossing(&corners, centre(x), centre(y)) else {
                        continue;
                    };
                    for z in (0..CELLS).take_while(|&z| centre(z) < height) {
                        winding[place([x, y, z])] += sign;
                    }
                }
            }
        }
        Self(winding.into_iter().map(|count| count != 0).collect())
    }

    /// Cells from their order in a file.
    ///
    /// # Panics
    ///
    /// If their number is not `32³`.
    pub(crate) fn from_file_order(full: Vec<bool>) -> Self {
        assert_eq!(full.len(), CELLS.pow(3), "cells of a grid");
        Self(full)
    }

    /// Cells in the order of the files.
    pub fn in_file_order(&self) -> &[bool] {
        &self.0
    }

    /// Number of full cells.
    pub fn count(&self) -> usize {
        self.0.iter().filter(|&&full| full).count()
    }

    /// Cells full in both over cells full in either, 0 to 1; 1 if both are empty.
    pub fn iou(&self, other: &Self) -> f64 {
        let both = self.0.iter().zip(&other.0).filter(|&(&a, &b)| a && b).count();
        let either = self.count() + other.count() - both;
        if either == 0 { 1.0 } else { both as f64 / either as f64 }
    }
}

/// Cells whose centres lie between the smallest and the largest of three coordinates.
fn cells_between(coordinates: [f64; 3]) -> std::ops::Range<usize> {
    let low = coordinates.into_iter().fold(f64::INFINITY, f64::min);
    let high = coordinates.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let cell = |x: f64| (x * 31.0 + 15.5).clamp(-1.0, CELLS as f64);
    let first = cell(low).ceil().max(0.0) as usize;
    let end = (cell(high).floor() + 1.0).max(0.0) as usize;
    first..end.min(CELLS)
}

/// The signed crossing of a triangle by the line through (x, y) along z, and its z.
fn crossing(corners: &[[f64; 3]; 3], x: f64, y: f64) -> Option<(i32, f64)> {
    let sign: i32 = (0..3).map(|k| passes(corners[k], corners[(k + 1) % 3], x, y)).sum();
    if sign == 0 {
        return None;
    }
    let [a, b, c] = corners;
    let part = |p: &[f64; 3], q: &[f64; 3]| (p[0] - x) * (q[1] - y) - (q[0] - x) * (p[1] - y);
    let weights = [part(b, c), part(c, a), part(a, b)];
    let area: f64 = weights.iter().sum();
    let height = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) / area;
    // If the triangle is seen edge-on, the height has a large rounding error.
    let low = a[2].min(b[2]).min(c[2]);
    let height = if height.is_finite() { height } else { low };
    Some((sign, height.clamp(low, a[2].max(b[2]).max(c[2]))))
}

/// 1 or -1 if the edge from `a` to `b` passes to the right of (x, y), upwards or downwards.
fn passes(a: [f64; 3], b: [f64; 3], x: f64, y: f64) -> i32 {
    let up = match (a[1] <= y, b[1] <= y) {
        (true, false) => 1,
        (false, true) => -1,
        _ => return 0,
    };
    // Always from the lower end, so that both faces of an edge round equally.
    let (low, high) = if up == 1 { (a, b) } else { (b, a) };
    let left = (high[0] - low[0]) * (y - low[1]) - (x - low[0]) * (high[1] - low[1]);
    if left > 0.0 { up } else { 0 }
}

#[cfg(test)]
mod tests {
    use softrast_mesh::{Mesh, icosphere};

    use super::*;

    fn of(mesh: &Mesh) -> Voxels {
        Voxels::of_mesh(mesh.positions(), mesh.faces())
    }

    /// A mesh with the vertices of `mesh` after `map`.
    fn mapped(mesh: &Mesh, map: impl Fn([f64; 3]) -> [f64; 3]) -> Mesh {
        let positions = mesh.positions().iter().map(|&p| map(p)).collect();
        Mesh::new(positions, mesh.faces().to_vec()).unwrap()
    }

    /// A closed box of twelve triangles.
    fn block(low: [f64; 3], high: [f64; 3]) -> Mesh {
        let corner =
            |bits: usize| [0, 1, 2].map(|k| if bits >> k & 1 == 1 { high[k] } else { low[k] });
        let quads: [[u32; 4]; 6] =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Mesh::new((0..8).map(corner).collect(), faces).unwrap()
    }

    #[test]
    fn a_box_fills_the_cells_whose_centres_it_holds() {
        let (low, high) = ([-0.3, -0.11, 0.05], [0.2, 0.4, 0.31]);
        let voxels = of(&block(low, high));
        let inside = |p: [f64; 3]| (0..3).all(|k| low[k] < p[k] && p[k] < high[k]);
        assert_eq!(voxels, Voxels::of_solid(inside));
        // The cells along an axis: whole numbers between 31 low + 15.5 and 31 high + 15.5.
        assert_eq!(voxels.count(), (21 - 6) * (27 - 12) * (25 - 17));
    }

    #[test]
    fn a_ball_has_its_volume_and_stands_where_it_is() {
        let centre = [0.1, -0.05, 0.15];
        let ball = mapped(&icosphere(4), |p| [0, 1, 2].map(|k| centre[k] + 0.3 * p[k]));
        let voxels = of(&ball);
        let exact =
            Voxels::of_solid(|p| (0..3).map(|k| (p[k] - centre[k]).powi(2)).sum::<f64>() < 0.09);
        assert!(voxels.iou(&exact) > 0.98, "{}", voxels.iou(&exact));
        let volume = voxels.count() as f64 / 31_f64.powi(3);
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.027;
        assert!((volume / ball - 1.0).abs() < 0.02, "{volume} against {ball}");
    }

    #[test]
    fn a_torus_keeps_its_hole() {
        // A grid of 64 x 32 quadrilaterals around the y axis.
        let turn = |k: usize, of: usize| std::f64::consts::TAU * k as f64 / of as f64;
        let point = |i: usize, j: usize| {
            let (u, v) = (turn(i, 64), turn(j, 32));
            let ring = 0.3 + 0.12 * v.cos();
            [ring * u.cos(), 0.12 * v.sin(), ring * u.sin()]
        };
        let number = |i: usize, j: usize| ((i % 64) * 32 + j % 32) as u32;
        let positions = (0..64).flat_map(|i| (0..32).map(move |j| point(i, j))).collect();
        let faces = (0..64).flat_map(|i| {
            (0..32).flat_map(move |j| {
                let [a, b, c, d] =
                    [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| number(i, j));
                [[a, b, c], [a, c, d]]
            })
        });
        let torus = of(&Mesh::new(positions, faces.collect()).unwrap());
        let exact = Voxels::of_solid(|p| (p[0].hypot(p[2]) - 0.3).hypot(p[1]) < 0.12);
        assert!(torus.iou(&exact) > 0.97, "{}", torus.iou(&exact));
        assert!(!torus.in_file_order()[place([15, 15, 15])]);
    }

    #[test]
    fn a_surface_through_itself_or_inside_out_is_full_all_the_same() {
        let [one, other] = [block([-0.3; 3], [0.1; 3]), block([-0.1; 3], [0.3; 3])];
        let mut positions = one.positions().to_vec();
        positions.extend(other.positions());
        let mut faces = one.faces().to_vec();
        faces.extend(other.faces().iter().map(|face| face.map(|v| v + 8)));
        let both = of(&Mesh::new(positions.clone(), faces.clone()).unwrap());
        let overlap = (of(&one).count(), of(&block([-0.1; 3], [0.1; 3])).count());
        assert_eq!(both.count(), 2 * overlap.0 - overlap.1);
        faces.iter_mut().for_each(|face| face.swap(0, 1));
        assert_eq!(of(&Mesh::new(positions, faces).unwrap()), both);
    }

    #[test]
    fn corners_on_the_centres_of_cells_leave_no_ray_behind() {
        let voxels = of(&block([centre(5); 3], [centre(20); 3]));
        assert_eq!(voxels.count() % 15, 0);
        assert!((15..=16).any(|side| voxels.count() == 15 * 15 * side), "{}", voxels.count());
    }

    #[test]
    fn collapsed_and_far_away_meshes_are_empty() {
        for mesh in
            [mapped(&icosphere(1), |_| [0.1; 3]), mapped(&icosphere(1), |p| p.map(|x| x + 9.0))]
        {
            assert_eq!(of(&mesh).count(), 0);
        }
        let empty = Voxels::of_solid(|_| false);
        let full = Voxels::of_solid(|_| true);
        assert_eq!((empty.iou(&empty), empty.iou(&full), full.iou(&full)), (1.0, 0.0, 1.0));
    }

    #[test]
    fn the_order_is_that_of_the_files() {
        // y, then x, then z backwards.
        let voxels = Voxels::of_solid(|p| p[0] > 0.49 && p[1] < -0.49 && p[2] > 0.49);
        let place = voxels.in_file_order().iter().position(|&full| full);
        assert_eq!(place, Some(31 * CELLS));
    }
}
