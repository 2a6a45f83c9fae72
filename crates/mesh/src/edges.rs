//! Adjacency of vertices and faces.

use std::collections::BTreeMap;

/// The edges of some faces, for losses that keep a surface smooth.
///
/// ```
/// use softrast_mesh::Edges;
///
/// let edges = Edges::new(&[[0, 1, 2], [2, 1, 3]]);
/// assert_eq!(edges.ends, [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]);
/// assert_eq!(edges.hinges, [[1, 2, 0, 3]]);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edges {
    /// Both ends of every edge, the lower number first, in order.
    pub ends: Vec<[u32; 2]>,
    /// Two faces and the edge between them: both ends, then the opposite corner of either face. Edges of one face, or of more than two, are
    /// excluded.
    pub hinges: Vec<[u32; 4]>,
}

impl Edges {
    /// The edges of `faces`; those from a vertex to itself are excluded.
    pub fn new(faces: &[[u32; 3]]) -> Self {
        let mut beyond: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        for &[a, b, c] in faces {
            for (from, to, corner) in [(a, b, c), (b, c, a), (c, a, b)] {
                if from != to {
                    beyond.entry([from.min(to), from.max(to)]).or_default().push(corner);
                }
            }
        }
        let hinges = beyond.iter().filter_map(|(&[from, to], corners)| match corners[..] {
            [one, other] => Some([from, to, one, other]),
            _ => None,
        });
        Self { hinges: hinges.collect(), ends: beyond.into_keys().collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::icosphere;

    #[test]
    fn two_triangles_share_one_edge() {
        let edges = Edges::new(&[[0, 1, 2], [2, 1, 3]]);
        assert_eq!(edges.ends, [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]);
        assert_eq!(edges.hinges, [[1, 2, 0, 3]]);
    }

    #[test]
    fn every_edge_of_a_sphere_is_a_hinge() {
        // A closed triangle mesh has 3 F / 2 edges: 1920 for 1280 faces.
        let edges = Edges::new(icosphere(3).faces());
        assert_eq!((edges.ends.len(), edges.hinges.len()), (1920, 1920));
    }

    #[test]
    fn an_edge_of_three_faces_is_no_hinge() {
        assert!(Edges::new(&[[0, 1, 2], [0, 1, 3], [0, 1, 4]]).hinges.is_empty());
        assert!(Edges::new(&[[5, 5, 5]]).ends.is_empty());
    }
}
