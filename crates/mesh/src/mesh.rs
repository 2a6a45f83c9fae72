//! A triangle mesh that is valid by construction.

use std::collections::BTreeMap;

use crate::MeshError;

/// Vertices and the triangles between them.
///
/// Every position is finite, also once rounded to 32 bits; every index is in range; there is at
/// least one face. Faces may be degenerate (a corner repeated, or no area), vertices may be
/// doubled or unused, and the surface may be open: none of this keeps a mesh from being rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
}

impl Mesh {
    /// A mesh of `positions` (world units, y up) and `faces` (indices from 0).
    ///
    /// # Errors
    ///
    /// If there is no face, a position is not finite in 32-bit floats, or an index is out of range.
    pub fn new(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if faces.is_empty() {
            return Err(MeshError::Empty);
        }
        if let Some(vertex) = positions.iter().position(|p| !p.iter().all(|&x| fits_f32(x))) {
            return Err(MeshError::Position { vertex });
        }
        let vertices = positions.len();
        for (face, corners) in faces.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(MeshError::Vertex { face, vertex, vertices });
            }
        }
        Ok(Self { positions, faces })
    }

    /// The same surface with each triangle cut into four, at the middles of its edges.
    #[must_use]
    pub fn subdivided(&self) -> Self {
        let mut positions = self.positions.clone();
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let [p, q] = [a, b].map(|v| self.positions[v as usize]);
                positions.push([0, 1, 2].map(|k| p[k] / 2.0 + q[k] / 2.0));
                (positions.len() - 1) as u32
            })
        };
        let cut = |&[a, b, c]: &[u32; 3]| {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        let faces = self.faces.iter().flat_map(cut).collect();
        Self { positions, faces }
    }

    /// The vertices, in world units.
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// The triangles: three indices into [`Mesh::positions`] each, counterclockwise from outside
    /// where the mesh has an outside.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// The three corners of every triangle, in world units.
    pub fn triangles(&self) -> impl Iterator<Item = [[f64; 3]; 3]> {
        self.faces.iter().map(|face| face.map(|v| self.positions[v as usize]))
    }

    /// Lowest and highest corner of the axis-aligned box around all vertices that a face uses.
    ///
    /// A vertex that no face uses cannot be seen, so it does not count.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let start = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        self.triangles().flatten().fold(start, |[low, high], p| {
            let each = [0, 1, 2];
            [each.map(|k| low[k].min(p[k])), each.map(|k| high[k].max(p[k]))]
        })
    }

    /// Surface area in square world units: the sum over triangles, either side up.
    pub fn area(&self) -> f64 {
        self.triangles()
            .map(|[a, b, c]| 0.5 * norm(cross(difference(b, a), difference(c, a))))
            .sum()
    }

    /// A mesh of parts that are valid by construction.
    pub(crate) fn from_valid(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Self {
        Self { positions, faces }
    }
}

/// Whether `x` stays finite when a 32-bit backend takes it.
pub(crate) fn fits_f32(x: f64) -> bool {
    (x as f32).is_finite()
}

/// `a - b`.
pub(crate) fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

/// `a · b`.
pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a × b`.
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| a[i] * b[j] - a[j] * b[i])
}

/// `√(a · a)`.
pub(crate) fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNER: [[f64; 3]; 4] = [[0.0; 3], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [9.0, 9.0, 9.0]];

    #[test]
    fn right_triangle_has_half_the_area_of_its_rectangle() {
        let mesh = Mesh::new(CORNER.to_vec(), vec![[0, 2, 1]]).unwrap();
        assert_eq!(mesh.area(), 6.0);
    }

    #[test]
    fn bounds_leave_out_unused_vertices() {
        let mesh = Mesh::new(CORNER.to_vec(), vec![[0, 1, 2]]).unwrap();
        assert_eq!(mesh.bounds(), [[0.0; 3], [3.0, 4.0, 0.0]]);
    }

    #[test]
    fn invalid_parts_are_refused_by_name() {
        let message = |positions: &[[f64; 3]], faces: &[[u32; 3]]| {
            Mesh::new(positions.to_vec(), faces.to_vec()).unwrap_err().to_string()
        };
        assert_eq!(message(&CORNER, &[]), "a mesh needs at least one face, found none");
        let missing = "face 0 of the mesh uses vertex 4, but there are 4";
        assert_eq!(message(&CORNER, &[[0, 1, 4]]), missing);
        for wrong in [f64::NAN, f64::INFINITY, -1e39] {
            let positions = [[0.0; 3], [0.0, wrong, 0.0], [1.0; 3]];
            let expected = "position 1 of the mesh is not finite in 32-bit floats";
            assert_eq!(message(&positions, &[[0, 0, 0]]), expected);
        }
    }
}
