//! A plain implementation of the op: one file, one thread, `f32`, no vectors, no table.
//!
//! The baseline of quoted times, written as directly as possible: for each face the pixels of its bounding box grown by the radius, the
//! closest point of its boundary, and the optical depth of a logistic of the signed squared distance by `exp` and `ln_1p`.

/// The faces to draw and their support.
pub(crate) struct Scalar<'a> {
    pub(crate) faces: &'a [[u32; 3]],
    pub(crate) size: usize,
    /// Scale of the logistic, NDC².
    pub(crate) scale: f32,
    /// Pixels farther outside than this (NDC) are skipped.
    pub(crate) radius: f32,
}

/// Signed squared distance of a pixel, the vector to it from the closest point, and the position of that point.
struct Closest {
    signed2: f32,
    delta: [f32; 2],
    weights: [f32; 3],
}

fn closest(corners: &[[f32; 2]; 3], px: f32, py: f32) -> Closest {
    let mut best = (f32::MAX, [0.0; 2], [0.0; 3]);
    let (mut positive, mut negative) = (true, true);
    for k in 0..3 {
        let ([ax, ay], [bx, by]) = (corners[k], corners[(k + 1) % 3]);
        let (ex, ey, wx, wy) = (bx - ax, by - ay, px - ax, py - ay);
        let t = ((wx * ex + wy * ey) / (ex * ex + ey * ey).max(1e-30)).clamp(0.0, 1.0);
        let (dx, dy) = (wx - t * ex, wy - t * ey);
        let distance2 = dx * dx + dy * dy;
        if distance2 < best.0 {
            let mut weights = [0.0; 3];
            weights[k] = 1.0 - t;
            weights[(k + 1) % 3] = t;
            best = (distance2, [dx, dy], weights);
        }
        let side = ex * wy - ey * wx;
        positive &= side >= 0.0;
        negative &= side <= 0.0;
    }
    let sign = if positive || negative { 1.0 } else { -1.0 };
    Closest { signed2: sign * best.0, delta: best.1, weights: best.2 }
}

impl Scalar<'_> {
    /// Calls `visit(face, pixel, closest)` for the pairs of one view, `[vertices, 3]`.
    fn walk(&self, vertices: &[f32], mut visit: impl FnMut(usize, usize, &Closest)) {
        let size = self.size as f32;
        for (index, face) in self.faces.iter().enumerate() {
            let corners = face.map(|v| [vertices[3 * v as usize], vertices[3 * v as usize + 1]]);
            let range = |axis: usize, sign: f32| {
                let at = corners.map(|corner| sign * corner[axis]);
                let low = at.into_iter().fold(f32::MAX, f32::min) - self.radius;
                let high = at.into_iter().fold(f32::MIN, f32::max) + self.radius;
                let start = (((low + 1.0) * size - 1.0) / 2.0).ceil().clamp(0.0, size);
                let end = (((high + 1.0) * size - 1.0) / 2.0).floor().clamp(-1.0, size - 1.0);
                start as usize..(end + 1.0) as usize
            };
            for row in range(1, -1.0) {
                let py = (size - 2.0 * row as f32 - 1.0) / size;
                for column in range(0, 1.0) {
                    let px = (2.0 * column as f32 + 1.0 - size) / size;
                    let closest = closest(&corners, px, py);
                    if closest.signed2 > -self.radius * self.radius {
                        visit(index, row * self.size + column, &closest);
                    }
                }
            }
        }
    }

    /// Sums of the optical depth, `[views, size, size]`; `vertices` is `[views, count, 3]`.
    pub(crate) fn forward(&self, vertices: &[f32], count: usize) -> Vec<f32> {
        let pixels = self.size * self.size;
        let mut sums = vec![0.0; vertices.len() / 3 / count * pixels];
        for (vertices, sums) in vertices.chunks(3 * count).zip(sums.chunks_mut(pixels)) {
            self.walk(vertices, |_, pixel, closest| {
                let u = closest.signed2 / self.scale;
                sums[pixel] += u.max(0.0) + (-u.abs()).exp().ln_1p();
            });
        }
        sums
    }

    /// Gradient of `Σ upstream · sums` with respect to the vertices, shaped like them.
    pub(crate) fn gradient(&self, vertices: &[f32], count: usize, upstream: &[f32]) -> Vec<f32> {
        let mut grad = vec![0.0; vertices.len()];
        let views = vertices.chunks(3 * count).zip(grad.chunks_mut(3 * count));
        for ((vertices, grad), upstream) in views.zip(upstream.chunks(self.size * self.size)) {
            self.walk(vertices, |face, pixel, closest| {
                let u = closest.signed2 / self.scale;
                let slope = upstream[pixel] / (1.0 + (-u).exp()) / self.scale;
                let pull = -2.0 * slope * closest.signed2.signum();
                for (corner, weight) in self.faces[face].iter().zip(closest.weights) {
                    grad[3 * *corner as usize] += pull * weight * closest.delta[0];
                    grad[3 * *corner as usize + 1] += pull * weight * closest.delta[1];
                }
            });
        }
        grad
    }
}
