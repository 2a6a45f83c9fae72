use super::{
    SIGNS,
    knots::{EVERYWHERE, NARROWEST},
};

/// Distances, in constant ratio, at which a side is sampled to find where it starts to change, and the number by which each refinement
/// divides the interval between two of them.
const COARSE: usize = 1024;
const FINE: usize = 128;
const REFINEMENTS: usize = 4;

/// Distance from the edge up to which a curve is `settled` on each side, outer and inner, at most its radius. `settled` compares its value
/// at the edge with that at a distance.
pub(crate) fn settled_until(
    curve: impl Fn(&[f64]) -> Vec<f64>,
    radii: [f64; 2],
    settled: impl Fn(f64, f64) -> bool,
) -> [f64; 2] {
    [0, 1].map(|side| {
        let [mut near, mut far] = [NARROWEST, radii[side].clamp(2.0 * NARROWEST, EVERYWHERE)];
        let edge = curve(&[SIGNS[side] * 1e-15])[0];
        for count in std::iter::once(COARSE).chain([FINE; REFINEMENTS]) {
            let ratio = (far / near).ln() / (count - 1) as f64;
            let places: Vec<f64> = (0..count).map(|k| near * (ratio * k as f64).exp()).collect();
            let signed: Vec<f64> = places.iter().map(|r| SIGNS[side] * r).collect();
            match curve(&signed).iter().position(|&q| !settled(edge, q)) {
                Some(first @ 1..) => [near, far] = [places[first - 1], places[first]],
                // A position that moved only by rounding.
                _ if count == FINE => return near,
                _ => return 0.0,
            }
        }
        near
    })
}
