//! The classes of the procedural set, with their random shapes. All shapes have y up, look along -z
//! and are at most 0.96 long, wide and high, around the origin; no part is thinner than a cell of
//! [`Voxels`](crate::Voxels).

use rand::{Rng, rngs::StdRng};

use crate::solid::{Part, Solid};

/// The parts of a shape, at random.
type Draw = fn(&mut StdRng) -> Vec<Part>;

/// The classes: their names, and the functions that draw their shapes.
pub(crate) const KINDS: [(&str, Draw); 5] =
    [("airplane", airplane), ("car", car), ("chair", chair), ("lamp", lamp), ("table", table)];

/// A shape of a class.
pub(crate) fn solid(kind: usize, random: &mut StdRng) -> Solid {
    let parts = KINDS[kind].1(random);
    Solid { parts, colour: [(); 3].map(|()| random.random_range(0.35..1.0)) }
}

/// A part and its mirror image on the other side of the plane x = 0.
fn mirrored(part: impl Fn(f64) -> Part) -> [Part; 2] {
    [part(1.0), part(-1.0)]
}

fn airplane(random: &mut StdRng) -> Vec<Part> {
    let length = random.random_range(0.36..0.44);
    let body = random.random_range(0.045..0.075);
    let span = random.random_range(0.3..0.46);
    let sweep = random.random_range(0.0..0.2);
    let root = random.random_range(0.09..0.14);
    let wing_z = random.random_range(-0.1..0.05);
    let lift = random.random_range(0.0..0.06);
    let tail = random.random_range(0.12..0.2);
    let fin = random.random_range(0.1..0.18);
    let engines = random.random_range(0..3);
    let flat = [1.0, 2.5, 1.0];
    let wing = |side: f64| Part::Stroke {
        from: [0.0, -0.3 * body, wing_z],
        to: [side * (span - 0.05), lift, wing_z + sweep],
        radii: [root, 0.05],
        thinned: flat,
    };
    let stabiliser = |side: f64| Part::Stroke {
        from: [0.0, 0.02, length - 0.08],
        to: [side * tail, 0.04, length - 0.05],
        radii: [0.06, 0.045],
        thinned: flat,
    };
    let mut parts = vec![
        Part::stroke([0.0, -0.01, -length], [0.0, 0.0, -0.1], [0.6 * body, body]),
        Part::stroke([0.0, 0.0, -0.1], [0.0, 0.02, length], [body, 0.035]),
        Part::Stroke {
            from: [0.0, 0.02, length - 0.08],
            to: [0.0, fin, length - 0.03],
            radii: [0.07, 0.045],
            thinned: [2.5, 1.0, 1.0],
        },
    ];
    parts.extend(mirrored(wing));
    parts.extend(mirrored(stabiliser));
    for engine in 0..engines {
        let x = span * (0.32 + 0.28 * f64::from(engine));
        let z = wing_z + sweep * x / span - 0.06;
        let nacelle = |side: f64| {
            let [from, to] = [z - 0.06, z + 0.05].map(|z| [side * x, -0.045, z]);
            Part::stroke(from, to, [0.038, 0.032])
        };
        parts.extend(mirrored(nacelle));
    }
    parts
}

fn car(random: &mut StdRng) -> Vec<Part> {
    let half_length = random.random_range(0.36..0.47);
    let half_width = random.random_range(0.14..0.2);
    let floor = -random.random_range(0.1..0.13);
    let deck = random.random_range(0.0..0.06);
    let roof = deck + random.random_range(0.07..0.16);
    let cabin = half_length * random.random_range(0.35..0.75);
    // From a pick-up, with its cabin in front, to a hatchback.
    let cabin_z = (half_length - cabin) * random.random_range(-0.5..1.0);
    let wheel = random.random_range(0.06..0.085);
    let axle = half_length * random.random_range(0.55..0.68);
    let middle = f64::midpoint(floor, deck);
    let body = [half_width, (deck - floor) / 2.0, half_length];
    let high = (roof - deck) / 2.0 + 0.02;
    let mut parts = vec![
        Part::Block { centre: [0.0, middle, 0.0], half: body, rounding: 0.035 },
        Part::Block {
            centre: [0.0, roof - high, cabin_z],
            half: [0.88 * half_width, high, cabin],
            rounding: 0.03,
        },
    ];
    for z in [-axle, axle] {
        parts.extend(mirrored(|side| {
            let x = side * (half_width - 0.03);
            Part::Stroke {
                from: [x - 0.005, floor, z],
                to: [x + 0.005, floor, z],
                radii: [wheel; 2],
                thinned: [2.0, 1.0, 1.0],
            }
        }));
    }
    parts
}

fn chair(random: &mut StdRng) -> Vec<Part> {
    let half_width = random.random_range(0.17..0.26);
    let half_depth = random.random_range(0.17..0.25);
    let foot = -random.random_range(0.36..0.46);
    let seat = random.random_range(-0.12..0.02);
    let thick = random.random_range(0.025..0.05);
    let top = random.random_range(0.3..0.46);
    let leg = random.random_range(0.022..0.035);
    let lean = random.random_range(0.0..0.06);
    let back = random.random_range(0.8..1.0);
    let mut parts = vec![
        Part::block([0.0, seat, 0.0], [half_width, thick, half_depth]),
        Part::block(
            [0.0, f64::midpoint(seat, top), half_depth - 0.03 + lean / 2.0],
            [half_width * back, (top - seat) / 2.0, thick.max(0.03)],
        ),
    ];
    if random.random_bool(0.25) {
        // One leg in the middle, on a foot.
        parts.push(Part::Cone { centre: [0.0; 2], low: foot, high: seat, radii: [1.3 * leg; 2] });
        let high = foot + 0.05;
        parts.push(Part::Cone { centre: [0.0; 2], low: foot, high, radii: [0.8 * half_width; 2] });
    } else {
        for z in [leg - half_depth, half_depth - leg] {
            parts.extend(mirrored(|side| {
                let x = side * (half_width - leg);
                Part::stroke([x, seat, z], [1.05 * x, foot + leg, 1.05 * z], [leg; 2])
            }));
        }
    }
    if random.random_bool(0.4) {
        let rest = seat + random.random_range(0.12..0.2);
        parts.extend(mirrored(|side| {
            let x = side * (half_width - 0.02);
            Part::block(
                [x, f64::midpoint(seat, rest), 0.0],
                [0.03, (rest - seat) / 2.0, half_depth],
            )
        }));
    }
    parts
}

fn lamp(random: &mut StdRng) -> Vec<Part> {
    let foot = -random.random_range(0.38..0.47);
    let base = random.random_range(0.1..0.2);
    let base_top = foot + random.random_range(0.04..0.09);
    let pole = random.random_range(0.022..0.04);
    let top = random.random_range(0.36..0.47);
    let shade_low = top - random.random_range(0.18..0.34);
    let wide = random.random_range(0.14..0.28);
    let narrow = wide * random.random_range(0.35..1.0);
    let centre = [0.0; 2];
    let mut parts = vec![
        Part::Cone { centre, low: foot, high: base_top, radii: [base, 0.85 * base] },
        Part::Cone { centre, low: foot, high: shade_low + 0.02, radii: [pole; 2] },
        Part::Cone { centre, low: shade_low, high: top, radii: [wide, narrow] },
    ];
    if random.random_bool(0.4) {
        // A bulbous body above the foot.
        let radius = random.random_range(0.07..0.13);
        let y = base_top + 0.8 * radius;
        parts.push(Part::stroke([0.0, y, 0.0], [0.0, y + 0.04, 0.0], [radius, 0.7 * radius]));
    }
    parts
}

fn table(random: &mut StdRng) -> Vec<Part> {
    let half_width: f64 = random.random_range(0.28..0.47);
    let half_depth = random.random_range(0.18..0.34);
    let top = random.random_range(0.08..0.28);
    let foot = -top - random.random_range(0.0..0.12);
    let thick = random.random_range(0.02..0.045);
    let leg = random.random_range(0.022..0.045);
    let round = random.random_bool(0.3);
    let radius = half_width.min(0.42);
    let mut parts = if round {
        vec![Part::Cone { centre: [0.0; 2], low: top - 2.0 * thick, high: top, radii: [radius; 2] }]
    } else {
        vec![Part::block([0.0, top - thick, 0.0], [half_width, thick, half_depth])]
    };
    if random.random_bool(if round { 0.6 } else { 0.15 }) {
        parts.push(Part::Cone {
            centre: [0.0; 2],
            low: foot,
            high: top - thick,
            radii: [1.5 * leg; 2],
        });
        let high = foot + 0.045;
        parts.push(Part::Cone { centre: [0.0; 2], low: foot, high, radii: [0.55 * radius; 2] });
        return parts;
    }
    let (x, z) = if round { (0.62 * radius, 0.62 * radius) } else { (half_width, half_depth) };
    for z in [leg - z, z - leg] {
        parts.extend(mirrored(|side| {
            let centre = [side * (x - leg), f64::midpoint(foot, top - thick), z];
            Part::block(centre, [leg, (top - thick - foot) / 2.0, leg])
        }));
    }
    if !round && random.random_bool(0.3) {
        // A board between the legs.
        let y = foot + 0.3 * (top - foot);
        parts.push(Part::block([0.0, y, 0.0], [half_width - leg, 0.022, half_depth - leg]));
    }
    parts
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::Voxels;

    #[test]
    fn shapes_stay_in_their_cube_and_none_is_next_to_nothing() {
        for (kind, (name, _)) in KINDS.iter().enumerate() {
            for seed in 0..40 {
                let solid = solid(kind, &mut StdRng::seed_from_u64(seed));
                let inside = Voxels::of_solid(|p| solid.distance(p) < 0.0).count();
                assert!((150..16_000).contains(&inside), "{name} {seed}: {inside} cells");
                // There is nothing just outside the sides of the cube.
                for k in 0..3 {
                    for (u, v) in (0..20 * 20).map(|i| (i / 20, i % 20)) {
                        let [u, v] = [u, v].map(|i| f64::from(i) / 19.0 - 0.5);
                        for side in [-0.5, 0.5] {
                            let mut p = [u; 3];
                            p[(k + 1) % 3] = v;
                            p[k] = side;
                            assert!(solid.distance(p) > 0.0, "{name} {seed} reaches {p:?}");
                        }
                    }
                }
            }
        }
    }
}
