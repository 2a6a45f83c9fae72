//! A fox: a body with a clear front, back, top, left and right.

use crate::{
    Mesh,
    mesh::{difference, dot, norm},
    surface_net::{Grid, surface_net},
};

/// A standing fox that looks along -z, with y up.
///
/// One closed surface of about 2,900 triangles, counterclockwise from outside: 0.9 wide, 1.6 high and 2
/// long, around the origin. Seen by a camera at azimuth 0 it faces the viewer. Its tail
/// swings to +x and its head is turned there, so its left and right differ. Coordinates have five
/// decimals, so that a file of it can be exact.
pub fn fox() -> Mesh {
    let grid = Grid { low: [-0.47, -0.82, -1.08], step: 0.07, cubes: [16, 27, 31] };
    let (positions, faces) = surface_net(&grid, solid);
    let rounded = |x: f64| (x * 1e5).round() / 1e5 + 0.0;
    Mesh::from_valid(positions.into_iter().map(|p| p.map(rounded)).collect(), faces)
}

/// A tapered stroke with round ends: from a point and radius to a point and radius.
type Stroke = ([f64; 3], f64, [f64; 3], f64);

/// Parts in the middle or on one side.
const SINGLE: [Stroke; 10] = [
    // Chest to hips, and the neck.
    ([0.0, 0.10, -0.28], 0.27, [0.0, 0.11, 0.05], 0.22),
    ([0.0, 0.11, 0.05], 0.22, [0.0, 0.13, 0.36], 0.24),
    ([0.0, 0.18, -0.36], 0.20, [0.04, 0.46, -0.50], 0.15),
    // Head, and snout.
    ([0.04, 0.53, -0.52], 0.21, [0.07, 0.52, -0.59], 0.19),
    ([0.07, 0.49, -0.62], 0.15, [0.19, 0.42, -0.92], 0.055),
    // Ears, which turn with the head.
    ([0.18, 0.66, -0.48], 0.105, [0.27, 0.92, -0.45], 0.03),
    ([-0.07, 0.66, -0.54], 0.105, [-0.13, 0.92, -0.54], 0.03),
    // Tail: out to the side and up to its tip.
    ([0.0, 0.20, 0.48], 0.10, [0.16, 0.24, 0.70], 0.125),
    ([0.16, 0.24, 0.70], 0.125, [0.40, 0.44, 0.84], 0.15),
    ([0.40, 0.44, 0.84], 0.15, [0.52, 0.86, 0.84], 0.03),
];

/// Parts that come twice: here the one at +x.
const PAIRED: [Stroke; 6] = [
    // Front leg with its paw.
    ([0.15, 0.02, -0.32], 0.13, [0.16, -0.30, -0.32], 0.09),
    ([0.16, -0.30, -0.32], 0.09, [0.16, -0.62, -0.31], 0.075),
    ([0.16, -0.63, -0.33], 0.075, [0.16, -0.64, -0.41], 0.07),
    // Hind leg: thigh, shank and paw.
    ([0.15, 0.06, 0.36], 0.17, [0.17, -0.26, 0.33], 0.10),
    ([0.17, -0.26, 0.33], 0.10, [0.17, -0.62, 0.43], 0.075),
    ([0.17, -0.63, 0.42], 0.075, [0.17, -0.64, 0.33], 0.07),
];

/// Signed distance to the fox, roughly: negative inside, with smooth joints.
fn solid(p: [f64; 3]) -> f64 {
    let mirrored = [p[0].abs(), p[1], p[2]];
    let single = SINGLE.iter().map(|stroke| distance(p, stroke));
    let paired = PAIRED.iter().map(|stroke| distance(mirrored, stroke));
    single.chain(paired).fold(f64::INFINITY, joined)
}

/// Distance to a stroke whose radius changes evenly along it.
fn distance(p: [f64; 3], &(from, from_radius, to, to_radius): &Stroke) -> f64 {
    let (along, offset) = (difference(to, from), difference(p, from));
    let t = (dot(offset, along) / dot(along, along)).clamp(0.0, 1.0);
    let away = [0, 1, 2].map(|k| offset[k] - t * along[k]);
    norm(away) - (from_radius + t * (to_radius - from_radius))
}

/// The smaller of two distances, with the crease between them filled.
fn joined(a: f64, b: f64) -> f64 {
    const REACH: f64 = 0.06;
    let near = (REACH - (a - b).abs()).max(0.0);
    a.min(b) - near * near / (4.0 * REACH)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::{mesh::cross, write::Obj};

    #[test]
    fn committed_file_is_what_the_generator_makes() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/meshes/fox.obj");
        let text = std::fs::read_to_string(path).unwrap();
        assert_eq!(text, Obj(&fox()).to_string(), "run the example make_data");
        assert_eq!(Mesh::load(path).unwrap(), fox());
    }

    #[test]
    fn surface_is_closed_and_of_one_piece_without_handles() {
        let fox = fox();
        let sides = |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)];
        let edges: HashSet<_> = fox.faces().iter().flat_map(sides).collect();
        assert_eq!(edges.len(), 3 * fox.faces().len(), "an edge is used twice in one direction");
        assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "an edge is open");
        let euler = fox.positions().len() + fox.faces().len() - edges.len() / 2;
        assert_eq!(euler, 2);
    }

    #[test]
    fn faces_look_outward_and_few_are_slivers() {
        let fox = fox();
        let volume: f64 = fox.triangles().map(|[a, b, c]| dot(a, cross(b, c)) / 6.0).sum();
        assert!((0.3..0.5).contains(&volume), "volume {volume}");
        // 4 √3 area / (sum of squared sides) is 1 if equilateral, and 0 without area.
        let quality = |[a, b, c]: [[f64; 3]; 3]| {
            let [u, v, w] = [difference(b, a), difference(c, b), difference(a, c)];
            2.0 * 3f64.sqrt() * norm(cross(u, v)) / (dot(u, u) + dot(v, v) + dot(w, w))
        };
        let slivers = fox.triangles().filter(|&corners| quality(corners) < 0.4).count();
        assert!(100 * slivers < fox.faces().len(), "{slivers} slivers");
        assert!((1500..=3000).contains(&fox.faces().len()));
    }

    #[test]
    fn nose_is_in_front_tail_behind_ears_on_top_and_tail_at_plus_x() {
        let fox = fox();
        let extreme = |k: usize, sign: f64| {
            let by = |a: &&[f64; 3], b: &&[f64; 3]| (sign * a[k]).total_cmp(&(sign * b[k]));
            *fox.positions().iter().max_by(by).unwrap()
        };
        let [_, height, front] = extreme(2, -1.0);
        assert!(front < -0.9 && height > 0.3, "the nose is high in front");
        assert!(extreme(2, 1.0)[1] > 0.3 && extreme(0, 1.0)[2] > 0.7, "the tail is behind, at +x");
        assert!(extreme(1, 1.0)[2] < -0.4, "the ears are on top, in front");
        assert!(extreme(0, -1.0)[0] > -0.35, "nothing reaches as far to -x as the tail to +x");
    }
}
