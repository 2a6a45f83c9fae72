//! A chair: plates and thin legs with space between them.

use crate::{
    Mesh,
    stroke::{Stroke, distance, rounded, smooth_min},
    surface_net::{Grid, surface_net},
    vectors::norm,
};

/// A chair that faces -z, with y up.
///
/// One closed surface of about 3,800 triangles, counterclockwise from outside: 0.55 wide and deep and 0.95 high,
/// around the origin, so that it fits a camera at distance 2.732 with a field of view of 30 degrees.
/// Coordinates have five decimals, so that a file of it can be exact.
pub fn chair() -> Mesh {
    let grid = Grid { low: [-0.36, -0.54, -0.36], step: 0.03, cubes: [24, 36, 24] };
    let (positions, faces) = surface_net(&grid, solid);
    Mesh::from_valid(positions.into_iter().map(|p| p.map(rounded)).collect(), faces)
}

/// Leg at +x and +z; there are four.
const LEG: Stroke = ([0.2, -0.08, 0.2], 0.045, [0.22, -0.42, 0.22], 0.036);

/// A plate with round edges: centre, half its extents before rounding.
type Plate = ([f64; 3], [f64; 3]);
const ROUNDING: f64 = 0.035;
const PLATES: [Plate; 2] = [
    // Seat, and back.
    ([0.0, -0.05, 0.0], [0.21, 0.005, 0.21]),
    ([0.0, 0.2, 0.22], [0.2, 0.22, 0.005]),
];

/// Approximate signed distance to the chair: negative inside, with smooth joints.
fn solid(p: [f64; 3]) -> f64 {
    const REACH: f64 = 0.04;
    let leg = distance([p[0].abs(), p[1], p[2].abs()], &LEG);
    let plates = PLATES.iter().map(|plate| plate_distance(p, plate));
    plates.fold(leg, |a, b| smooth_min(a, b, REACH))
}

fn plate_distance(p: [f64; 3], (centre, half): &Plate) -> f64 {
    let beyond = [0, 1, 2].map(|k| (p[k] - centre[k]).abs() - half[k]);
    let inside = beyond.into_iter().fold(f64::NEG_INFINITY, f64::max).min(0.0);
    norm(beyond.map(|x| x.max(0.0))) + inside - ROUNDING
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_are_below_with_air_between_and_the_back_is_behind() {
        let chair = chair();
        let foot = |p: &&[f64; 3]| p[1] < -0.3;
        assert!(chair.positions().iter().filter(foot).count() > 50);
        assert!(chair.positions().iter().filter(foot).all(|p| p[0].abs() > 0.1));
        let upper = |p: &&[f64; 3]| p[1] > 0.1;
        assert!(chair.positions().iter().filter(upper).all(|p| p[2] > 0.15));
    }
}
