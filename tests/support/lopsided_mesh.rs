use softrast_mesh::{Mesh, icosphere};

/// A small closed mesh without symmetry.
///
/// # Panics
///
/// Never: its faces are those of a ball.
pub fn lopsided_mesh() -> Mesh {
    let ball = icosphere(0);
    let stretched = ball.positions().iter().map(|[x, y, z]| [*x, 0.7 * y, 0.4 * z + 0.3 * x]);
    Mesh::new(stretched.collect(), ball.faces().to_vec()).expect("a valid mesh")
}
