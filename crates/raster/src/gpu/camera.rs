//! Cameras: orbits to matrices, and perspective projection of points, as in `ops/elementary/camera.rs`.

use cubecl::prelude::*;

use super::{
    dual::{Dual, load},
    whole::{INFINITE, SIZE},
};
use crate::{NEAR, limits::FARTHEST};

/// Units of a cube of [`to_matrices`], all of one view.
pub(super) const UNITS: u32 = 128;

const PI: f32 = std::f32::consts::PI;
const DEGREE: f32 = PI / 180.0;
const DEPTH: f32 = NEAR as f32;
const FAR: f32 = FARTHEST as f32;

/// Sine and cosine of an angle.
#[derive(CubeType, Clone, Copy)]
struct Angle {
    sin: Dual,
    cos: Dual,
}

#[cube]
impl Angle {
    /// Uses sums and products only: the built-in sine and cosine of a GPU may be off by 2^-11 (WebGPU Shading Language, Accuracy of
    /// Built-in Functions), which is visible in a loss.
    fn of_degrees(angle: Dual) -> Angle {
        let turns = angle.value * (1.0f32 / 360.0f32);
        // Half the remaining angle, within a right angle, where the next terms are below 1e-8.
        let half = (turns - f32::round(turns)) * PI;
        let x = half * half;
        let odd = 1.0f32 - x / 156.0f32;
        let odd = 1.0f32 - x / 110.0f32 * odd;
        let odd = 1.0f32 - x / 72.0f32 * odd;
        let odd = 1.0f32 - x / 42.0f32 * odd;
        let odd = 1.0f32 - x / 20.0f32 * odd;
        let sin_half = half * (1.0f32 - x / 6.0f32 * odd);
        let even = 1.0f32 - x / 132.0f32;
        let even = 1.0f32 - x / 90.0f32 * even;
        let even = 1.0f32 - x / 56.0f32 * even;
        let even = 1.0f32 - x / 30.0f32 * even;
        let even = 1.0f32 - x / 12.0f32 * even;
        let cos_half = 1.0f32 - x / 2.0f32 * even;
        let sin = 2.0f32 * sin_half * cos_half;
        let cos = 1.0f32 - 2.0f32 * sin_half * sin_half;
        let moved = DEGREE * angle.tangent;
        Angle {
            sin: Dual { value: sin, tangent: cos * moved },
            cos: Dual { value: cos, tangent: -(sin * moved) },
        }
    }
}

/// An orbit, prepared for its matrix.
#[derive(CubeType, Clone, Copy)]
struct Orbit {
    distance: Dual,
    elevation: Angle,
    azimuth: Angle,
    focal: Dual,
    /// Sign of the up direction: 1, or -1 past a pole.
    roll: f32,
}

#[cube]
impl Orbit {
    fn load(
        orbits: &Array<f32>,
        direction: &Array<f32>,
        view: u32,
        #[comptime] second: bool,
    ) -> Orbit {
        let at = 4 * view as usize;
        let elevation = Angle::of_degrees(load(orbits, at + 1, direction, at + 1, second));
        let azimuth = Angle::of_degrees(load(orbits, at + 2, direction, at + 2, second));
        let fov = load(orbits, at + 3, direction, at + 3, second);
        let half = Angle::of_degrees(fov.scale(0.5f32));
        Orbit {
            distance: load(orbits, at, direction, at, second),
            elevation,
            azimuth,
            focal: half.cos.mul(half.sin.recip()),
            roll: roll(orbits[at + 1]),
        }
    }
}

/// Sign of the up direction at an elevation in degrees: 1, or -1 past a pole, but not at it.
#[cube]
fn roll(elevation: f32) -> f32 {
    let past = elevation + 90.0f32;
    let past = past - 360.0f32 * f32::floor(past / 360.0f32);
    select(past > 180.0f32 && past < 360.0f32, -1.0f32, 1.0f32)
}

/// Writes the matrices of orbits `[views, 4]`, `[views, 3, 4]`: one unit per view.
#[cube(launch)]
pub(super) fn orbit_matrices(
    orbits: &Array<f32>,
    direction: &Array<f32>,
    matrices: &mut Array<f32>,
    views: u32,
    #[comptime] second: bool,
) {
    let view = ABSOLUTE_POS as u32;
    if view >= views {
        terminate!();
    }
    let orbit = Orbit::load(orbits, direction, view, second);
    let (se, ce) = (orbit.elevation.sin, orbit.elevation.cos);
    let (sa, ca) = (orbit.azimuth.sin, orbit.azimuth.cos);
    let up = orbit.focal.scale(orbit.roll);
    let at = 12 * view as usize;
    matrices[at] = up.mul(ca).scale(-1.0f32).stored(second);
    matrices[at + 1] = 0.0f32;
    matrices[at + 2] = up.mul(sa).scale(-1.0f32).stored(second);
    matrices[at + 3] = 0.0f32;
    matrices[at + 4] = up.mul(se).mul(sa).scale(-1.0f32).stored(second);
    matrices[at + 5] = up.mul(ce).stored(second);
    matrices[at + 6] = up.mul(se).mul(ca).stored(second);
    matrices[at + 7] = 0.0f32;
    matrices[at + 8] = ce.mul(sa).scale(-1.0f32).stored(second);
    matrices[at + 9] = se.scale(-1.0f32).stored(second);
    matrices[at + 10] = ce.mul(ca).stored(second);
    matrices[at + 11] = orbit.distance.stored(second);
}

/// Writes the gradient of `Σ upstream · matrices` with respect to the orbits: one unit per view.
#[cube(launch)]
pub(super) fn to_orbits(
    orbits: &Array<f32>,
    direction: &Array<f32>,
    upstream: &Array<f32>,
    gradient: &mut Array<f32>,
    views: u32,
    #[comptime] second: bool,
) {
    let view = ABSOLUTE_POS as u32;
    if view >= views {
        terminate!();
    }
    let orbit = Orbit::load(orbits, direction, view, second);
    let (se, ce) = (orbit.elevation.sin, orbit.elevation.cos);
    let (sa, ca) = (orbit.azimuth.sin, orbit.azimuth.cos);
    let at = 12 * view as usize;
    let (u0, u2) = (upstream[at], upstream[at + 2]);
    let (u4, u5, u6) = (upstream[at + 4], upstream[at + 5], upstream[at + 6]);
    let (u8, u9, u10) = (upstream[at + 8], upstream[at + 9], upstream[at + 10]);
    let up = orbit.focal.scale(orbit.roll);
    // The upstream's second and third rows, combined with sine and cosine of the azimuth, and their derivatives (`beside`).
    let ahead = ca.scale(u6).sub(sa.scale(u4));
    let ahead_below = ca.scale(u10).sub(sa.scale(u8));
    let beside = ca.scale(u4).add(sa.scale(u6)).scale(-1.0f32);
    let beside_below = ca.scale(u8).add(sa.scale(u10)).scale(-1.0f32);
    let of_rows = se.mul(ahead).add(ce.scale(u5)).sub(ca.scale(u0)).sub(sa.scale(u2));
    let by_elevation = up.mul(ce.mul(ahead).sub(se.scale(u5)));
    let by_elevation = by_elevation.sub(se.mul(ahead_below)).sub(ce.scale(u9));
    let by_azimuth = up.mul(sa.scale(u0).sub(ca.scale(u2)).add(se.mul(beside)));
    let by_azimuth = by_azimuth.add(ce.mul(beside_below));
    // The focal length is the cotangent of half the field of view.
    let by_fov = orbit.focal.mul(orbit.focal).add(Dual::constant(1.0f32)).scale(-0.5f32);
    let by_fov = by_fov.mul(of_rows).scale(orbit.roll);
    let first = 4 * view as usize;
    gradient[first] = Dual::constant(upstream[at + 11]).stored(second);
    gradient[first + 1] = by_elevation.scale(DEGREE).stored(second);
    gradient[first + 2] = by_azimuth.scale(DEGREE).stored(second);
    gradient[first + 3] = by_fov.scale(DEGREE).stored(second);
}

/// Points and the cameras that project them, as inputs of kernels.
#[derive(CubeType, CubeLaunch)]
pub(super) struct Seen {
    /// `[1 or views, points, 3]`.
    points: Array<f32>,
    /// `[views, 3, 4]`.
    matrices: Array<f32>,
    /// Derivatives of both.
    direction: Array<f32>,
    count: u32,
    views: u32,
    /// Length of the points of a view, 0 if all views share them; and of all points.
    per_view: u32,
    all: u32,
}

/// A row of a matrix.
#[derive(CubeType, Clone, Copy)]
struct Row {
    x: Dual,
    y: Dual,
    z: Dual,
    shift: Dual,
}

/// Three numbers.
#[derive(CubeType, Clone, Copy)]
struct Point {
    x: Dual,
    y: Dual,
    z: Dual,
}

/// A projected point.
#[derive(CubeType, Clone, Copy)]
struct Projected {
    at: Point,
    x: Dual,
    y: Dual,
    depth: Dual,
    /// One over the depth used as divisor.
    inverse: Dual,
}

#[cube]
impl Row {
    fn times(self, point: Point) -> Dual {
        let xy = self.x.mul(point.x).add(self.y.mul(point.y));
        xy.add(self.z.mul(point.z)).add(self.shift)
    }
}

/// A coordinate clamped to the farthest position, where its derivative is 0. NaN stays.
#[cube]
fn held(number: Dual) -> Dual {
    let bits = u32::reinterpret(number.value) & SIZE;
    let beyond = bits > comptime!(FAR.to_bits()) && bits <= INFINITE;
    let far = select(u32::reinterpret(number.value) > SIZE, -FAR, FAR);
    Dual::select(beyond, Dual::constant(far), number)
}

#[cube]
impl Seen {
    fn row(&self, view: u32, row: u32, #[comptime] second: bool) -> Row {
        let at = (12u32 * view + 4u32 * row) as usize;
        let along = self.all as usize + at;
        Row {
            x: load(&self.matrices, at, &self.direction, along, second),
            y: load(&self.matrices, at + 1, &self.direction, along + 1, second),
            z: load(&self.matrices, at + 2, &self.direction, along + 2, second),
            shift: load(&self.matrices, at + 3, &self.direction, along + 3, second),
        }
    }

    /// Index of a point of a view.
    fn place(&self, view: u32, point: u32) -> usize {
        (view * self.per_view + 3u32 * point) as usize
    }

    fn point(&self, view: u32, point: u32, #[comptime] second: bool) -> Point {
        let at = self.place(view, point);
        Point {
            x: load(&self.points, at, &self.direction, at, second),
            y: load(&self.points, at + 1, &self.direction, at + 1, second),
            z: load(&self.points, at + 2, &self.direction, at + 2, second),
        }
    }

    fn projected(&self, view: u32, point: u32, #[comptime] second: bool) -> Projected {
        let given = self.point(view, point, second);
        let at = Point { x: held(given.x), y: held(given.y), z: held(given.z) };
        let depth = self.row(view, 2u32, second).times(at);
        let near = depth.value < DEPTH;
        let inverse = Dual::select(near, Dual::constant(DEPTH), depth).recip();
        Projected {
            at,
            x: self.row(view, 0u32, second).times(at).mul(inverse),
            y: self.row(view, 1u32, second).times(at).mul(inverse),
            depth,
            inverse,
        }
    }

    /// The gradient of `Σ upstream · seen` with respect to x and y times the depth, and to the depth.
    fn to_rows(&self, seen: Projected, upstream: &Array<f32>, view: u32, point: u32) -> Point {
        let at = (3u32 * view * self.count + point) as usize;
        let count = self.count as usize;
        let to_x = seen.inverse.scale(upstream[at]);
        let to_y = seen.inverse.scale(upstream[at + count]);
        // A clamped depth has no derivative as a divisor.
        let through = seen.x.mul(to_x).add(seen.y.mul(to_y));
        let zero = Dual::constant(0.0f32);
        let through = Dual::select(seen.depth.value < DEPTH, zero, through);
        Point { x: to_x, y: to_y, z: Dual::constant(upstream[at + 2 * count]).sub(through) }
    }
}

/// Writes projected points, `[views, 3, points]`: one unit per point and view.
#[cube(launch)]
pub(super) fn perspective(seen: &Seen, out: &mut Array<f32>, #[comptime] second: bool) {
    let own = ABSOLUTE_POS as u32;
    if own >= seen.views * seen.count {
        terminate!();
    }
    let (view, point) = (own / seen.count, own % seen.count);
    let projected = seen.projected(view, point, second);
    let at = (3u32 * view * seen.count + point) as usize;
    let count = seen.count as usize;
    out[at] = projected.x.stored(second);
    out[at + count] = projected.y.stored(second);
    out[at + 2 * count] = projected.depth.stored(second);
}

/// Writes the gradient of `Σ upstream · seen` with respect to the points: one unit each, over all views of the point.
#[cube(launch)]
pub(super) fn to_points(
    seen: &Seen,
    upstream: &Array<f32>,
    gradient: &mut Array<f32>,
    #[comptime] second: bool,
) {
    let own = ABSOLUTE_POS as u32;
    if 3u32 * own >= seen.all {
        terminate!();
    }
    let (first, point) = (own / seen.count, own % seen.count);
    let end = select(seen.per_view == 0u32, seen.views, first + 1u32);
    let mut x = 0.0f32;
    let mut y = 0.0f32;
    let mut z = 0.0f32;
    for view in first..end {
        let given = seen.point(view, point, second);
        let projected = seen.projected(view, point, second);
        let to = seen.to_rows(projected, upstream, view, point);
        let a = seen.row(view, 0u32, second);
        let b = seen.row(view, 1u32, second);
        let c = seen.row(view, 2u32, second);
        let by_x = to.x.mul(a.x).add(to.y.mul(b.x)).add(to.z.mul(c.x));
        let by_y = to.x.mul(a.y).add(to.y.mul(b.y)).add(to.z.mul(c.y));
        let by_z = to.x.mul(a.z).add(to.y.mul(b.z)).add(to.z.mul(c.z));
        x += select(projected.at.x.value == given.x.value, by_x.stored(second), 0.0f32);
        y += select(projected.at.y.value == given.y.value, by_y.stored(second), 0.0f32);
        z += select(projected.at.z.value == given.z.value, by_z.stored(second), 0.0f32);
    }
    let at = 3 * own as usize;
    gradient[at] = x;
    gradient[at + 1] = y;
    gradient[at + 2] = z;
}

/// Writes the gradient of `Σ upstream · seen` with respect to the matrices: one cube per view.
#[cube(launch)]
pub(super) fn to_matrices(
    seen: &Seen,
    upstream: &Array<f32>,
    gradient: &mut Array<f32>,
    #[comptime] second: bool,
) {
    let view = CUBE_POS as u32;
    if view >= seen.views {
        terminate!();
    }
    let mut sums = Array::<f32>::new(12usize);
    for k in 0..12usize {
        sums[k] = 0.0f32;
    }
    let mut point = UNIT_POS;
    while point < seen.count {
        let projected = seen.projected(view, point, second);
        let to = seen.to_rows(projected, upstream, view, point);
        add_row(&mut sums, 0usize, to.x, projected.at, second);
        add_row(&mut sums, 4usize, to.y, projected.at, second);
        add_row(&mut sums, 8usize, to.z, projected.at, second);
        point += UNITS;
    }
    let mut shares = SharedMemory::<f32>::new(comptime!(12 * UNITS as usize));
    for k in 0..12usize {
        shares[k * comptime!(UNITS as usize) + UNIT_POS as usize] = sums[k];
    }
    sync_cube();
    if UNIT_POS < 12 {
        let mut sum = 0.0f32;
        for unit in 0..UNITS {
            sum += shares[(UNIT_POS * UNITS + unit) as usize];
        }
        gradient[(12u32 * view + UNIT_POS) as usize] = sum;
    }
}

#[cube]
fn add_row(sums: &mut Array<f32>, first: usize, to: Dual, at: Point, #[comptime] second: bool) {
    sums[first] = sums[first] + to.mul(at.x).stored(second);
    sums[first + 1] = sums[first + 1] + to.mul(at.y).stored(second);
    sums[first + 2] = sums[first + 2] + to.mul(at.z).stored(second);
    sums[first + 3] = sums[first + 3] + to.stored(second);
}
