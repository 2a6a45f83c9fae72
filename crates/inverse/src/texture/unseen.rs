//! Colours of vertices that no view shows.

use softrast_mesh::{Edges, Mesh};

/// Rounds in which colours that were filled in become means of those around them.
const ROUNDS: usize = 100;

/// The colours of the vertices of a mesh, those on no face that is seen replaced by colours that go over from one seen place to the next. Vertices from which
/// no edge leads to such a place stay.
pub(super) fn without_unseen(mesh: &Mesh, sees_face: impl Fn(usize) -> bool) -> Vec<[f64; 3]> {
    let mut colours = mesh.colours().unwrap_or_default().to_vec();
    let mut known = vec![false; colours.len()];
    for (_, face) in mesh.faces().iter().enumerate().filter(|(k, _)| sees_face(*k)) {
        face.iter().for_each(|&vertex| known[vertex as usize] = true);
    }
    let mut beside = vec![Vec::<usize>::new(); colours.len()];
    for [a, b] in Edges::new(mesh.faces()).ends.iter().map(|ends| ends.map(|v| v as usize)) {
        beside[a].push(b);
        beside[b].push(a);
    }
    let mean = |colours: &[[f64; 3]], of: &mut dyn Iterator<Item = usize>| {
        let (mut sum, mut count) = ([0.0; 3], 0.0f64);
        for other in of {
            (0..3).for_each(|k| sum[k] += colours[other][k]);
            count += 1.0;
        }
        (count > 0.0).then(|| sum.map(|x| x / count))
    };
    // Ring by ring from what is seen.
    let mut filled: Vec<usize> = Vec::new();
    let mut ring: Vec<usize> = (0..known.len()).filter(|&v| known[v]).collect();
    while !ring.is_empty() {
        let mut next: Vec<usize> =
            ring.iter().flat_map(|&v| &beside[v]).copied().filter(|&v| !known[v]).collect();
        next.sort_unstable();
        next.dedup();
        for &v in &next {
            let mut from = beside[v].iter().copied().filter(|&other| known[other]);
            colours[v] = mean(&colours, &mut from).unwrap_or(colours[v]);
        }
        next.iter().for_each(|&v| known[v] = true);
        filled.extend(&next);
        ring = next;
    }
    for _ in 0..ROUNDS {
        for &v in &filled {
            colours[v] = mean(&colours, &mut beside[v].iter().copied()).unwrap_or(colours[v]);
        }
    }
    colours
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_seen_goes_over_from_one_seen_place_to_the_next() {
        // A strip of squares: both ends are seen, and a face apart is not.
        let positions = (0..=6).flat_map(|k| [[f64::from(k), 0.0, 0.0], [f64::from(k), 1.0, 0.0]]);
        let apart = [[0.0, 5.0, 0.0], [1.0, 5.0, 0.0], [0.0, 6.0, 0.0]];
        let squares = (0..6u32).map(|k| [0, 1, 2, 3].map(|i| 2 * k + i));
        let faces = squares.flat_map(|[a, b, c, d]| [[a, c, b], [b, c, d]]);
        let faces = faces.chain([[14, 15, 16]]).collect();
        let mesh = Mesh::new(positions.chain(apart).collect(), faces).unwrap();
        let level = |v: usize| match v / 2 {
            0 | 1 => 0.2,
            5 | 6 => 0.8,
            _ => [0.0, 1.0][v % 2],
        };
        let colours = (0..17).map(|v| [level(v); 3]).collect();
        let mesh = mesh.with_colours(colours).unwrap();
        let found = without_unseen(&mesh, |face| [0, 1, 10, 11].contains(&face));
        for (v, expected) in [(0, 0.2), (3, 0.2), (11, 0.8), (14, 0.0), (15, 1.0)] {
            assert_eq!(found[v], [expected; 3], "{v}");
        }
        let between: Vec<f64> = (4..10).map(|v| found[v][0]).collect();
        assert!(between.iter().all(|x| (0.2..0.8).contains(x)), "{between:?}");
        assert!(between[0] < between[2] && between[2] < between[4], "{between:?}");
    }
}
