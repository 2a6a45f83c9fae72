use std::sync::Arc;

use softrast_mesh::icosphere;
use softrast_tensor::{Backend, Tensor, tensor_on};

/// A coordinate this near to a plane through the origin, in world units, remains in that plane: its
/// log-odds would be close to minus infinity.
const ON_PLANE: f64 = 1e-6;
/// Radius of the sphere before it is deformed, and the factor of everything at the end.
///
/// Source: docs/notes.md, Reconstruction.
const RADIUS: f64 = 0.5;
const OUTPUT: f64 = 0.5;

/// The sphere of 642 vertices that a network deforms.
///
/// A coordinate at `v` on the sphere of radius 0.5, moved by `d`, ends at `(s·σ(logit|v| + d)·(1 - s·c) +
/// c) / 2` with `s` the sign of `v` and `c` the tanh of the centre: within ±0.5, and never across the
/// planes through the centre. A coordinate of 0 is that of the centre. Source: docs/notes.md, 3D shape.
#[derive(Clone, Debug)]
pub struct Template<B: Backend> {
    /// `logit |v|` of each coordinate, `[1, 3, vertices]`; 0 if the sign is 0.
    log_odds: Tensor<B, 3>,
    /// -1, 0 or 1, `[1, 3, vertices]`.
    sign: Tensor<B, 3>,
    faces: Arc<[[u32; 3]]>,
}

impl<B: Backend> Template<B> {
    /// The sphere.
    pub fn new(device: &B::Device) -> Self {
        let sphere = icosphere(3);
        let on_plane = |v: f64| v.abs() < ON_PLANE;
        let log_odds = |v: f64| if on_plane(v) { 0.0 } else { (v.abs() / (1.0 - v.abs())).ln() };
        let sign = |v: f64| if on_plane(v) { 0.0 } else { v.signum() };
        let planes = |of: &dyn Fn(f64) -> f64| {
            let vertices = sphere.positions();
            let values = (0..3).flat_map(|k| vertices.iter().map(move |p| of(RADIUS * p[k])));
            tensor_on(values.collect(), [1, 3, vertices.len()], device)
        };
        Self { log_odds: planes(&log_odds), sign: planes(&sign), faces: sphere.faces().into() }
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.sign.dims()[2]
    }

    /// The faces, the same for the sphere and every deformed shape.
    pub fn faces(&self) -> &Arc<[[u32; 3]]> {
        &self.faces
    }

    /// The vertices, `[shapes, 3, vertices]` in world units, for centres `[shapes, 3]` and
    /// displacements `[shapes, 3, vertices]`.
    pub fn deformed(&self, centre: Tensor<B, 2>, displacement: Tensor<B, 3>) -> Tensor<B, 3> {
        let [shapes, _] = centre.dims();
        let centre = centre.tanh().reshape([shapes, 3, 1]);
        let size = ((displacement + self.log_odds.clone()) * 0.5).tanh() * 0.5 + 0.5;
        let sign = self.sign.clone();
        let away = sign.clone() - sign.clone() * sign * centre.clone();
        (size * away + centre) * OUTPUT
    }
}

/// Points from planes `[3 * vertices]`, all x first.
pub(crate) fn points(planes: &[f64]) -> Vec<[f64; 3]> {
    let count = planes.len() / 3;
    (0..count).map(|v| [0, 1, 2].map(|k| planes[k * count + v])).collect()
}
