//! Cameras: orbits to matrices, and perspective projection of points.

use rayon::prelude::*;

use super::{Elementary, Views, number::Number};
use softrast_kernel::{Dual, Float, filled, task};

use crate::{NEAR, limits::FARTHEST};

/// Orbits `[views, 4]` to matrices `[views, 3, 4]`; see [`crate::project`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct OrbitMatrix;

/// The rotation of an orbit for its elevation and azimuth in degrees; the rows are left, up and ahead of the camera, see
/// [`crate::view_rotation`].
fn rotation<N: Number>(elevation: N, azimuth: N) -> [[N; 3]; 3] {
    let degree = N::Float::from_f64(std::f64::consts::PI / 180.0);
    // Computed from degrees: in f32 the cosine at a pole has any sign.
    let past = (elevation.value().to_f64() + 90.0).rem_euclid(360.0);
    let roll = if past > 180.0 { -N::Float::ONE } else { N::Float::ONE };
    let (sin_e, cos_e) = elevation.scale(degree).sin_cos();
    let (sin_a, cos_a) = azimuth.scale(degree).sin_cos();
    let minus = -N::Float::ONE;
    [
        [cos_a.scale(roll), N::of(0.0), sin_a.scale(roll)],
        [(sin_e * sin_a).scale(minus * roll), cos_e.scale(roll), (sin_e * cos_a).scale(roll)],
        [(cos_e * sin_a).scale(minus), sin_e.scale(minus), cos_e * cos_a],
    ]
}

/// The matrix of one orbit.
fn matrix<N: Number>(orbit: &[N]) -> [[N; 4]; 3] {
    let degree = N::Float::from_f64(std::f64::consts::PI / 180.0);
    let rotation = rotation(orbit[1], orbit[2]);
    let (sin, cos) = orbit[3].scale(degree).scale(N::Float::from_f64(0.5)).sin_cos();
    let focal = cos * sin.recip();
    let zero = N::of(0.0);
    let row = |k: usize, gain: N| rotation[k].map(|number| number * gain);
    let with = |[a, b, c]: [N; 3], shift| [a, b, c, shift];
    let right = row(0, focal.scale(-N::Float::ONE));
    [with(right, zero), with(row(1, focal), zero), with(rotation[2], orbit[0])]
}

impl Elementary for OrbitMatrix {
    fn forward<N: Number>(&self, inputs: &[&[N]], _: &[Vec<usize>]) -> Vec<N> {
        inputs[0].chunks_exact(4).flat_map(|orbit| matrix(orbit).concat()).collect()
    }

    fn vjp<N: Number>(
        &self,
        inputs: &[&[N]],
        _: &[Vec<usize>],
        upstream: &[N::Float],
        _: &[bool],
    ) -> Vec<N> {
        let views = inputs[0].chunks_exact(4).zip(upstream.chunks_exact(12));
        let of_view = |(orbit, upstream): (&[N], &[N::Float])| {
            let along = |k: usize| {
                let number =
                    |(j, &value)| Dual { value, tangent: N::of(f64::from(u8::from(j == k))) };
                let orbit: Vec<_> = orbit.iter().enumerate().map(number).collect();
                let pulled = matrix(&orbit).concat().into_iter().zip(upstream);
                pulled.fold(N::of(0.0), |sum, (number, &u)| sum + number.tangent.scale(u))
            };
            [0, 1, 2, 3].map(along)
        };
        views.flat_map(of_view).collect()
    }
}

/// Perspective projection of points in world units `[1 or views, points, 3]` by matrices `[views, 3, 4]`: `[views, 3, points]` of x and y
/// in NDC, and depth. Two rows of a matrix give x and y times the depth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Perspective;

/// Points per block of the gradient of a matrix: blocks are summed first, then added.
const BLOCK: usize = 256;
/// Points per rayon task.
const POINTS: usize = 8 * BLOCK;
/// Points per task that adds up the gradients of all views; divides [`POINTS`].
const TOGETHER: usize = 512;
const _: () = assert!(POINTS.is_multiple_of(TOGETHER));

impl Perspective {
    /// The point of a view and its projection: x, y, depth, and one over the depth used as divisor.
    #[inline(always)]
    fn seen<N: Number>(matrix: &[N], point: &[N]) -> ([N; 3], [N; 3], N) {
        let held = |x: N| x.held(-FARTHEST, FARTHEST);
        let at = [held(point[0]), held(point[1]), held(point[2])];
        let row = |m: &[N]| m[0] * at[0] + m[1] * at[1] + m[2] * at[2] + m[3];
        let (x, y, depth) = (row(&matrix[0..4]), row(&matrix[4..8]), row(&matrix[8..12]));
        let inverse = depth.held(NEAR, f64::INFINITY).recip();
        (at, [x * inverse, y * inverse, depth], inverse)
    }
}

impl Elementary for Perspective {
    fn forward<N: Number>(&self, inputs: &[&[N]], dims: &[Vec<usize>]) -> Vec<N> {
        let (points, count) = (Views::new(inputs[0], &dims[0]), dims[0][1]);
        let mut all = filled(N::of(0.0), 3 * dims[1][0] * count);
        let views = all.par_chunks_mut((3 * count).max(1)).zip(inputs[1].par_chunks_exact(12));
        views.enumerate().for_each(|(view, (out, matrix))| {
            let (xs, rest) = out.split_at_mut(count);
            let (ys, depths) = rest.split_at_mut(count);
            let planes = xs
                .par_chunks_mut(POINTS)
                .zip(ys.par_chunks_mut(POINTS))
                .zip(depths.par_chunks_mut(POINTS));
            planes.zip(points.of(view).par_chunks(3 * POINTS)).for_each(|(planes, points)| {
                let ((xs, ys), depths) = planes;
                task("projection", || {
                    for (k, point) in points.chunks_exact(3).enumerate() {
                        let (_, [x, y, depth], _) = Self::seen(matrix, point);
                        (xs[k], ys[k], depths[k]) = (x, y, depth);
                    }
                });
            });
        });
        all
    }

    fn vjp<N: Number>(
        &self,
        inputs: &[&[N]],
        dims: &[Vec<usize>],
        upstream: &[N::Float],
        wanted: &[bool],
    ) -> Vec<N> {
        let (points, count, views) = (Views::new(inputs[0], &dims[0]), dims[0][1], dims[1][0]);
        let zero = N::of(0.0);
        // The gradients with respect to some points of a view, and block by block with respect to its matrix.
        let of_points = |view: usize, chunk: usize, points: &[N]| {
            let matrix = &inputs[1][12 * view..12 * view + 12];
            let upstream = &upstream[3 * count * view..3 * count * (view + 1)];
            let mut to_points = vec![zero; if wanted[0] { points.len() } else { 0 }];
            let mut to_matrix = Vec::with_capacity(POINTS / BLOCK);
            for (block, points) in points.chunks(3 * BLOCK).enumerate() {
                let mut part = [zero; 12];
                for (k, point) in points.chunks_exact(3).enumerate() {
                    let own = k + block * BLOCK;
                    let k = own + chunk * POINTS;
                    let (at, [x, y, depth], inverse) = Self::seen(matrix, point);
                    let u = [upstream[k], upstream[count + k], upstream[2 * count + k]];
                    let (to_x, to_y) = (inverse.scale(u[0]), inverse.scale(u[1]));
                    // A clamped depth has no derivative as a divisor.
                    let divided = depth.value() >= N::Float::from_f64(NEAR);
                    let through = if divided { x * to_x + y * to_y } else { zero };
                    let to_seen = [to_x, to_y, N::constant(u[2]) - through];
                    if wanted[1] {
                        for (i, to_row) in to_seen.into_iter().enumerate() {
                            for j in 0..3 {
                                part[4 * i + j] = part[4 * i + j] + to_row * at[j];
                            }
                            part[4 * i + 3] = part[4 * i + 3] + to_row;
                        }
                    }
                    if wanted[0] {
                        for j in 0..3 {
                            let inside = at[j].value() == point[j].value();
                            let pulled = to_seen[0] * matrix[j]
                                + to_seen[1] * matrix[4 + j]
                                + to_seen[2] * matrix[8 + j];
                            to_points[3 * own + j] = if inside { pulled } else { zero };
                        }
                    }
                }
                to_matrix.push(part);
            }
            (to_points, to_matrix)
        };
        let of_view = |view: usize| {
            let chunks = points.of(view).par_chunks(3 * POINTS).enumerate();
            let of_points =
                |(chunk, points)| task("projection, back", || of_points(view, chunk, points));
            let (to_points, blocks): (Vec<_>, Vec<_>) = chunks.map(of_points).unzip();
            let mut to_matrix = [zero; 12];
            for part in blocks.iter().flatten() {
                for (total, &part) in to_matrix.iter_mut().zip(part) {
                    *total = *total + part;
                }
            }
            (to_points, to_matrix)
        };
        let of_views: Vec<_> = (0..views).into_par_iter().map(of_view).collect();
        let mut gradient = Vec::new();
        if wanted[0] {
            gradient = filled(zero, inputs[0].len());
            let add = |totals: &mut [N], of_views: &[(Vec<Vec<N>>, [N; 12])]| {
                totals.par_chunks_mut(3 * TOGETHER).enumerate().for_each(|(k, totals)| {
                    let first = k * TOGETHER;
                    task("projection, back together", || {
                        for (to_points, _) in of_views {
                            let parts = &to_points[first / POINTS][3 * (first % POINTS)..];
                            let numbers = totals.iter_mut().zip(parts);
                            numbers.for_each(|(total, &part)| *total = *total + part);
                        }
                    });
                });
            };
            if points.shared {
                add(&mut gradient, &of_views);
            } else {
                let views = gradient.par_chunks_mut((3 * count).max(1)).zip(&of_views);
                views.for_each(|(own, of_view)| add(own, std::slice::from_ref(of_view)));
            }
        }
        if wanted[1] {
            gradient.extend(of_views.iter().flat_map(|(_, to_matrix)| to_matrix));
        }
        gradient
    }
}
