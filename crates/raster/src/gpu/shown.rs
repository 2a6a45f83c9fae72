//! The arithmetic of one pixel and one face in colour, as `kernel/blend/{point,depth,walk}.rs` have it.

use cubecl::prelude::*;

use super::{
    dual::{Dual, load},
    pair::{Closest, Cubic, Face, Lookup, Place},
    table::add_powers,
    texture::{Four, Sample},
};
use crate::kernel::blend::AREA;

/// [`AREA`] in the floats of kernels.
#[allow(clippy::cast_possible_truncation)]
const LEAST_AREA: f32 = AREA as f32;

/// How faces are weighted, and where the numbers that all pixels share stand: tables, then attributes, background and texture.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
pub(super) struct Weights {
    /// Cells of the edge softness, mirrored: the inner side is outside a face.
    pub(super) edge: Lookup,
    pub(super) depth: Lookup,
    /// Row where the table by depth begins.
    pub(super) depth_row: u32,
    /// Where attributes, background and texture begin.
    pub(super) attributes: u32,
    pub(super) background: u32,
    pub(super) texture: u32,
    /// Those of the texture.
    pub(super) rows: u32,
    pub(super) columns: u32,
    /// Attributes of a view that has its own.
    pub(super) per_view: u32,
    /// Where the derivatives of all these numbers begin in the direction.
    pub(super) along: u32,
    /// Depth of nearness 1, and one over the distance of the planes.
    pub(super) near: f32,
    pub(super) per_range: f32,
    /// What is taken off the edge softness, and the logarithm from which on it counts.
    pub(super) floor: f32,
    pub(super) counts_from: f32,
    /// Least weight by depth, of a line; of an exponential its logarithm.
    pub(super) least: f32,
}

/// What of the weighting is known when a kernel is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Kind {
    /// Whether tables have cells that are counted from their far ends.
    pub(super) far_edge: bool,
    pub(super) far_depth: bool,
    /// Whether weights by depth are a line or an exponential in place of a table.
    pub(super) is_line: bool,
    pub(super) is_exponential: bool,
    /// Whether attributes are places on a texture.
    pub(super) is_textured: bool,
    /// Channels of the image, but for the faces' share.
    pub(super) channels: usize,
    /// Whether the pass is of second order.
    pub(super) second: bool,
}

impl Kind {
    /// Numbers of an attribute.
    pub(super) fn numbers(self) -> usize {
        if self.is_textured { 2 } else { self.channels }
    }
}

/// A number for each corner of a face.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Corners {
    pub(super) a: Dual,
    pub(super) b: Dual,
    pub(super) c: Dual,
}

#[cube]
impl Corners {
    pub(super) fn mul(self, other: Corners) -> Corners {
        Corners { a: self.a.mul(other.a), b: self.b.mul(other.b), c: self.c.mul(other.c) }
    }

    pub(super) fn add(self, other: Corners) -> Corners {
        Corners { a: self.a.add(other.a), b: self.b.add(other.b), c: self.c.add(other.c) }
    }

    pub(super) fn times(self, factor: Dual) -> Corners {
        Corners { a: self.a.mul(factor), b: self.b.mul(factor), c: self.c.mul(factor) }
    }

    pub(super) fn less(self, number: Dual) -> Corners {
        Corners { a: self.a.sub(number), b: self.b.sub(number), c: self.c.sub(number) }
    }

    pub(super) fn sum(self) -> Dual {
        self.a.add(self.b).add(self.c)
    }

    fn select(condition: bool, yes: Corners, no: Corners) -> Corners {
        Corners {
            a: Dual::select(condition, yes.a, no.a),
            b: Dual::select(condition, yes.b, no.b),
            c: Dual::select(condition, yes.c, no.c),
        }
    }
}

/// A face with what its pairs share.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Shown {
    face: Face,
    /// One over the doubled area, signed; 0 for a face without an inside that counts.
    per_area: Dual,
    /// One over the depth of each corner.
    pub(super) per_depth: Corners,
    /// Where the attributes of its corners begin.
    entry_a: u32,
    entry_b: u32,
    entry_c: u32,
}

/// What a face is to a pixel.
#[derive(CubeType, Clone, Copy)]
pub(super) struct ColourPair {
    closest: Closest,
    /// 1 where the nearest point of the face is the pixel itself, else 0.
    within: f32,
    /// Barycentric weights of the closest point of the boundary, and of the nearest point of the face on the screen.
    boundary: Corners,
    pub(super) barycentric: Corners,
    pub(super) depth: Dual,
    /// Those of the nearest point on the face itself.
    pub(super) weights: Corners,
    /// Where the table by edges is read, the logarithm of the edge softness and its derivative by the squared distance.
    edge: Place,
    pub(super) log_edge: Dual,
    pub(super) edge_slope: Dual,
    /// The nearness less 1, the logarithm of the weight by depth and its derivative by the nearness.
    x: Dual,
    pub(super) log_depth: Dual,
    pub(super) depth_slope: Dual,
}

/// A logarithm of a weight by depth, and its derivative by the nearness.
#[derive(CubeType, Clone, Copy)]
struct ByDepth {
    log: Dual,
    slope: Dual,
}

/// What a pair shows of the objective: what it is at the point, and how it changes with the attributes of the three corners, were the point
/// there.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Seen {
    pub(super) here: Dual,
    pub(super) at_corners: Corners,
    /// Derivatives by the place on a texture, if there is one.
    pub(super) by_u: Dual,
    pub(super) by_v: Dual,
}

/// What a pair counts relative to a weight: all of it, and the part that the edge softness makes before its floor is taken off.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Share {
    pub(super) whole: Dual,
    pub(super) of_edge: Dual,
}

#[cube]
impl Shown {
    /// The face whose prepared numbers start at `first` in `corners`; `entries` `[faces, 3]` names the attributes at its corners.
    pub(super) fn new(
        corners: &Array<f32>,
        first: usize,
        entries: &Array<u32>,
        face: usize,
        first_attribute: u32,
        #[comptime] kind: Kind,
    ) -> Shown {
        let own = Face::new(corners, first, kind.second);
        let depths = first + comptime!(if kind.second { 12usize } else { 6usize });
        let per_depth = Corners {
            a: load(corners, depths, corners, depths + 3, kind.second).recip(),
            b: load(corners, depths + 1, corners, depths + 4, kind.second).recip(),
            c: load(corners, depths + 2, corners, depths + 5, kind.second).recip(),
        };
        let (one, other) = (own.first, own.second);
        let area = one.along_x.mul(other.along_y).sub(one.along_y.mul(other.along_x));
        let size = select(area.value < 0.0f32, -area.value, area.value);
        let some = size > LEAST_AREA;
        let divisor = Dual::select(some, area, Dual::constant(1.0f32));
        let per_area = Dual::select(some, divisor.recip(), Dual::constant(0.0f32));
        let numbers = comptime!(kind.numbers() as u32);
        Shown {
            face: own,
            per_area,
            per_depth,
            entry_a: first_attribute + entries[3 * face] * numbers,
            entry_b: first_attribute + entries[3 * face + 1] * numbers,
            entry_c: first_attribute + entries[3 * face + 2] * numbers,
        }
    }

    /// A number of the attributes at the three corners.
    pub(super) fn attribute(
        self,
        numbers: &Array<f32>,
        direction: &Array<f32>,
        along: u32,
        number: usize,
        #[comptime] second: bool,
    ) -> Corners {
        let a = self.entry_a as usize + number;
        let b = self.entry_b as usize + number;
        let c = self.entry_c as usize + number;
        let along = along as usize;
        Corners {
            a: load(numbers, a, direction, along + a, second),
            b: load(numbers, b, direction, along + b, second),
            c: load(numbers, c, direction, along + c, second),
        }
    }

    /// Where a pair sees the texture.
    pub(super) fn sample(
        self,
        pair: ColourPair,
        weights: Weights,
        numbers: &Array<f32>,
        direction: &Array<f32>,
        #[comptime] kind: Kind,
    ) -> Sample {
        let u = self.attribute(numbers, direction, weights.along, 0usize, kind.second);
        let v = self.attribute(numbers, direction, weights.along, 1usize, kind.second);
        Sample::at(pair.weights.mul(u).sum(), pair.weights.mul(v).sum(), weights)
    }

    /// What a pair shows under an upstream, the first channel of which stands at `first`.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn seen(
        self,
        pair: ColourPair,
        weights: Weights,
        numbers: &Array<f32>,
        direction: &Array<f32>,
        upstream: &Array<f32>,
        first: usize,
        plane: usize,
        #[comptime] kind: Kind,
    ) -> Seen {
        let zero = Dual::constant(0.0f32);
        if kind.is_textured {
            let sample = self.sample(pair, weights, numbers, direction, kind);
            // Kept in an array, as a loop changes no struct.
            let mut sums = Array::<f32>::new(8usize);
            for k in 0..8usize {
                sums[k] = 0.0f32;
            }
            for channel in 0..comptime!(kind.channels) {
                let u = upstream[first + channel * plane];
                let texels = sample.texels(numbers, direction, weights, channel, kind.second);
                Four::load(&sums).plus(u, texels).store(&mut sums);
            }
            let sums = Four::load(&sums);
            let (by_u, by_v) = (sample.by_u(sums, weights), sample.by_v(sums, weights));
            let u = self.attribute(numbers, direction, weights.along, 0usize, kind.second);
            let v = self.attribute(numbers, direction, weights.along, 1usize, kind.second);
            let at_corners = u.times(by_u).add(v.times(by_v));
            Seen { here: sample.between(sums), at_corners, by_u, by_v }
        } else {
            let mut sums = Array::<f32>::new(6usize);
            for k in 0..6usize {
                sums[k] = 0.0f32;
            }
            for channel in 0..comptime!(kind.channels) {
                let u = upstream[first + channel * plane];
                let values =
                    self.attribute(numbers, direction, weights.along, channel, kind.second);
                sums[0] = sums[0] + values.a.value * u;
                sums[1] = sums[1] + values.a.tangent * u;
                sums[2] = sums[2] + values.b.value * u;
                sums[3] = sums[3] + values.b.tangent * u;
                sums[4] = sums[4] + values.c.value * u;
                sums[5] = sums[5] + values.c.tangent * u;
            }
            let at_corners = Corners {
                a: Dual { value: sums[0], tangent: sums[1] },
                b: Dual { value: sums[2], tangent: sums[3] },
                c: Dual { value: sums[4], tangent: sums[5] },
            };
            let here = pair.weights.mul(at_corners).sum();
            Seen { here, at_corners, by_u: zero, by_v: zero }
        }
    }

    /// What it is to the pixel at `px`, `py` (NDC).
    pub(super) fn pair(
        self,
        px: f32,
        py: f32,
        weights: Weights,
        numbers: &Array<f32>,
        direction: &Array<f32>,
        #[comptime] kind: Kind,
    ) -> ColourPair {
        let closest = self.face.closest(px, py);
        let inside = closest.side >= 0.0f32 && self.face.orientation != 0.0f32;
        let within = inside && self.per_area.value != 0.0f32;
        let (zero, one) = (Dual::constant(0.0f32), Dual::constant(1.0f32));
        // Corner k starts edge k and ends edge k - 1.
        let (along, rest) = (closest.along, one.sub(closest.along));
        let (first, second, third) = (closest.edge == 0, closest.edge == 1, closest.edge == 2);
        let boundary = Corners {
            a: Dual::select(first, rest, Dual::select(third, along, zero)),
            b: Dual::select(second, rest, Dual::select(first, along, zero)),
            c: Dual::select(third, rest, Dual::select(second, along, zero)),
        };
        let own = Corners {
            a: self.face.second.area(px, py),
            b: self.face.third.area(px, py),
            c: self.face.first.area(px, py),
        };
        let barycentric = Corners::select(within, own.times(self.per_area), boundary);
        // 1 / z is what interpolates linearly on the screen.
        let parts = barycentric.mul(self.per_depth);
        let depth = parts.sum().recip();

        let place = weights.edge.place(closest.distance2, !inside, kind.far_edge);
        let cubic = Cubic::new(numbers, place.row, direction, weights.along, kind.second);
        let x = Dual::constant(weights.near).sub(depth).scale(weights.per_range);
        let by_depth = ByDepth::at(x, weights, numbers, direction, kind);
        ColourPair {
            closest,
            within: select(within, 1.0f32, 0.0f32),
            boundary,
            barycentric,
            depth,
            weights: parts.times(depth),
            edge: place,
            log_edge: zero.sub(place.value(cubic)),
            edge_slope: zero.sub(place.slope(cubic)),
            x,
            log_depth: by_depth.log,
            depth_slope: by_depth.slope,
        }
    }

    /// Gradient to x and y of a corner, of a function with these derivatives by the squared distance and by the barycentric weights; see
    /// `kernel/blend/point.rs`.
    pub(super) fn pulled(self, pair: ColourPair, by_distance2: Dual, by_weights: Corners) -> Moved {
        let zero = Dual::constant(0.0f32);
        let (w0, w1, w2) = (by_weights.a, by_weights.b, by_weights.c);
        let (e0, e1, e2) = (self.face.first, self.face.second, self.face.third);
        let closest = pair.closest;
        let within = pair.within > 0.5f32;
        let (first, second) = (closest.edge == 0, closest.edge == 1);
        // Of the pixel itself.
        let inner_x = zero
            .sub(w0.mul(e1.along_y).add(w1.mul(e2.along_y)).add(w2.mul(e0.along_y)))
            .mul(self.per_area);
        let inner_y =
            w0.mul(e1.along_x).add(w1.mul(e2.along_x)).add(w2.mul(e0.along_x)).mul(self.per_area);
        // Of a point of an edge that is not held at one of its ends.
        let slide = Dual::select(first, w1.sub(w0), Dual::select(second, w2.sub(w1), w0.sub(w2)));
        let edge_x = Dual::select(first, e0.along_x, Dual::select(second, e1.along_x, e2.along_x));
        let edge_y = Dual::select(first, e0.along_y, Dual::select(second, e1.along_y, e2.along_y));
        let inverse = Dual::select(first, e0.inverse, Dual::select(second, e1.inverse, e2.inverse));
        let free = closest.along.value > 0.0f32 && closest.along.value < 1.0f32 && !within;
        let slide = Dual::select(free, slide, zero).mul(inverse);
        Moved {
            field_x: Dual::select(within, inner_x, slide.mul(edge_x)),
            field_y: Dual::select(within, inner_y, slide.mul(edge_y)),
            across_x: slide.mul(closest.dx),
            across_y: slide.mul(closest.dy),
            pull_x: by_distance2.scale(-2.0f32).mul(closest.dx),
            pull_y: by_distance2.scale(-2.0f32).mul(closest.dy),
        }
    }
}

/// What moves the corners of a face at a pair.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Moved {
    field_x: Dual,
    field_y: Dual,
    across_x: Dual,
    across_y: Dual,
    pull_x: Dual,
    pull_y: Dual,
}

#[cube]
impl Moved {
    /// The gradient to x of the corners.
    pub(super) fn x(self, pair: ColourPair) -> Corners {
        corners(pair, self.pull_x, self.field_x, self.across_x)
    }

    /// The gradient to y of the corners.
    pub(super) fn y(self, pair: ColourPair) -> Corners {
        corners(pair, self.pull_y, self.field_y, self.across_y)
    }
}

/// The gradient to the corners along an axis. What is across pushes the first corner of the closest edge back and its second one on.
#[cube]
fn corners(pair: ColourPair, pull: Dual, field: Dual, across: Dual) -> Corners {
    let zero = Dual::constant(0.0f32);
    let edge = pair.closest.edge;
    let back = zero.sub(across);
    let turned = Corners {
        a: Dual::select(edge == 0, back, Dual::select(edge == 2, across, zero)),
        b: Dual::select(edge == 1, back, Dual::select(edge == 0, across, zero)),
        c: Dual::select(edge == 2, back, Dual::select(edge == 1, across, zero)),
    };
    let (at, own) = (pair.boundary, pair.barycentric);
    Corners {
        a: pull.mul(at.a).sub(field.mul(own.a)).add(turned.a),
        b: pull.mul(at.b).sub(field.mul(own.b)).add(turned.b),
        c: pull.mul(at.c).sub(field.mul(own.c)).add(turned.c),
    }
}

#[cube]
impl ByDepth {
    /// What a point at `x`, its nearness less 1, counts.
    fn at(
        x: Dual,
        weights: Weights,
        numbers: &Array<f32>,
        direction: &Array<f32>,
        #[comptime] kind: Kind,
    ) -> ByDepth {
        let zero = Dual::constant(0.0f32);
        if kind.is_line {
            let at = 4 * weights.depth_row as usize;
            let along = weights.along as usize + at;
            let nearness = x.add(Dual::constant(1.0f32));
            let a = load(numbers, at, direction, along, kind.second);
            let c = load(numbers, at + 1, direction, along + 1, kind.second);
            let slope = Dual::select(nearness.value > 0.0f32, a, zero.sub(c));
            let weight = slope.mul(nearness);
            let some = weight.value > weights.least;
            let held = Dual::select(some, weight, Dual::constant(weights.least));
            let per_weight = Dual::select(some, held.recip(), zero);
            ByDepth { log: held.ln(), slope: slope.mul(per_weight) }
        } else if kind.is_exponential {
            let at = 4 * weights.depth_row as usize;
            let along = weights.along as usize + at;
            let slope = load(numbers, at, direction, along, kind.second);
            let log = slope.mul(x).add(load(numbers, at + 1, direction, along + 1, kind.second));
            let (above, below) = (log.value > weights.least, log.value < 0.0f32);
            let log = Dual::select(above, log, Dual::constant(weights.least));
            ByDepth {
                log: Dual::select(below, log, zero),
                slope: Dual::select(above && below, slope, zero),
            }
        } else {
            let place = weights.depth.place(x.mul(x), x.value <= 0.0f32, kind.far_depth);
            let row = weights.depth_row + place.row;
            let cubic = Cubic::new(numbers, row, direction, weights.along, kind.second);
            let slope = place.slope(cubic).mul(x.scale(-2.0f32));
            ByDepth { log: zero.sub(place.value(cubic)), slope }
        }
    }
}

#[cube]
impl ColourPair {
    /// Adds to the gradient of both tables, which begins at `own`, of a function with these derivatives by the logarithms of the weights.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn pull_tables(
        self,
        by_edge: Dual,
        by_depth: Dual,
        weights: Weights,
        numbers: &Array<f32>,
        direction: &Array<f32>,
        partial: &mut Array<f32>,
        own: u32,
        #[comptime] kind: Kind,
    ) {
        let zero = Dual::constant(0.0f32);
        let edge = self.edge;
        add_powers(partial, own + 4u32 * edge.row, edge.place, zero.sub(by_edge), kind.second);
        let first = own + 4u32 * weights.depth_row;
        if kind.is_line || kind.is_exponential {
            let at = 4 * weights.depth_row as usize;
            let along = weights.along as usize + at;
            let a = load(numbers, at, direction, along, kind.second);
            let c = load(numbers, at + 1, direction, along + 1, kind.second);
            let (by_a, by_c) = if kind.is_line {
                let nearness = self.x.add(Dual::constant(1.0f32));
                let near = nearness.value > 0.0f32;
                let weight = Dual::select(near, a, zero.sub(c)).mul(nearness);
                let some = weight.value > weights.least;
                let held = Dual::select(some, weight, Dual::constant(1.0f32));
                let by_slope = Dual::select(some, by_depth.mul(nearness).mul(held.recip()), zero);
                (Dual::select(near, by_slope, zero), Dual::select(near, zero, zero.sub(by_slope)))
            } else {
                let log = a.mul(self.x).add(c).value;
                let by_log = Dual::select(log > weights.least && log < 0.0f32, by_depth, zero);
                (by_log.mul(self.x), by_log)
            };
            let first = first as usize;
            partial[first] = partial[first] + by_a.stored(kind.second);
            partial[first + 1] = partial[first + 1] + by_c.stored(kind.second);
        } else {
            let x = self.x;
            let place = weights.depth.place(x.mul(x), x.value <= 0.0f32, kind.far_depth);
            add_powers(
                partial,
                first + 4u32 * place.row,
                place.place,
                zero.sub(by_depth),
                kind.second,
            );
        }
    }

    /// Whether it counts at all, and is above the floor by more than rounding leaves.
    pub(super) fn counts(self, weights: Weights) -> bool {
        self.log_edge.value > weights.counts_from
    }

    /// What it counts relative to a weight with this logarithm.
    pub(super) fn share(self, relative: Dual, weights: Weights) -> Share {
        let by_depth = self.log_depth.sub(relative);
        let whole = self.log_edge.add(by_depth).exp();
        let rest = 1.0f32 / (1.0f32 - weights.floor);
        // Far from the pixel, a near face without its edge may be beyond the range of floats; it does not count.
        let floor = by_depth.exp().scale(weights.floor);
        let has_floor = weights.floor > 0.0f32;
        let less = Dual::select(has_floor, whole.sub(floor).scale(rest), whole);
        Share { whole: less, of_edge: whole.scale(rest) }
    }
}
