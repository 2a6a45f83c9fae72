use anyhow::Context;
use softrast_mesh::Mesh;

/// Most faces of the mesh from a file; more make every step too slow.
pub const MOST_FACES: usize = 10_000;
/// Cubes along the longest side of the mesh for merging vertices in the first attempt; each further attempt has a fifth fewer.
const CUBES: f64 = 120.0;

/// A mesh from a file, normalized for the page.
pub struct Loaded {
    /// Centred at the origin, with the longest side of its box scaled to 2, and at most [`MOST_FACES`] faces.
    pub mesh: Mesh,
    /// Number of faces of the file.
    pub faces: usize,
}

/// Loads a mesh from the `bytes` of a file of this name: OBJ, PLY, STL, OFF, GLB or glTF.
///
/// # Errors
///
/// A message of one line with the fault of the file.
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

/// The mesh reduced to at most [`MOST_FACES`] faces.
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
