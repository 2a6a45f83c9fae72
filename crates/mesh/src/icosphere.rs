//! A sphere of nearly equal triangles.

use crate::{
    Mesh,
    subdivision::quartered,
    vectors::{cross, dot, norm},
};

/// The unit sphere: an icosahedron whose triangles are split in four `subdivisions` times.
///
/// It has `10 · 4ⁿ + 2` vertices and `20 · 4ⁿ` faces (642 and 1280 for `n = 3`), counterclockwise
/// from outside.
///
/// # Panics
///
/// If `subdivisions` is above 10, which would be more than 20 million faces.
pub fn icosphere(subdivisions: u32) -> Mesh {
    assert!(subdivisions <= 10, "an icosphere of {subdivisions} subdivisions is too large");
    let (mut positions, mut faces) = icosahedron();
    for _ in 0..subdivisions {
        faces = quartered(&faces, |ends| {
            let [p, q] = ends.map(|end| positions[end as usize]);
            positions.push(on_sphere([0, 1, 2].map(|k| p[k] + q[k])));
            positions.len() as u32 - 1
        });
    }
    Mesh::from_valid(positions, faces)
}

/// The twelve vertices of the icosahedron, and its twenty faces: all triples of neighbours.
fn icosahedron() -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let golden = f64::midpoint(1.0, 5f64.sqrt());
    let mut positions = Vec::new();
    for axis in 0..3 {
        for (short, long) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
            let mut p = [0.0; 3];
            p[(axis + 1) % 3] = short;
            p[(axis + 2) % 3] = long;
            positions.push(on_sphere(p));
        }
    }
    // The cosine of the angle between two vertices is 0.45 along an edge, and else below 0.
    let p = |vertex: u32| positions[vertex as usize];
    let near = |a, b| dot(p(a), p(b)) > 0.0;
    let mut faces = Vec::new();
    for (a, b) in (0..12).flat_map(|b| (0..b).map(move |a| (a, b))).filter(|&(a, b)| near(a, b)) {
        for c in (b + 1..12).filter(|&c| near(a, c) && near(b, c)) {
            let outward = dot(cross(p(a), p(b)), p(c)) > 0.0;
            faces.push(if outward { [a, b, c] } else { [a, c, b] });
        }
    }
    (positions, faces)
}

fn on_sphere(p: [f64; 3]) -> [f64; 3] {
    let length = norm(p);
    p.map(|x| x / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_three_has_642_vertices_and_1280_faces() {
        for (level, vertices) in [(0, 12), (1, 42), (2, 162), (3, 642)] {
            let sphere = icosphere(level);
            assert_eq!(sphere.positions().len(), vertices);
            assert_eq!(sphere.faces().len(), 2 * vertices - 4);
            Mesh::new(sphere.positions().to_vec(), sphere.faces().to_vec()).unwrap();
        }
    }

    #[test]
    fn icosahedron_has_its_known_area() {
        // 5 √3 a², where the edge of the unit icosahedron is a² = 4 / (φ √5) = 2 - 2 / √5.
        let expected = 5.0 * 3f64.sqrt() * (2.0 - 2.0 / 5f64.sqrt());
        assert!((icosphere(0).area() - expected).abs() < 1e-12);
    }

    #[test]
    fn vertices_are_on_the_unit_sphere_and_faces_look_outward() {
        let sphere = icosphere(3);
        assert!(sphere.positions().iter().all(|&p| (norm(p) - 1.0).abs() < 1e-15));
        assert!(sphere.triangles().all(|[a, b, c]| dot(cross(a, b), c) > 0.0));
    }
}
