//! Separates faces of a mesh that pass through each other.

use std::collections::BTreeMap;

use crate::{
    Mesh,
    vectors::{difference, norm, normal},
};

/// Most rounds of moves.
const ROUNDS: usize = 10;
/// Vertices that move are at most so many edges away from crossing faces.
const RINGS: usize = 3;
/// A move along the normal, relative to the mean length of the edges at a vertex.
const STEP: f64 = 0.3;

/// How the vertices around a crossing move.
#[derive(Clone, Copy)]
enum Move {
    /// To the mean of their neighbours.
    Mean,
    /// Along their normals, by a multiple of the mean length of their edges.
    Along(f64),
}

const MOVES: [Move; 3] = [Move::Mean, Move::Along(-STEP), Move::Along(STEP)];

impl Mesh {
    /// The mesh with faces that pass through each other separated as far as possible, for a closed surface. Vertices around each crossing move to the mean of
    /// their neighbours, or along their normals inwards or outwards, whichever leaves the fewest crossings there; if none leaves fewer, they stay. See
    /// [`Mesh::self_intersections`].
    #[must_use]
    pub fn without_self_intersections(mut self) -> Self {
        let mut crossing = self.self_intersections();
        if crossing.is_empty() {
            return self;
        }
        let neighbours = neighbours_of(self.faces(), self.positions().len());
        let mut rings = 0;
        for _ in 0..ROUNDS {
            let labels = labels(&self, &crossing, &neighbours, rings);
            let before = counts(&self, &crossing, &labels);
            let tried = MOVES.map(|how| {
                let mesh = moved(&self, &neighbours, |v| labels[v].map(|_| how));
                counts(&mesh, &mesh.self_intersections(), &labels)
            });
            let of =
                |counts: &BTreeMap<usize, usize>, label| counts.get(&label).copied().unwrap_or(0);
            let best = |label: usize| {
                let least = (0..MOVES.len()).min_by_key(|&k| of(&tried[k], label))?;
                (of(&tried[least], label) < of(&before, label)).then_some(MOVES[least])
            };
            let chosen: BTreeMap<usize, Option<Move>> =
                before.keys().map(|&label| (label, best(label))).collect();
            let next = moved(&self, &neighbours, |v| *chosen.get(&labels[v]?)?);
            let after = next.self_intersections();
            if after.len() < crossing.len() {
                (self, crossing) = (next, after);
            } else if rings < RINGS {
                rings += 1;
            } else {
                break;
            }
            if crossing.is_empty() {
                break;
            }
        }
        self
    }
}

/// For each vertex near a crossing, the crossing that it belongs to.
fn labels(
    mesh: &Mesh,
    crossing: &[[u32; 2]],
    neighbours: &[Vec<u32>],
    rings: usize,
) -> Vec<Option<usize>> {
    let mut near = vec![false; neighbours.len()];
    for &face in crossing.as_flattened() {
        mesh.faces()[face as usize].iter().for_each(|&v| near[v as usize] = true);
    }
    for _ in 0..rings {
        let before = near.clone();
        for (near, around) in near.iter_mut().zip(neighbours) {
            *near |= around.iter().any(|&n| before[n as usize]);
        }
    }
    // Both faces of a pair belong to one crossing, and so do all vertices near them that edges connect.
    let mut partner: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &[a, b] in crossing {
        let (a, b) = (mesh.faces()[a as usize][0], mesh.faces()[b as usize][0]);
        partner.entry(a).or_default().push(b);
        partner.entry(b).or_default().push(a);
    }
    let mut labels = vec![None; neighbours.len()];
    for start in 0..neighbours.len() {
        let mut left = if near[start] && labels[start].is_none() { vec![start] } else { vec![] };
        while let Some(v) = left.pop() {
            if labels[v].replace(start).is_none() {
                let others = partner.get(&(v as u32)).into_iter().flatten();
                let all = neighbours[v].iter().chain(others).map(|&n| n as usize);
                left.extend(all.filter(|&n| near[n] && labels[n].is_none()));
            }
        }
    }
    labels
}

/// Pairs of crossing faces of each crossing.
fn counts(mesh: &Mesh, pairs: &[[u32; 2]], labels: &[Option<usize>]) -> BTreeMap<usize, usize> {
    let mut counts = BTreeMap::new();
    for pair in pairs {
        let corners = pair.iter().flat_map(|&face| mesh.faces()[face as usize]);
        let mut of: Vec<usize> = corners.filter_map(|v| labels[v as usize]).collect();
        of.sort_unstable();
        of.dedup();
        of.into_iter().for_each(|label| *counts.entry(label).or_insert(0) += 1);
    }
    counts
}

/// The mesh with some vertices moved.
fn moved(mesh: &Mesh, neighbours: &[Vec<u32>], how: impl Fn(usize) -> Option<Move>) -> Mesh {
    let before = mesh.positions();
    let mut normals: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
    for (face, triangle) in mesh.faces().iter().zip(mesh.triangles()) {
        for v in
            face.iter().map(|&v| v as usize).filter(|&v| matches!(how(v), Some(Move::Along(_))))
        {
            let n = normal(triangle);
            let sum = normals.entry(v).or_default();
            (0..3).for_each(|k| sum[k] += n[k]);
        }
    }
    let place = |v: usize| {
        let (here, around) = (before[v], &neighbours[v]);
        let count = around.len() as f64;
        match how(v) {
            _ if around.is_empty() => here,
            None => here,
            Some(Move::Mean) => [0, 1, 2]
                .map(|k| around.iter().map(|&n| before[n as usize][k]).sum::<f64>() / count),
            Some(Move::Along(step)) => {
                let edge = |&n: &u32| norm(difference(before[n as usize], here));
                let normal = normals.get(&v).copied().unwrap_or_default();
                let by = step * around.iter().map(edge).sum::<f64>() / count;
                let by = by / norm(normal).max(f64::MIN_POSITIVE);
                [0, 1, 2].map(|k| here[k] + by * normal[k])
            }
        }
    };
    let places = (0..before.len()).map(place).collect();
    mesh.with_positions(places).expect("finite positions")
}

/// Vertices that share an edge with each; none is its own.
fn neighbours_of(faces: &[[u32; 3]], vertices: usize) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); vertices];
    for &[a, b, c] in faces {
        for (from, to) in [(a, b), (b, c), (c, a), (b, a), (c, b), (a, c)] {
            if from != to && !neighbours[from as usize].contains(&to) {
                neighbours[from as usize].push(to);
            }
        }
    }
    neighbours
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::icosphere;

    #[test]
    fn a_vertex_that_is_pulled_through_the_surface_comes_back() {
        let ball = icosphere(3);
        let mut places = ball.positions().to_vec();
        places[5] = places[5].map(|x| -1.2 * x);
        let tangled = ball.with_positions(places).unwrap();
        assert!(!tangled.self_intersections().is_empty());
        let free = tangled.clone().without_self_intersections();
        assert!(free.self_intersections().is_empty());
        let moved = free.positions().iter().zip(tangled.positions()).filter(|(a, b)| a != b);
        assert!(moved.count() < 200);
    }

    #[test]
    fn limbs_that_overlap_and_a_plate_turned_inside_out_are_separated() {
        let ball = icosphere(3);
        // The north pole is pressed a little through the south pole, and two arms into each other.
        let bent = |&[x, y, z]: &[f64; 3]| {
            let near = (-((x - 0.03).powi(2) + (y - 0.02).powi(2)) / 0.4).exp();
            [x, y, if z > 0.0 { z - 2.1 * near } else { z }]
        };
        let plate = ball.with_positions(ball.positions().iter().map(bent).collect()).unwrap();
        assert!(plate.self_intersections().len() > 5);
        assert!(plate.without_self_intersections().self_intersections().is_empty());
        let count = ball.positions().len() as u32;
        let moved = ball.positions().iter().map(|p| [p[0] + 1.97, p[1] + 0.01, p[2] + 0.003]);
        let places = ball.positions().iter().copied().chain(moved).collect();
        let second = ball.faces().iter().map(|face| face.map(|v| v + count));
        let faces = ball.faces().iter().copied().chain(second).collect();
        let limbs = Mesh::new(places, faces).unwrap();
        assert!(limbs.self_intersections().len() > 5);
        assert!(limbs.without_self_intersections().self_intersections().is_empty());
    }
}
