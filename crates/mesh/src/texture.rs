//! Pictures on the faces of a mesh.

use crate::{
    Material, MeshError,
    error::FARTHEST,
    subdivision::{between, quartered},
};

/// Texture coordinates of the corners of faces, and the [`Material`] of each face.
///
/// A coordinate is (u, v): u goes from 0 at the left end of the picture to 1 at the right one, v from 0 at the bottom to 1 at the top.
/// Beyond them the picture repeats. Each corner of each face has a separate coordinate, so vertices on a seam have several. All coordinates
/// are from -10000 to 10000, and every index is in range.
///
/// ```
/// use softrast_mesh::{Mesh, Texture};
///
/// let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
/// let texture = Texture::new(vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], vec![[0, 1, 2]])?;
/// let mesh = mesh.with_texture(texture)?;
/// assert_eq!(mesh.texture().unwrap().coordinates().len(), 3);
/// # Ok::<(), softrast_mesh::MeshError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    coordinates: Vec<[f64; 2]>,
    corners: Vec<[u32; 3]>,
    materials: Vec<Material>,
    of_faces: Vec<u32>,
    multiplies_colours: bool,
}

impl Texture {
    /// `coordinates` (u, v), and for each face of a mesh those of its three corners, as indices from 0; all faces have one white material.
    ///
    /// # Errors
    ///
    /// If a coordinate is not from -10000 to 10000, or an index is out of range.
    pub fn new(coordinates: Vec<[f64; 2]>, corners: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if let Some(coordinate) = coordinates.iter().position(|uv| !uv.iter().all(is_near)) {
            return Err(MeshError::Coordinate { coordinate });
        }
        let coordinates_found = coordinates.len();
        for (face, of_face) in corners.iter().enumerate() {
            if let Some(&coordinate) = of_face.iter().find(|&&k| k as usize >= coordinates_found) {
                return Err(MeshError::Corner { face, coordinate, coordinates: coordinates_found });
            }
        }
        let (materials, of_faces) = (vec![Material::default()], vec![0; corners.len()]);
        Ok(Self { coordinates, corners, materials, of_faces, multiplies_colours: false })
    }

    /// Sets the picture of all faces: the content of a PNG or JPEG file.
    ///
    /// # Errors
    ///
    /// If its first bytes are those of neither format.
    pub fn with_picture(self, picture: Vec<u8>) -> Result<Self, MeshError> {
        let of_faces = vec![0; self.corners.len()];
        self.with_materials(vec![Material::default().with_picture(picture)?], of_faces)
    }

    /// Sets the materials, and for each face the number of its material, from 0.
    ///
    /// # Errors
    ///
    /// If the number of `of_faces` differs from that of the faces, or one is out of range.
    pub fn with_materials(
        self,
        materials: Vec<Material>,
        of_faces: Vec<u32>,
    ) -> Result<Self, MeshError> {
        let (found, faces) = (of_faces.len(), self.corners.len());
        if found != faces {
            return Err(MeshError::MaterialFaces { found, faces });
        }
        let found = materials.len();
        if let Some(face) = of_faces.iter().position(|&number| number as usize >= found) {
            return Err(MeshError::Material { face, material: of_faces[face], materials: found });
        }
        Ok(Self { materials, of_faces, ..self })
    }

    /// Sets that vertex colours multiply the pictures, as in glTF files.
    #[must_use]
    pub fn multiplying_colours(self) -> Self {
        Self { multiplies_colours: true, ..self }
    }

    /// The coordinates (u, v), v up.
    pub fn coordinates(&self) -> &[[f64; 2]] {
        &self.coordinates
    }

    /// For each face of the mesh, three indices into [`Texture::coordinates`].
    pub fn corners(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// The materials of the faces.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// For each face of the mesh, an index into [`Texture::materials`].
    pub fn of_faces(&self) -> &[u32] {
        &self.of_faces
    }

    /// Whether vertex colours multiply pictures. Faces without a picture show the vertex colours in any case.
    pub fn multiplies_colours(&self) -> bool {
        self.multiplies_colours
    }

    /// The picture of the material, if there is only one: the content of a PNG or JPEG file.
    pub fn picture(&self) -> Option<&[u8]> {
        match self.materials.as_slice() {
            [material] => material.picture(),
            _ => None,
        }
    }

    /// The texture of faces split as by [`crate::Mesh::subdivided`].
    pub(crate) fn subdivided(&self) -> Self {
        let mut coordinates = self.coordinates.clone();
        let corners = quartered(&self.corners, |ends| {
            coordinates.push(between(&self.coordinates, ends));
            (coordinates.len() - 1) as u32
        });
        let of_faces = self.of_faces.iter().flat_map(|&number| [number; 4]).collect();
        Self { coordinates, corners, of_faces, materials: self.materials.clone(), ..*self }
    }
}

/// Whether a texture coordinate is in range.
pub(crate) fn is_near(x: &f64) -> bool {
    x.abs() <= FARTHEST
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, icosphere};

    const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    /// Two faces between four vertices, and a seam: they share no coordinate.
    fn mesh() -> Mesh {
        let positions = SQUARE.map(|[x, y]| [x, y, 3.0]).to_vec();
        let coordinates = [SQUARE, [[0.5, 0.5], [0.25, 0.5], [3.0, -2.0], [0.0; 2]]].concat();
        let texture = Texture::new(coordinates, vec![[0, 1, 2], [4, 5, 6]]).unwrap();
        let pictured = Material::default().with_picture(b"\xff\xd8\xff\xe0".to_vec()).unwrap();
        let texture = texture.with_materials(vec![pictured, Material::default()], vec![1, 0]);
        let texture = texture.unwrap().multiplying_colours();
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        mesh.with_texture(texture).unwrap()
    }

    #[test]
    fn bad_parts_are_refused_by_name() {
        let message = |coordinates: &[[f64; 2]], corners: &[[u32; 3]]| {
            Texture::new(coordinates.to_vec(), corners.to_vec()).unwrap_err().to_string()
        };
        assert_eq!(
            message(&SQUARE, &[[0, 1, 2], [0, 4, 0]]),
            "a corner of face 1 has texture coordinate 4, but there are 4"
        );
        for wrong in [f64::NAN, f64::NEG_INFINITY, 1e5] {
            let expected = "texture coordinate 1 is not from -10000 to 10000";
            assert_eq!(message(&[[0.0; 2], [0.0, wrong]], &[[0; 3]]), expected);
        }
        let texture = Texture::new(SQUARE.to_vec(), vec![[0, 1, 2]]).unwrap();
        let gif = texture.clone().with_picture(b"GIF89a".to_vec()).unwrap_err();
        assert_eq!(gif.to_string(), "the picture of a texture is neither PNG nor JPEG");
        let white = vec![Material::default()];
        let few = texture.clone().with_materials(white.clone(), vec![]).unwrap_err();
        assert_eq!(few.to_string(), "materials of 0 faces for the 1 faces of a texture");
        let high = texture.clone().with_materials(white, vec![1]).unwrap_err();
        assert_eq!(high.to_string(), "face 0 has material 1, but there are 1");
        let ball = icosphere(0).with_texture(texture).unwrap_err();
        assert_eq!(ball.to_string(), "a texture on 1 faces for the 20 faces of the mesh");
    }

    #[test]
    fn a_texture_stays_on_faces_that_move_or_are_cut() {
        let mesh = mesh();
        assert_eq!(mesh.normalized().texture(), mesh.texture());
        assert_eq!(mesh.with_positions(vec![[1.0; 3]; 4]).unwrap().texture(), mesh.texture());
        let finer = mesh.subdivided();
        let [coarse, fine] = [&mesh, &finer].map(|mesh| mesh.texture().unwrap());
        assert_eq!(fine.materials(), coarse.materials());
        assert_eq!(
            (fine.of_faces(), fine.multiplies_colours()),
            (&[1, 1, 1, 1, 0, 0, 0, 0][..], true)
        );
        let at = |corner: u32| fine.coordinates()[corner as usize];
        // The fourth part of the first face lies between the middles of its edges.
        assert_eq!(fine.corners()[3].map(at), [[0.5, 0.0], [1.0, 0.5], [0.5, 0.5]]);
        // The edge that both faces share has another middle on each.
        assert_eq!(at(fine.corners()[4][1]), [0.375, 0.5]);
        assert_eq!((fine.corners().len(), finer.faces().len()), (8, 8));
        assert_eq!(fine.coordinates().len(), 8 + 6);
    }
}
