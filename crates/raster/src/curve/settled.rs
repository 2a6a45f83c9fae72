use super::{
    SIGNS,
    knots::{EVERYWHERE, NARROWEST},
};

/// Distances at which a side is looked at for where it begins to change, in constant ratio, and those by which each refinement divides
/// what lies between two of them.
const COARSE: usize = 1024;
const FINE: usize = 128;
const REFINEMENTS: usize = 4;

/// How far from the edge a curve is `settled` on each side, outer and inner, up to its radius: that is asked of its value at the edge and
/// of that at a place.
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
                // Only a place that rounding has moved.
                _ if count == FINE => return near,
                _ => return 0.0,
            }
        }
        near
    })
}
