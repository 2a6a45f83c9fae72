//! The arithmetic of one pixel and one face, as in `{face,pair,table}.rs` of `kernel`.

use cubecl::prelude::*;

use super::dual::{Dual, load};

/// Edge vectors shorter than this (NDC², squared length) count as a point.
const POINT: f32 = 1e-30;
/// Triangles lower than this fraction of their longest edge count as slivers.
const SLIVER: f32 = 1e-3;
/// Largest rate at which a position in a cell changes with the squared distance, in NDC⁻².
const STEEPEST: f32 = 1e30;
/// Bits of the fraction of an f32, and the bias of its exponent.
const MANTISSA: u32 = 23;
const BIAS: u32 = 127;

/// Layout of the cells of a profile table: a [`Grid`](softrast_kernel::Grid) prepared for look-ups.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
pub(super) struct Lookup {
    /// Factor from squared distances to z, relative to its start.
    pub(super) inverse_outer: f32,
    pub(super) inverse_inner: f32,
    /// Scaled squared distances at which the cells start; 0 without `far`.
    pub(super) before_outer: f32,
    pub(super) before_inner: f32,
    pub(super) start: f32,
    pub(super) octaves: u32,
    pub(super) bits: u32,
    /// Octaves resolved before the end, the factor from `1 - z` to positions there, and the start of these.
    pub(super) far: u32,
    pub(super) shrunk: f32,
    pub(super) end: f32,
    /// Cells of one side, without its tail.
    pub(super) cells: u32,
}

#[cube]
impl Lookup {
    /// Position of a squared distance in the table, on its inner side or not. Without `far` no cell is counted from the far end.
    pub(super) fn place(
        self,
        distance2: Dual,
        inner: bool,
        #[comptime] far: bool,
    ) -> TablePosition {
        let inverse = select(inner, self.inverse_inner, self.inverse_outer);
        let y = distance2.scale(inverse);
        let mut position = y.value;
        if far {
            let before = select(inner, self.before_inner, self.before_outer);
            position = select(y.value < before, 0.0f32, y.value - before);
        }
        let z = select(position < 2.0f32, position, 2.0f32) + self.start;
        let near = Cell::of(z, self.octaves, self.bits);
        let mut index = select(near.index > self.cells, self.cells, near.index);
        let mut value = near.place;
        let mut rate = near.rate;
        if far {
            let rest = select(z < 1.0f32, 1.0f32 - z, 0.0f32);
            let rest = select(rest < 0.5f32, rest, 0.5f32) * self.shrunk + self.end;
            let cell = Cell::of(rest, self.far + 1u32, self.bits);
            let is_far = z > 0.5f32;
            // Counted from the end; the cell that starts at the middle is never reached.
            let last = select(z < 1.0f32, self.cells - 1u32 - cell.index, self.cells);
            index = select(is_far, last, index);
            value = select(is_far, 1.0f32 - cell.place, value);
            rate = select(is_far, cell.rate * self.shrunk, rate);
            let before = select(inner, self.before_inner, self.before_outer);
            rate = select(y.value < before, 0.0f32, rate);
        }
        let row = select(inner, index + self.cells + 1u32, index);
        // The cubic of the tail is constant; a position of 0 avoids overflow.
        let place = Dual { value, tangent: y.tangent * rate };
        let place = Dual::select(z < 1.0f32, place, Dual::constant(0.0f32));
        let slope = rate * inverse;
        TablePosition { row, place, rate: select(slope < STEEPEST, slope, STEEPEST) }
    }
}

/// A cell of some octaves below 1, indexed by exponent and leading mantissa bits of a number, and the number's position in it.
#[derive(CubeType, Clone, Copy)]
struct Cell {
    index: u32,
    place: f32,
    /// Rate at which the position changes with the number.
    rate: f32,
}

#[cube]
impl Cell {
    fn of(z: f32, octaves: u32, bits: u32) -> Cell {
        let raw = u32::reinterpret(z);
        let shift = MANTISSA - bits;
        let lower = f32::reinterpret((raw >> shift) << shift);
        let index = (raw >> shift) - ((BIAS - octaves) << bits);
        let rate = f32::reinterpret((2u32 * BIAS + bits - (raw >> MANTISSA)) << MANTISSA);
        Cell { index, place: (z - lower) * rate, rate }
    }
}

/// Position of a squared distance in a table.
#[derive(CubeType, Clone, Copy)]
pub(super) struct TablePosition {
    /// Row of the table.
    pub(super) row: u32,
    /// Position within the cell, in [0, 1], and its derivative with respect to the squared distance.
    pub(super) place: Dual,
    pub(super) rate: f32,
}

#[cube]
impl TablePosition {
    /// The value of the table at this position.
    pub(super) fn value(self, cubic: Cubic) -> Dual {
        let t = self.place;
        cubic.a.add(t.mul(cubic.b.add(t.mul(cubic.c.add(t.mul(cubic.d))))))
    }

    /// The derivative of the value with respect to the squared distance.
    pub(super) fn slope(self, cubic: Cubic) -> Dual {
        let t = self.place;
        let by_place = cubic.b.add(t.mul(cubic.c.scale(2.0f32).add(t.mul(cubic.d.scale(3.0f32)))));
        by_place.scale(self.rate)
    }
}

/// One edge of a face.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Edge {
    x: Dual,
    y: Dual,
    pub(super) along_x: Dual,
    pub(super) along_y: Dual,
    /// One over the squared length; 0 for an edge that is a point.
    pub(super) inverse: Dual,
}

/// A projected triangle prepared for distances; corner k starts edge k.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Face {
    pub(super) first: Edge,
    pub(super) second: Edge,
    pub(super) third: Edge,
    /// Sign of the area; 0 for a triangle without area.
    pub(super) orientation: f32,
    /// 1 where edges are far from parallel, else 0.
    stout: f32,
}

/// Closest point of an edge, or of the whole boundary, to a pixel.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Closest {
    pub(super) distance2: Dual,
    pub(super) dx: Dual,
    pub(super) dy: Dual,
    /// Position on its edge, from 0 to 1.
    pub(super) along: Dual,
    pub(super) edge: u32,
    /// At least 0 where the pixel is on the inner side of all edges so far.
    pub(super) side: f32,
    /// Signed distance to the line of the edge, above 0 on its inner side.
    line: f32,
}

/// A pixel-face pair and its position in the profile table.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Pair {
    /// Row of the table.
    pub(super) row: u32,
    /// Position within the cell, in [0, 1], and its derivative with respect to the squared distance.
    pub(super) place: Dual,
    rate: f32,
    /// Offset from the closest point to the pixel.
    pub(super) dx: Dual,
    pub(super) dy: Dual,
    along: Dual,
    edge: u32,
}

#[cube]
impl Edge {
    fn new(x: Dual, y: Dual, next_x: Dual, next_y: Dual) -> Edge {
        let along_x = next_x.sub(x);
        let along_y = next_y.sub(y);
        let length2 = along_x.mul(along_x).add(along_y.mul(along_y));
        let long = length2.value > POINT;
        let divisor = Dual::select(long, length2, Dual::constant(1.0f32));
        let inverse = Dual::select(long, divisor.recip(), Dual::constant(0.0f32));
        Edge { x, y, along_x, along_y, inverse }
    }

    fn length2(self) -> f32 {
        self.along_x.value * self.along_x.value + self.along_y.value * self.along_y.value
    }

    /// The doubled area of the triangle of the pixel at `px`, `py` and the edge, above 0 to its left.
    pub(super) fn area(self, px: f32, py: f32) -> Dual {
        let wx = Dual::constant(px).sub(self.x);
        let wy = Dual::constant(py).sub(self.y);
        self.along_x.mul(wy).sub(self.along_y.mul(wx))
    }

    fn closest(self, px: f32, py: f32, orientation: f32, edge: u32) -> Closest {
        let wx = Dual::constant(px).sub(self.x);
        let wy = Dual::constant(py).sub(self.y);
        let t = wx.mul(self.along_x).add(wy.mul(self.along_y)).mul(self.inverse);
        let t = Dual::select(t.value > 0.0f32, t, Dual::constant(0.0f32));
        let t = Dual::select(t.value < 1.0f32, t, Dual::constant(1.0f32));
        let dx = wx.sub(t.mul(self.along_x));
        let dy = wy.sub(t.mul(self.along_y));
        let edge_function = self.along_x.value * wy.value - self.along_y.value * wx.value;
        Closest {
            distance2: dx.mul(dx).add(dy.mul(dy)),
            dx,
            dy,
            along: t,
            edge,
            side: orientation * edge_function,
            line: orientation * edge_function * f32::sqrt(self.inverse.value),
        }
    }
}

/// A gradient with respect to x and y.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Pull {
    pub(super) x: Dual,
    pub(super) y: Dual,
}

#[cube]
impl Pull {
    /// The gradient of a closest point at offset `dx`, `dy` from the pixel, given the derivative with respect to the squared distance.
    pub(super) fn of(by_distance2: Dual, dx: Dual, dy: Dual) -> Pull {
        let pull = by_distance2.scale(-2.0f32);
        Pull { x: pull.mul(dx), y: pull.mul(dy) }
    }
}

#[cube]
impl Closest {
    /// The closer of two points. On the boundary of a `stout` face it is on the edge whose line has the least signed distance
    /// (docs/notes.md, Nearest edge), and floats distinguish lines where they do not distinguish squared distances.
    fn nearer(self, other: Closest, stout: bool) -> Closest {
        let by_line = other.line < self.line;
        let by_distance = other.distance2.value < self.distance2.value;
        let other_wins = select(stout, by_line, by_distance);
        Closest {
            distance2: Dual::select(other_wins, other.distance2, self.distance2),
            dx: Dual::select(other_wins, other.dx, self.dx),
            dy: Dual::select(other_wins, other.dy, self.dy),
            along: Dual::select(other_wins, other.along, self.along),
            edge: select(other_wins, other.edge, self.edge),
            line: select(other_wins, other.line, self.line),
            side: select(other.side < self.side, other.side, self.side),
        }
    }
}

#[cube]
impl Face {
    /// The face whose six corner coordinates start at `first` in `corners`.
    pub(super) fn new(corners: &Array<f32>, first: usize, #[comptime] second: bool) -> Face {
        let ax = load(corners, first, corners, first + 6, second);
        let ay = load(corners, first + 1, corners, first + 7, second);
        let bx = load(corners, first + 2, corners, first + 8, second);
        let by = load(corners, first + 3, corners, first + 9, second);
        let cx = load(corners, first + 4, corners, first + 10, second);
        let cy = load(corners, first + 5, corners, first + 11, second);
        let edge_a = Edge::new(ax, ay, bx, by);
        let edge_b = Edge::new(bx, by, cx, cy);
        let edge_c = Edge::new(cx, cy, ax, ay);
        let area = edge_a.along_x.value * edge_b.along_y.value
            - edge_a.along_y.value * edge_b.along_x.value;
        let orientation = select(area > 0.0f32, 1.0f32, select(area < 0.0f32, -1.0f32, 0.0f32));
        let ab = edge_a.length2();
        let bc = edge_b.length2();
        let ca = edge_c.length2();
        let longest = select(ab > bc, ab, bc);
        let longest = select(ca > longest, ca, longest);
        let size = f32::abs(area);
        let stout = select(size > SLIVER * longest, 1.0f32, 0.0f32);
        Face { first: edge_a, second: edge_b, third: edge_c, orientation, stout }
    }

    /// The point of the boundary that is closest to the pixel at `px`, `py` (NDC).
    pub(super) fn closest(self, px: f32, py: f32) -> Closest {
        let orientation = self.orientation;
        let first = self.first.closest(px, py, orientation, 0u32);
        let second = self.second.closest(px, py, orientation, 1u32);
        let third = self.third.closest(px, py, orientation, 2u32);
        first.nearer(second, self.stout > 0.5f32).nearer(third, self.stout > 0.5f32)
    }

    /// The pair of the face and the pixel at `px`, `py` (NDC).
    pub(super) fn pair(self, px: f32, py: f32, lookup: Lookup) -> Pair {
        let orientation = self.orientation;
        let nearest = self.closest(px, py);
        let inside = nearest.side >= 0.0f32 && orientation != 0.0f32;

        let place = lookup.place(nearest.distance2, inside, false);
        Pair {
            row: place.row,
            place: place.place,
            rate: place.rate,
            dx: nearest.dx,
            dy: nearest.dy,
            along: nearest.along,
            edge: nearest.edge,
        }
    }
}

#[cube]
impl Pair {
    /// The value of the profile at this pair.
    pub(super) fn value(self, cubic: Cubic) -> Dual {
        TablePosition { row: self.row, place: self.place, rate: self.rate }.value(cubic)
    }

    /// Derivative of the profile with respect to the squared distance.
    pub(super) fn slope(self, cubic: Cubic) -> Dual {
        TablePosition { row: self.row, place: self.place, rate: self.rate }.slope(cubic)
    }

    /// The gradient of `factor` times the profile with respect to the closest point.
    pub(super) fn pull(self, cubic: Cubic, factor: f32) -> Pull {
        Pull::of(self.slope(cubic).scale(factor), self.dx, self.dy)
    }

    /// Barycentric weight of a corner at the closest point.
    pub(super) fn weight(self, #[comptime] corner: u32) -> Dual {
        let before = comptime!((corner + 2) % 3);
        let starts = Dual::constant(1.0f32).sub(self.along);
        let ends = Dual::select(self.edge == before, self.along, Dual::constant(0.0f32));
        Dual::select(self.edge == corner, starts, ends)
    }
}

/// Coefficients of a cell.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Cubic {
    a: Dual,
    b: Dual,
    c: Dual,
    d: Dual,
}

#[cube]
impl Cubic {
    /// The constant coefficient.
    pub(super) fn first(self) -> Dual {
        self.a
    }

    /// Row `row` of `table`; its derivatives are in `direction`, from `offset` on.
    pub(super) fn new(
        table: &Array<f32>,
        row: u32,
        direction: &Array<f32>,
        offset: u32,
        #[comptime] second: bool,
    ) -> Cubic {
        let at = 4 * row as usize;
        let along = offset as usize + at;
        Cubic {
            a: load(table, at, direction, along, second),
            b: load(table, at + 1, direction, along + 1, second),
            c: load(table, at + 2, direction, along + 2, second),
            d: load(table, at + 3, direction, along + 3, second),
        }
    }
}
