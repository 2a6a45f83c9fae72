//! Subdivision of triangles into four.

use std::collections::BTreeMap;

/// Splits each triangle into four, at the midpoints of its edges; `add` returns the number of the midpoint, and is called once per edge.
pub(crate) fn quartered(faces: &[[u32; 3]], mut add: impl FnMut([u32; 2]) -> u32) -> Vec<[u32; 3]> {
    let mut middles = BTreeMap::new();
    let mut middle =
        |a: u32, b: u32| *middles.entry([a.min(b), a.max(b)]).or_insert_with_key(|&ends| add(ends));
    let cut = |&[a, b, c]: &[u32; 3]| {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    faces.iter().flat_map(cut).collect()
}

/// The mean of two entries, without overflow.
pub(crate) fn between<const N: usize>(of: &[[f64; N]], ends: [u32; 2]) -> [f64; N] {
    let [p, q] = ends.map(|end| of[end as usize]);
    std::array::from_fn(|k| p[k] / 2.0 + q[k] / 2.0)
}
