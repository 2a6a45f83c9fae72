//! Faces of a mesh that pass through each other.

use rayon::prelude::*;

use crate::{
    Mesh,
    vectors::{cross, difference, dot},
};

/// Cells of the search are this many times as wide as the mean extent of a face.
const CELL: f64 = 2.0;
/// Cells along an axis at most.
const MOST_CELLS: f64 = 1024.0;
/// A face in more cells than this is compared with all others.
const SPREAD: usize = 64;
/// A face with its box.
struct Place {
    low: [f64; 3],
    high: [f64; 3],
}

impl Mesh {
    /// Pairs of faces that pass through each other, the lower number first, in order. Faces that share an edge are excluded, so that a
    /// fold is none, and faces that lie in a plane or only touch are too.
    ///
    /// ```
    /// use softrast_mesh::{Mesh, icosphere};
    ///
    /// let ball = icosphere(2);
    /// assert!(ball.self_intersections().is_empty());
    /// let mut places = ball.positions().to_vec();
    /// places[0] = places[0].map(|x| -1.5 * x); // through the other side
    /// assert!(!ball.with_positions(places)?.self_intersections().is_empty());
    /// # Ok::<(), softrast_mesh::MeshError>(())
    /// ```
    pub fn self_intersections(&self) -> Vec<[u32; 2]> {
        let triangles: Vec<_> = self.triangles().collect();
        let place = |t: &[[f64; 3]; 3]| {
            let of = |pick: fn(f64, f64) -> f64| {
                [0, 1, 2].map(|k| pick(pick(t[0][k], t[1][k]), t[2][k]))
            };
            Place { low: of(f64::min), high: of(f64::max) }
        };
        let places: Vec<Place> = triangles.iter().map(place).collect();
        let [low, high] = self.bounds();
        let size = |place: &Place| (0..3).map(|k| place.high[k] - place.low[k]).fold(0.0, f64::max);
        let mean = places.iter().map(size).sum::<f64>() / places.len() as f64;
        let whole = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        let cell = (CELL * mean).max(whole / MOST_CELLS);
        if cell <= 0.0 {
            return Vec::new();
        }
        let cell_of = |p: [f64; 3]| [0, 1, 2].map(|k| ((p[k] - low[k]) / cell) as u32);
        let (mut entries, mut wide) = (Vec::new(), Vec::new());
        for (face, place) in (0u32..).zip(&places) {
            let (from, to) = (cell_of(place.low), cell_of(place.high));
            let count: usize = (0..3).map(|k| (to[k] - from[k] + 1) as usize).product();
            if count > SPREAD {
                wide.push(face);
                continue;
            }
            for x in from[0]..=to[0] {
                for y in from[1]..=to[1] {
                    entries.extend((from[2]..=to[2]).map(|z| ([x, y, z], face)));
                }
            }
        }
        entries.par_sort_unstable();
        let cells: Vec<&[_]> = entries.chunk_by(|a, b| a.0 == b.0).collect();
        let cross = |a: u32, b: u32| {
            let (p, q) = (&places[a as usize], &places[b as usize]);
            (0..3).all(|k| p.low[k] <= q.high[k] && q.low[k] <= p.high[k])
                && crosses(
                    [a, b].map(|face| self.faces()[face as usize]),
                    [a, b].map(|face| triangles[face as usize]),
                )
        };
        let near = cells.par_iter().flat_map_iter(|faces| {
            let pairs = faces.iter().enumerate();
            let pairs = pairs.flat_map(|(k, a)| faces[k + 1..].iter().map(|b| [a.1, b.1]));
            pairs.filter(|&[a, b]| cross(a, b))
        });
        let count = places.len() as u32;
        let far = wide.par_iter().flat_map_iter(|&a| {
            (0..count).filter(move |&b| b != a && cross(a, b)).map(move |b| [a.min(b), a.max(b)])
        });
        let mut pairs: Vec<[u32; 2]> = near.chain(far).collect();
        pairs.par_sort_unstable();
        pairs.dedup();
        pairs
    }
}

/// Whether two triangles pass through each other, given by the numbers and the places of their corners.
fn crosses(numbers: [[u32; 3]; 2], [one, other]: [[[f64; 3]; 3]; 2]) -> bool {
    let shared = numbers[0].iter().filter(|v| numbers[1].contains(v)).count();
    if shared > 1 {
        return false;
    }
    let passes = |[edges, triangle]: [&[[f64; 3]; 3]; 2], [own, others]: [&[u32; 3]; 2]| {
        (0..3).any(|k| {
            let ends = [k, (k + 1) % 3];
            // An edge from a shared corner leaves the other triangle there.
            !ends.iter().any(|&end| others.contains(&own[end]))
                && pierces(ends.map(|end| edges[end]), triangle)
        })
    };
    passes([&one, &other], [&numbers[0], &numbers[1]])
        || passes([&other, &one], [&numbers[1], &numbers[0]])
}

/// Whether a segment passes through the inside of a triangle.
fn pierces([from, to]: [[f64; 3]; 2], &[a, b, c]: &[[f64; 3]; 3]) -> bool {
    if volume([a, b, c], from) * volume([a, b, c], to) >= 0.0 {
        return false;
    }
    let sides = [[a, b], [b, c], [c, a]].map(|[p, q]| volume([p, q, from], to));
    sides.iter().all(|&side| side > 0.0) || sides.iter().all(|&side| side < 0.0)
}

/// Six times the signed volume of a tetrahedron.
fn volume([a, b, c]: [[f64; 3]; 3], d: [f64; 3]) -> f64 {
    let [u, v, w] = [a, b, c].map(|p| difference(p, d));
    dot(u, cross(v, w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::icosphere;

    #[test]
    fn two_balls_cross_where_they_overlap_and_not_apart() {
        let ball = icosphere(3);
        let count = ball.positions().len() as u32;
        let pair = |by: f64| {
            let moved = ball.positions().iter().map(|p| [p[0] + by, p[1] + 0.01, p[2] + 0.003]);
            let places = ball.positions().iter().copied().chain(moved).collect();
            let faces = ball.faces().iter().copied();
            let second = ball.faces().iter().map(|face| face.map(|v| v + count));
            Mesh::new(places, faces.chain(second).collect()).unwrap()
        };
        assert!(pair(2.1).self_intersections().is_empty());
        let crossing = pair(1.0).self_intersections();
        // All pairs, by comparing everything with everything.
        let both = pair(1.0);
        let triangles: Vec<_> = both.triangles().collect();
        let mut all = Vec::new();
        for a in 0..triangles.len() {
            for b in a + 1..triangles.len() {
                let pair = [a, b];
                if crosses(pair.map(|k| both.faces()[k]), pair.map(|k| triangles[k])) {
                    all.push(pair.map(|k| k as u32));
                }
            }
        }
        assert!(crossing.len() > 50);
        assert_eq!(crossing, all);
    }

    #[test]
    fn flat_faces_folds_and_touching_corners_do_not_cross() {
        let places =
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.2, 0.2, 0.0]];
        let flat = Mesh::new(places, vec![[0, 1, 2], [1, 3, 2], [0, 4, 3], [0, 0, 1]]).unwrap();
        assert!(flat.self_intersections().is_empty());
        let point = Mesh::new(vec![[0.5; 3]; 3], vec![[0, 1, 2]]).unwrap();
        assert!(point.self_intersections().is_empty());
    }
}
