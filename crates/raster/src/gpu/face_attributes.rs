//! The arithmetic of one pixel and one face in colour, as in `blend/{point,walk}.rs` of `kernel`.

use cubecl::prelude::*;

use super::{
    blend_inputs::{BlendInputs, BlendParams, BlendSpec},
    depth::{ByDepth, pull_depth},
    dual::{Dual, load},
    pair::{Closest, Face, Pull, TablePosition},
    table::add_powers,
    texture::{Four, Sample},
};
use softrast_kernel::blend::AREA;

/// [`AREA`] as an f32.
#[allow(clippy::cast_possible_truncation)]
const LEAST_AREA: f32 = AREA as f32;

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

/// A face with the numbers shared by its pairs.
#[derive(CubeType, Clone, Copy)]
pub(super) struct FaceAttributes {
    face: Face,
    /// One over the doubled area, signed; 0 for a face whose area is too small to divide by.
    per_area: Dual,
    /// One over the depth of each corner.
    pub(super) per_depth: Corners,
    /// Start of the attributes of its corners.
    entry_a: u32,
    entry_b: u32,
    entry_c: u32,
}

/// A face at a pixel.
#[derive(CubeType, Clone, Copy)]
pub(super) struct ColourPair {
    closest: Closest,
    /// 1 where the nearest point of the face is the pixel itself, else 0.
    within: f32,
    /// Barycentric weights of the closest point of the boundary, and of the nearest point of the face on the screen.
    boundary: Corners,
    pub(super) barycentric: Corners,
    pub(super) depth: Dual,
    /// Barycentric weights of the nearest point on the face itself.
    pub(super) weights: Corners,
    /// Position in the edge table, the logarithm of the edge softness and its derivative with respect to the squared distance.
    edge: TablePosition,
    pub(super) log_edge: Dual,
    pub(super) edge_slope: Dual,
    /// The nearness less 1, the logarithm of the depth weight and its derivative with respect to the nearness.
    x: Dual,
    pub(super) log_depth: Dual,
    pub(super) depth_slope: Dual,
}

/// The objective at a pair: its value at the point, and its derivatives with respect to the attributes of the three corners, as if the
/// point were there.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Seen {
    pub(super) here: Dual,
    pub(super) at_corners: Corners,
    /// Derivatives with respect to the texture coordinates, if there is a texture.
    pub(super) by_u: Dual,
    pub(super) by_v: Dual,
}

/// Relative weight of a pair: the weight, and its part before the floor of the edge softness is subtracted.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Share {
    pub(super) whole: Dual,
    pub(super) of_edge: Dual,
}

#[cube]
impl FaceAttributes {
    /// A face of a view of the launch.
    pub(super) fn of(
        drawn: &BlendInputs,
        view: u32,
        face: u32,
        #[comptime] kind: BlendSpec,
    ) -> FaceAttributes {
        let job = (view * drawn.face_count + face) as usize;
        let stride = comptime!(if kind.second { 18usize } else { 9usize });
        let first = drawn.weights.attributes + (drawn.first_view + view) * drawn.weights.per_view;
        FaceAttributes::new(
            &drawn.corners,
            stride * job,
            &drawn.entries,
            face as usize,
            first,
            kind,
        )
    }

    /// The face with prepared numbers from `first` on in `corners`; `entries` `[faces, 3]` are the attribute entries at corners.
    fn new(
        corners: &Array<f32>,
        first: usize,
        entries: &Array<u32>,
        face: usize,
        first_attribute: u32,
        #[comptime] kind: BlendSpec,
    ) -> FaceAttributes {
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
        FaceAttributes {
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
        drawn: &BlendInputs,
        number: usize,
        #[comptime] kind: BlendSpec,
    ) -> Corners {
        Corners {
            a: drawn.number(self.entry_a as usize + number, kind),
            b: drawn.number(self.entry_b as usize + number, kind),
            c: drawn.number(self.entry_c as usize + number, kind),
        }
    }

    /// The texture at the point of a pair.
    pub(super) fn sample(
        self,
        pair: ColourPair,
        drawn: &BlendInputs,
        #[comptime] kind: BlendSpec,
    ) -> Sample {
        let u = pair.weights.mul(self.attribute(drawn, 0usize, kind)).sum();
        let v = pair.weights.mul(self.attribute(drawn, 1usize, kind)).sum();
        Sample::at(u, v, drawn.weights)
    }

    /// The objective at a pair for an upstream, whose first channel is at `first`.
    pub(super) fn seen(
        self,
        pair: ColourPair,
        drawn: &BlendInputs,
        upstream: &Array<f32>,
        first: usize,
        #[comptime] kind: BlendSpec,
    ) -> Seen {
        let plane = drawn.plane();
        let zero = Dual::constant(0.0f32);
        if kind.is_textured {
            let sample = self.sample(pair, drawn, kind);
            // An array, since a loop cannot update a struct.
            let mut sums = Array::<f32>::new(8usize);
            for k in 0..8usize {
                sums[k] = 0.0f32;
            }
            for channel in 0..comptime!(kind.channels) {
                let u = upstream[first + channel * plane];
                let texels = sample.texels(drawn, channel, kind);
                Four::load(&sums).plus(u, texels).store(&mut sums);
            }
            let sums = Four::load(&sums);
            let by_u = sample.by_u(sums, drawn.weights);
            let by_v = sample.by_v(sums, drawn.weights);
            let u = self.attribute(drawn, 0usize, kind);
            let v = self.attribute(drawn, 1usize, kind);
            let at_corners = u.times(by_u).add(v.times(by_v));
            Seen { here: sample.between(sums), at_corners, by_u, by_v }
        } else {
            let mut sums = Array::<f32>::new(6usize);
            for k in 0..6usize {
                sums[k] = 0.0f32;
            }
            for channel in 0..comptime!(kind.channels) {
                let u = upstream[first + channel * plane];
                let values = self.attribute(drawn, channel, kind);
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

    /// The pair of the face and a pixel.
    pub(super) fn pair(
        self,
        column: u32,
        row: u32,
        drawn: &BlendInputs,
        #[comptime] kind: BlendSpec,
    ) -> ColourPair {
        let weights = drawn.weights;
        let px = drawn.frame.column_centre(column);
        let py = drawn.frame.row_centre(row);
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
        // 1 / z interpolates linearly on the screen.
        let parts = barycentric.mul(self.per_depth);
        let depth = parts.sum().recip();

        let place = weights.edge.place(closest.distance2, !inside, kind.far_edge);
        let cubic = drawn.cubic(place.row, kind);
        let x = Dual::constant(weights.near).sub(depth).scale(weights.per_range);
        let by_depth = ByDepth::at(x, drawn, kind);
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

    /// Gradient with respect to x and y of the corners, given the derivatives of a function with respect to the squared distance and to the
    /// barycentric weights; see `blend/point.rs` of `kernel`.
    pub(super) fn pulled(self, pair: ColourPair, by_distance2: Dual, by_weights: Corners) -> Moved {
        let zero = Dual::constant(0.0f32);
        let (w0, w1, w2) = (by_weights.a, by_weights.b, by_weights.c);
        let (e0, e1, e2) = (self.face.first, self.face.second, self.face.third);
        let closest = pair.closest;
        let within = pair.within > 0.5f32;
        let (first, second) = (closest.edge == 0, closest.edge == 1);
        // For the pixel itself.
        let inner_x = zero
            .sub(w0.mul(e1.along_y).add(w1.mul(e2.along_y)).add(w2.mul(e0.along_y)))
            .mul(self.per_area);
        let inner_y =
            w0.mul(e1.along_x).add(w1.mul(e2.along_x)).add(w2.mul(e0.along_x)).mul(self.per_area);
        // For a point of an edge that is not clamped to one of its ends.
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
            pull: Pull::of(by_distance2, closest.dx, closest.dy),
        }
    }
}

/// Contributions of a pair to the gradient of the corners.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Moved {
    field_x: Dual,
    field_y: Dual,
    across_x: Dual,
    across_y: Dual,
    pull: Pull,
}

#[cube]
impl Moved {
    /// The gradient with respect to x of the corners.
    pub(super) fn x(self, pair: ColourPair) -> Corners {
        corners(pair, self.pull.x, self.field_x, self.across_x)
    }

    /// The gradient with respect to y of the corners.
    pub(super) fn y(self, pair: ColourPair) -> Corners {
        corners(pair, self.pull.y, self.field_y, self.across_y)
    }
}

/// The gradient of the corners along an axis. `across` acts against the first corner of the closest edge and towards its second.
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
impl ColourPair {
    /// Adds to the gradient of both tables, which starts at `own`, given the derivatives with respect to the logarithms of the weights.
    pub(super) fn pull_tables(
        self,
        by_edge: Dual,
        by_depth: Dual,
        drawn: &BlendInputs,
        partial: &mut Array<f32>,
        own: u32,
        #[comptime] kind: BlendSpec,
    ) {
        let edge = self.edge;
        let by_value = Dual::constant(0.0f32).sub(by_edge);
        add_powers(partial, own + 4u32 * edge.row, edge.place, by_value, kind.second);
        let first = own + 4u32 * drawn.weights.depth_row;
        pull_depth(self.x, by_depth, drawn, partial, first, kind);
    }

    /// Whether the edge softness exceeds its floor by more than rounding errors.
    pub(super) fn counts(self, weights: BlendParams) -> bool {
        self.log_edge.value > weights.counts_from
    }

    /// The share relative to a weight with this logarithm.
    pub(super) fn share(self, relative: Dual, weights: BlendParams) -> Share {
        let by_depth = self.log_depth.sub(relative);
        let whole = self.log_edge.add(by_depth).exp();
        let rest = 1.0f32 / (1.0f32 - weights.floor);
        // Far from the pixel, the depth factor of a near face may exceed the range of floats; such a face does not count.
        let floor = by_depth.exp().scale(weights.floor);
        let has_floor = weights.floor > 0.0f32;
        let less = Dual::select(has_floor, whole.sub(floor).scale(rest), whole);
        Share { whole: less, of_edge: whole.scale(rest) }
    }
}
