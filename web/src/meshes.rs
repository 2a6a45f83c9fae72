use anyhow::Context;
use softrast_mesh::Mesh;

/// Faces of a mesh from a file that the page works with at most; more take too long for every step.
pub const MOST_FACES: usize = 10_000;
/// The first attempt to merge vertices has so many cubes along the longest side of the mesh, each further one a fifth less.
const CUBES: f64 = 120.0;

/// A mesh from a file, as it is looked at.
pub struct Loaded {
    /// Centred at the origin, the longest side of its box 2, and with no more than [`MOST_FACES`] faces.
    pub mesh: Mesh,
    /// Faces of the file.
    pub faces: usize,
}

/// The mesh in the `bytes` of a file of this name: OBJ, PLY, STL, OFF, GLB or glTF.
///
/// # Errors
///
/// One line that says what is wrong with the file.
pub fn loaded(bytes: &[u8], name: &str) -> anyhow::Result<Loaded> {
    let mesh = Mesh::parse(bytes, name)?.normalized();
    let faces = mesh.faces().len();
    Ok(Loaded {
        mesh: reduced(mesh).with_context(|| {
            format!("{name} has {faces} faces, and nothing is left of it with fewer")
        })?,
        faces,
    })
}

/// The mesh with few enough faces.
fn reduced(mesh: Mesh) -> Option<Mesh> {
    if mesh.faces().len() <= MOST_FACES {
        return Some(mesh);
    }
    let cells = std::iter::successors(Some(2.0 / CUBES), |cell| Some(cell * 1.25))
        .take_while(|cell| *cell < 1.0);
    let few = cells
        .map(|cell| mesh.clustered(cell))
        .find(|few| few.as_ref().is_none_or(|few| few.faces().len() <= MOST_FACES));
    few.flatten()
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;

    #[test]
    fn a_large_mesh_is_reduced_and_a_small_one_stays() {
        let ball = icosphere(6);
        let Loaded { mesh, faces } = loaded(&ball.to_ply(), "ball.ply").unwrap();
        assert_eq!(faces, 81_920);
        assert!((1_000..=MOST_FACES).contains(&mesh.faces().len()), "{}", mesh.faces().len());
        let small = icosphere(2);
        assert_eq!(loaded(&small.to_ply(), "ball.ply").unwrap().mesh.faces(), small.faces());
    }

    #[test]
    fn a_bad_file_is_one_line() {
        let line = loaded(b"v 0 0 0\nf 1 2 3", "a.obj").err().unwrap().to_string();
        assert_eq!(line, "a.obj:2: index 2 is out of range: the file has 1 vertices");
    }
}
