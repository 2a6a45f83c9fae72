//! A triangle mesh that is valid by construction.

use crate::{
    Fault, MeshError, Texture,
    error::shown,
    subdivision::{between, quartered},
    vectors::{norm, normal},
};

/// Vertices and the triangles between them.
///
/// Every position is finite, also once rounded to 32 bits; every index is in range; there is at least one face. Faces may be degenerate (a
/// repeated corner, or no area), vertices may be duplicated or unused, and the surface may be open: such meshes can be rendered.
///
/// A mesh may have a colour at each vertex; then every channel is in [0, 1]. It may have a [`Texture`] on its faces.
///
/// ```
/// use softrast_mesh::Mesh;
///
/// let flat = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
/// assert_eq!(flat.subdivided().faces().len(), 4);
/// let larger = flat.triangles().flatten().map(|p| p.map(|x| 2.0 * x)).collect();
/// let larger = flat.with_positions(larger)?;
/// assert_eq!((flat.area(), larger.area()), (0.5, 2.0));
/// let red = larger.with_colours(vec![[1.0, 0.0, 0.0]; 3])?;
/// assert_eq!(Mesh::parse(red.to_obj().as_bytes(), "red.obj")?, red);
/// assert_eq!(Mesh::parse(&red.to_ply(), "red.ply")?, red);
/// # Ok::<(), softrast_mesh::MeshError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    positions: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    colours: Option<Vec<[f64; 3]>>,
    texture: Option<Texture>,
}

impl Mesh {
    /// A mesh of `positions` (world units, y up) and `faces` (indices from 0), without colours or texture.
    ///
    /// # Errors
    ///
    /// If there is no face, a position is not finite in 32-bit floats, or an index is out of range.
    pub fn new(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if faces.is_empty() {
            return Err(MeshError::Empty);
        }
        all_finite(&positions)?;
        let vertices = positions.len();
        for (face, corners) in faces.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(MeshError::Vertex { face, vertex, vertices });
            }
        }
        Ok(Self::from_valid(positions, faces))
    }

    /// The mesh with a colour at each vertex: red, green and blue from 0 to 1 in sRGB.
    ///
    /// # Errors
    ///
    /// If the number of colours differs from that of the vertices, or a channel is not from 0 to 1.
    pub fn with_colours(self, colours: Vec<[f64; 3]>) -> Result<Self, MeshError> {
        let (found, vertices) = (colours.len(), self.positions.len());
        if found != vertices {
            return Err(MeshError::Colours { found, vertices });
        }
        if let Some(vertex) = colours.iter().position(|c| !c.iter().all(is_share)) {
            return Err(MeshError::Colour { vertex });
        }
        Ok(Self { colours: Some(colours), ..self })
    }

    /// The mesh with a texture on its faces.
    ///
    /// # Errors
    ///
    /// If the number of faces of the texture differs from that of the mesh.
    pub fn with_texture(self, texture: Texture) -> Result<Self, MeshError> {
        let (found, faces) = (texture.corners().len(), self.faces.len());
        if found != faces {
            return Err(MeshError::TextureFaces { found, faces });
        }
        Ok(Self { texture: Some(texture), ..self })
    }

    /// The mesh with its vertices at other positions: faces, colours and texture are unchanged.
    ///
    /// # Errors
    ///
    /// If a position is not finite in 32-bit floats.
    ///
    /// # Panics
    ///
    /// If the number of positions differs from that of the vertices.
    pub fn with_positions(&self, positions: Vec<[f64; 3]>) -> Result<Self, MeshError> {
        all_finite(&positions)?;
        Ok(self.moved(positions))
    }

    /// The surface with each triangle split into four, at the midpoints of its edges. Colours and texture coordinates of a midpoint are the
    /// means of both ends.
    #[must_use]
    pub fn subdivided(&self) -> Self {
        let mut positions = self.positions.clone();
        let mut colours = self.colours.clone();
        let faces = quartered(&self.faces, |ends| {
            positions.push(between(&self.positions, ends));
            if let Some(colours) = &mut colours {
                colours.push(between(colours, ends));
            }
            (positions.len() - 1) as u32
        });
        let texture = self.texture.as_ref().map(Texture::subdivided);
        Self { positions, faces, colours, texture }
    }

    /// The vertices, in world units.
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// Red, green and blue at each vertex, from 0 to 1 in sRGB; if the mesh has colours.
    #[doc(alias = "colors")]
    pub fn colours(&self) -> Option<&[[f64; 3]]> {
        self.colours.as_deref()
    }

    /// The texture, if there is one; [`Mesh::load_textured`] reads it.
    pub fn texture(&self) -> Option<&Texture> {
        self.texture.as_ref()
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
    /// An unused vertex is not visible, and is ignored.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let start = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        self.triangles().flatten().fold(start, |[low, high], p| {
            let each = [0, 1, 2];
            [each.map(|k| low[k].min(p[k])), each.map(|k| high[k].max(p[k]))]
        })
    }

    /// Surface area in square world units: the sum over the triangles, regardless of orientation.
    pub fn area(&self) -> f64 {
        self.triangles().map(|triangle| 0.5 * norm(normal(triangle))).sum()
    }

    /// A mesh of valid parts.
    pub(crate) fn from_valid(positions: Vec<[f64; 3]>, faces: Vec<[u32; 3]>) -> Self {
        Self { positions, faces, colours: None, texture: None }
    }

    /// The mesh with colours, which must be valid.
    pub(crate) fn painted(self, colours: Vec<[f64; 3]>) -> Self {
        Self { colours: Some(colours), ..self }
    }

    /// The mesh with its vertices at other positions, which must be valid.
    pub(crate) fn moved(&self, positions: Vec<[f64; 3]>) -> Self {
        assert_eq!(positions.len(), self.positions.len(), "positions of vertices");
        let (faces, colours) = (self.faces.clone(), self.colours.clone());
        Self { positions, faces, colours, texture: self.texture.clone() }
    }
}

/// Whether a channel of a colour is from 0 to 1.
fn is_share(x: &f64) -> bool {
    (0.0..=1.0).contains(x)
}

fn all_finite(positions: &[[f64; 3]]) -> Result<(), MeshError> {
    match positions.iter().position(|p| !p.iter().all(|&x| fits_f32(x))) {
        Some(vertex) => Err(MeshError::Position { vertex }),
        None => Ok(()),
    }
}

/// Whether `x` is finite as an f32.
pub(crate) fn fits_f32(x: f64) -> bool {
    (x as f32).is_finite()
}

/// An error unless all coordinates of `position` are finite in 32 bits.
pub(crate) fn finite(position: [f64; 3]) -> Result<(), Fault> {
    match position.iter().find(|&&x| !fits_f32(x)) {
        Some(x) => Err(Fault::NotFinite(shown(&format!("{x:?}")))),
        None => Ok(()),
    }
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
    fn colours_are_one_for_each_vertex_and_from_0_to_1() {
        let mesh = Mesh::new(CORNER.to_vec(), vec![[0, 1, 2]]).unwrap();
        assert_eq!(mesh.colours(), None);
        let message =
            |colours: Vec<[f64; 3]>| mesh.clone().with_colours(colours).unwrap_err().to_string();
        assert_eq!(message(vec![[0.5; 3]; 3]), "3 colours for the 4 vertices of the mesh");
        for wrong in [f64::NAN, -1e-9, 1.1, f64::INFINITY] {
            let colours = vec![[0.0; 3], [0.0, 1.0, wrong], [1.0; 3], [1.0; 3]];
            assert_eq!(message(colours), "the colour of vertex 1 of the mesh is not from 0 to 1");
        }
    }

    #[test]
    fn colours_stay_where_vertices_move_and_are_means_where_there_are_more() {
        let colours = vec![[0.0; 3], [1.0, 0.5, 0.0], [0.0, 0.5, 1.0], [1.0; 3]];
        let mesh = Mesh::new(CORNER.to_vec(), vec![[0, 1, 2]]).unwrap();
        let mesh = mesh.with_colours(colours.clone()).unwrap();
        assert_eq!(mesh.normalized().colours(), Some(colours.as_slice()));
        assert_eq!(mesh.with_positions(vec![[1.0; 3]; 4]).unwrap().colours(), mesh.colours());
        assert!(mesh.with_positions(vec![[f64::NAN; 3]; 4]).is_err());
        let finer = mesh.subdivided();
        let middles = [[0.5, 0.25, 0.0], [0.5; 3], [0.0, 0.25, 0.5]];
        assert_eq!(finer.colours().unwrap(), [colours.as_slice(), &middles].concat());
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
