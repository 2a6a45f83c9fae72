//! An airplane: a long body with thin wings.

use crate::{
    Mesh,
    stroke::{Stroke, distance, rounded, smooth_min},
    surface_net::{Grid, surface_net},
};

/// An airliner that flies along -z, with y up.
///
/// One closed surface of about 3,400 triangles, counterclockwise from outside: 0.9 wide, 0.3 high and
/// 1 long, around the origin, so that it fits a camera at distance 2.732 with a field of view of 30 degrees.
/// Coordinates have five decimals, so that a file of it can be exact.
pub fn airplane() -> Mesh {
    let grid = Grid { low: [-0.5, -0.175, -0.55], step: 0.025, cubes: [40, 16, 44] };
    let (positions, faces) = surface_net(&grid, solid);
    Mesh::from_valid(positions.into_iter().map(|p| p.map(rounded)).collect(), faces)
}

/// Nose to wings, and on to the end of the tail.
const BODY: [Stroke; 3] = [
    ([0.0, -0.01, -0.44], 0.035, [0.0, 0.0, -0.34], 0.062),
    ([0.0, 0.0, -0.34], 0.062, [0.0, 0.0, 0.18], 0.065),
    ([0.0, 0.0, 0.18], 0.065, [0.0, 0.025, 0.46], 0.028),
];

/// Engine below the wing at +x; it is mirrored.
const ENGINE: Stroke = ([0.17, -0.062, -0.09], 0.038, [0.17, -0.058, 0.02], 0.032);

/// Ratio of depth to thickness of wings and fin.
const FLAT: f64 = 3.0;
/// Wing and stabiliser at +x before they are flattened along y; they are mirrored.
const WINGS: [Stroke; 2] = [
    ([0.03, -0.05, -0.06], 0.12, [0.40, 0.07, 0.15], 0.055),
    ([0.02, 0.09, 0.39], 0.07, [0.17, 0.15, 0.455], 0.042),
];
/// Fin before it is flattened along x.
const FIN: Stroke = ([0.0, 0.03, 0.36], 0.08, [0.0, 0.135, 0.45], 0.045);

/// Approximate signed distance to the airplane: negative inside, with smooth joints.
fn solid(p: [f64; 3]) -> f64 {
    const REACH: f64 = 0.03;
    let [x, y, z] = [p[0].abs(), p[1], p[2]];
    let body = BODY.iter().map(|stroke| distance(p, stroke));
    let wings = WINGS.iter().map(|stroke| distance([x, FLAT * y, z], stroke));
    let others = [distance([FLAT * x, y, z], &FIN), distance([x, y, z], &ENGINE)];
    body.chain(wings).chain(others).fold(f64::INFINITY, |a, b| smooth_min(a, b, REACH))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wings_are_wide_and_thin_and_the_fin_is_high_at_the_back() {
        let airplane = airplane();
        let [low, high] = airplane.bounds();
        assert!(low[0] < -0.42 && high[0] > 0.42 && low[2] < -0.45 && high[2] > 0.45);
        let of = |part: fn(&[f64; 3]) -> bool| -> Vec<[f64; 3]> {
            airplane.positions().iter().copied().filter(part).collect()
        };
        let tip = of(|p| p[0].abs() > 0.35);
        let (least, most) = tip
            .iter()
            .fold((f64::INFINITY, -f64::INFINITY), |(a, b), p| (a.min(p[1]), b.max(p[1])));
        assert!(!tip.is_empty() && most - least < 0.06, "{least} {most}");
        let top = of(|p| p[1] > 0.1);
        assert!(!top.is_empty() && top.iter().all(|p| p[2] > 0.3 && p[0].abs() < 0.05));
    }
}
