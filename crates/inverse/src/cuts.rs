//! Meshes whose faces were cut by [`Mesh::subdivided`].

use anyhow::ensure;
use softrast_mesh::Mesh;

/// The number of times that `mesh` was subdivided to get `fine`.
///
/// # Errors
///
/// If the number of faces is not that of any such subdivision.
pub(crate) fn cuts(mesh: &Mesh, fine: &Mesh) -> anyhow::Result<u32> {
    let (faces, parts) = (mesh.faces().len(), fine.faces().len());
    let cuts = (parts / faces.max(1)).max(1).ilog(4);
    ensure!(
        faces << (2 * cuts) == parts,
        "a mesh of {parts} faces is not one of {faces} whose faces were cut into four"
    );
    Ok(cuts)
}

/// Calls `show` with each part of a face that was cut this many times, and the shares of the face's corners at those of the part, times 2^cuts.
pub(crate) fn parts(face: usize, cuts: u32, show: &mut impl FnMut(usize, [[f64; 3]; 3])) {
    let along = f64::from(1u32 << cuts);
    let corners = [[along, 0.0, 0.0], [0.0, along, 0.0], [0.0, 0.0, along]];
    part(face, cuts, corners, show);
}

fn part(
    face: usize,
    cuts: u32,
    [a, b, c]: [[f64; 3]; 3],
    show: &mut impl FnMut(usize, [[f64; 3]; 3]),
) {
    if cuts == 0 {
        return show(face, [a, b, c]);
    }
    let middle = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|k| (p[k] + q[k]) / 2.0);
    let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
    // The order of `Mesh::subdivided`.
    let parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]];
    for (k, corners) in parts.into_iter().enumerate() {
        part(4 * face + k, cuts - 1, corners, show);
    }
}
