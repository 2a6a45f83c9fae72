//! A surface cut into charts: connected parts that lie flat, each seen along one axis.

use std::collections::{HashMap, HashSet, VecDeque};

use softrast_mesh::{
    Mesh,
    vectors::{norm, normal},
};

/// Rounds in which normals are averaged with those of neighbours before an axis is chosen, so that roughness does not break charts.
const ROUNDS: usize = 8;
/// Least cosine between a face's own normal and its axis: below it, texels are stretched by more than 4.
const FACES: f64 = 0.25;
/// Charts of less than this part of the surface go to a neighbour where all their faces can be seen along its axis.
const SMALL: f64 = 1e-3;
/// Rounds in which small charts are given away.
const GIVEN: usize = 3;

/// Faces of one chart, and where their corners lie: to the right and down, in world units.
pub(super) struct Chart {
    pub(super) faces: Vec<usize>,
    pub(super) corners: Vec<[[f64; 2]; 3]>,
}

/// The charts of a mesh. Every face is in one, and no two faces of a chart cover the middle of the same square of `unit` × `unit`, in world units.
pub(super) fn charts(mesh: &Mesh, unit: f64) -> Vec<Chart> {
    let triangles: Vec<[[f64; 3]; 3]> = mesh.triangles().collect();
    let normals: Vec<[f64; 3]> = triangles.iter().copied().map(normal).collect();
    let beside = neighbours(mesh.faces());
    let mut axes = axes(&normals, &beside);
    let all: f64 = normals.iter().copied().map(norm).sum();
    for _ in 0..GIVEN {
        give_small(&mut axes, &normals, &beside, SMALL * all);
    }
    let mut charts = Vec::new();
    for part in parts(&axes, &beside) {
        let axis = axes[part[0]];
        let mut left = part;
        while !left.is_empty() {
            let flat = |&face: &usize| triangles[face].map(|p| along(axis, p));
            let (kept, other) = without_overlap(&left, &beside, flat, unit);
            charts.push(Chart { corners: kept.iter().map(flat).collect(), faces: kept });
            left = other;
        }
    }
    charts
}

/// The faces beyond the edges of each face, where no more than two share one.
fn neighbours(faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut sides: HashMap<[u32; 2], Vec<u32>> = HashMap::with_capacity(3 * faces.len() / 2);
    for (number, &[a, b, c]) in faces.iter().enumerate() {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            sides.entry([p.min(q), p.max(q)]).or_default().push(number as u32);
        }
    }
    let mut beside = vec![Vec::new(); faces.len()];
    for pair in sides.values() {
        if let [one, other] = pair[..] {
            beside[one as usize].push(other);
            beside[other as usize].push(one);
        }
    }
    // Maps have no order, charts do.
    beside.iter_mut().for_each(|of| of.sort_unstable());
    beside
}

/// The cosine of a normal to one of six axes: x, y and z, then their opposites. 1 for a face without an area, which lies flat along any.
fn cosine(normal: &[f64; 3], axis: u8) -> f64 {
    let (k, length) = (usize::from(axis % 3), norm(*normal));
    let towards = if axis < 3 { normal[k] } else { -normal[k] };
    if length > 0.0 { towards / length } else { 1.0 }
}

/// The axis along which each face is seen: that of the surface around it, if its own normal allows it.
fn axes(normals: &[[f64; 3]], beside: &[Vec<u32>]) -> Vec<u8> {
    let mut smooth = normals.to_vec();
    for _ in 0..ROUNDS {
        let sum = |face: usize| {
            beside[face].iter().fold(smooth[face], |sum, &other| {
                [0, 1, 2].map(|k| sum[k] + 0.5 * smooth[other as usize][k])
            })
        };
        smooth = (0..normals.len()).map(sum).collect();
    }
    let best = |of: &[f64; 3]| {
        (0..6u8).max_by(|&a, &b| cosine(of, a).total_cmp(&cosine(of, b))).unwrap_or(0)
    };
    let axis = |(own, around): (&[f64; 3], &[f64; 3])| {
        let axis = best(around);
        if cosine(own, axis) >= FACES { axis } else { best(own) }
    };
    normals.iter().zip(&smooth).map(axis).collect()
}

/// Connected faces of one axis, each part in the order in which it grows.
fn parts(axes: &[u8], beside: &[Vec<u32>]) -> Vec<Vec<usize>> {
    let mut seen = vec![false; axes.len()];
    let mut parts = Vec::new();
    for start in 0..axes.len() {
        if seen[start] {
            continue;
        }
        seen[start] = true;
        let (mut part, mut next) = (vec![start], 0);
        while let Some(&face) = part.get(next) {
            for &other in &beside[face] {
                let other = other as usize;
                if !seen[other] && axes[other] == axes[start] {
                    seen[other] = true;
                    part.push(other);
                }
            }
            next += 1;
        }
        parts.push(part);
    }
    parts
}

/// Gives parts of less than this area, doubled, the axis of a neighbour.
fn give_small(axes: &mut [u8], normals: &[[f64; 3]], beside: &[Vec<u32>], least: f64) {
    for part in parts(axes, beside) {
        if part.iter().map(|&face| norm(normals[face])).sum::<f64>() >= least {
            continue;
        }
        let own = axes[part[0]];
        let mut votes = [0; 6];
        let around = part.iter().flat_map(|&face| &beside[face]);
        around.for_each(|&other| votes[usize::from(axes[other as usize])] += 1);
        let fits = |&axis: &u8| {
            let seen = |&face: &usize| cosine(&normals[face], axis) >= FACES;
            axis != own && votes[usize::from(axis)] > 0 && part.iter().all(seen)
        };
        if let Some(axis) = (0..6).filter(fits).max_by_key(|&axis| votes[usize::from(axis)]) {
            part.iter().for_each(|&face| axes[face] = axis);
        }
    }
}

/// A point as it is seen along an axis from outside: to the right and down.
fn along(axis: u8, p: [f64; 3]) -> [f64; 2] {
    let k = usize::from(axis % 3);
    let (right, up) = (p[(k + 1) % 3], p[(k + 2) % 3]);
    if axis < 3 { [right, -up] } else { [-right, -up] }
}

/// A connected part of some faces that covers no square twice, grown from the first; and the others.
fn without_overlap(
    faces: &[usize],
    beside: &[Vec<u32>],
    flat: impl Fn(&usize) -> [[f64; 2]; 3],
    unit: f64,
) -> (Vec<usize>, Vec<usize>) {
    let mut waits: HashMap<usize, bool> = faces.iter().map(|&face| (face, true)).collect();
    let mut taken = HashSet::new();
    let (mut kept, mut other) = (Vec::new(), Vec::new());
    let mut grows = VecDeque::from([faces[0]]);
    waits.insert(faces[0], false);
    while let Some(face) = grows.pop_front() {
        let squares = squares(flat(&face).map(|p| p.map(|x| x / unit)));
        if squares.iter().any(|square| taken.contains(square)) {
            other.push(face);
            continue;
        }
        taken.extend(squares);
        kept.push(face);
        for &next in &beside[face] {
            if let Some(waits) = waits.get_mut(&(next as usize)).filter(|waits| **waits) {
                *waits = false;
                grows.push_back(next as usize);
            }
        }
    }
    // Faces that were not reached lie beyond an overlap.
    other.extend(faces.iter().filter(|face| waits[face]));
    (kept, other)
}

/// The squares whose middle a triangle covers.
fn squares(corners: [[f64; 2]; 3]) -> Vec<[i64; 2]> {
    let mut found = Vec::new();
    super::triangle::covered_texels(corners, |at, _| found.push(at));
    found
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;

    #[test]
    fn a_ball_has_six_charts_without_overlap_and_every_face_in_one() {
        let ball = icosphere(4);
        let charts = charts(&ball, 0.01);
        assert_eq!(charts.len(), 6);
        let mut faces: Vec<usize> = charts.iter().flat_map(|chart| chart.faces.clone()).collect();
        faces.sort_unstable();
        assert!(faces.into_iter().eq(0..ball.faces().len()));
        for chart in &charts {
            // Seen from outside: clockwise on a picture whose rows go down is counterclockwise in space.
            let area = |[a, b, c]: &[[f64; 2]; 3]| {
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            };
            assert!(chart.corners.iter().all(|corners| area(corners) < 0.0));
        }
    }

    #[test]
    fn a_spiral_that_comes_back_over_itself_is_split() {
        // A ramp that turns twice around the axis z, all of it seen from above.
        let turns = 2.0 * std::f64::consts::TAU;
        let (count, mut positions, mut faces) = (80u32, Vec::new(), Vec::new());
        for k in 0..=count {
            let (angle, z) = (turns * f64::from(k) / f64::from(count), 0.01 * f64::from(k));
            positions.extend([1.0, 2.0].map(|r| [r * angle.cos(), r * angle.sin(), z]));
        }
        for k in 0..count {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| 2 * k + i);
            faces.extend([[a, b, c], [b, d, c]]);
        }
        let mesh = Mesh::new(positions, faces).unwrap();
        let charts = charts(&mesh, 0.05);
        assert_eq!(charts.len(), 2);
        for chart in &charts {
            let mut all: Vec<[i64; 2]> = Vec::new();
            chart.corners.iter().for_each(|c| all.extend(squares(c.map(|p| p.map(|x| x / 0.05)))));
            let count = all.len();
            all.sort_unstable();
            all.dedup();
            assert_eq!(all.len(), count);
        }
    }

    #[test]
    fn faces_without_an_area_have_a_chart_too() {
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [1, 1, 2], [0, 0, 0]]).unwrap();
        let faces: usize = charts(&mesh, 0.1).iter().map(|chart| chart.faces.len()).sum();
        assert_eq!(faces, 3);
    }
}
