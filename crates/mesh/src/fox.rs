//! A fox: a body with a clear front, back, top, left and right.

use crate::{
    Mesh,
    stroke::{Stroke, distance, rounded, smooth_min},
    surface_net::{Grid, surface_net},
    vectors::{difference, norm},
};

/// A standing fox that faces -z, with y up.
///
/// One closed surface of about 2,900 triangles, counterclockwise from outside: 0.9 wide, 1.6 high and 2
/// long, around the origin. It faces a camera at azimuth 0. Its tail and its head are turned to +x, so its left and right differ.
/// Coordinates have five decimals, so that a file of it can be exact.
pub fn fox() -> Mesh {
    let grid = Grid { low: [-0.47, -0.82, -1.08], step: 0.07, cubes: [16, 27, 31] };
    let (positions, faces) = surface_net(&grid, solid);
    Mesh::from_valid(positions.into_iter().map(|p| p.map(rounded)).collect(), faces)
}

/// The fox in colours that distinguish its sides: orange, with a white chest, belly and tail tip, and dark legs, ears, eyes and nose.
pub fn painted_fox() -> Mesh {
    let fox = fox();
    let colours = fox.positions().iter().map(|&p| coat(p)).collect();
    fox.painted(colours)
}

const ORANGE: [f64; 3] = [0.85, 0.42, 0.12];
const RUST: [f64; 3] = [0.55, 0.22, 0.07];
const WHITE: [f64; 3] = [0.95, 0.93, 0.88];
const DARK: [f64; 3] = [0.14, 0.10, 0.09];

/// Balls of dark fur: the nose and both eyes.
const SPOTS: [([f64; 3], f64); 3] =
    [([0.19, 0.42, -0.92], 0.075), ([0.21, 0.59, -0.65], 0.06), ([0.0, 0.59, -0.73], 0.06)];

/// The colour of the fur at a point of the surface.
fn coat(p: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = p;
    let spot = SPOTS.iter().any(|&(middle, radius)| norm(difference(p, middle)) < radius);
    let (head, tail) = (z < -0.4 && y > 0.34, x > 0.1 && z > 0.6);
    if spot || (head && y > 0.76) || (!tail && y < -0.24) {
        return DARK;
    }
    let (tip, muzzle) = (tail && y > 0.6, head && z < -0.62 && y < 0.46);
    let (chest, belly) = (!head && z < -0.46, !tail && y < -0.06 && x.abs() < 0.16);
    if tip || muzzle || chest || belly {
        return WHITE;
    }
    // Darker along the back.
    let back = ((y - 0.2) / 0.15).clamp(0.0, 1.0) * f64::from(u8::from(!head && !tail && z > -0.3));
    [0, 1, 2].map(|k| ORANGE[k] + back * (RUST[k] - ORANGE[k]))
}

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

/// Parts that are mirrored: here the one at +x.
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

/// Approximate signed distance to the fox: negative inside, with smooth joints.
fn solid(p: [f64; 3]) -> f64 {
    const REACH: f64 = 0.06;
    let mirrored = [p[0].abs(), p[1], p[2]];
    let single = SINGLE.iter().map(|stroke| distance(p, stroke));
    let paired = PAIRED.iter().map(|stroke| distance(mirrored, stroke));
    single.chain(paired).fold(f64::INFINITY, |a, b| smooth_min(a, b, REACH))
}

#[cfg(test)]
mod tests {
    use super::*;

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
