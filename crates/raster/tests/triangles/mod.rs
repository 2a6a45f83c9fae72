//! Random scenes for the fused op, for the GPU and for f64.

use std::sync::Arc;

/// A scene of random triangles, some of them degenerate, off screen or behind the camera.
pub(crate) fn triangles(seed: u64, count: usize) -> (Vec<f64>, Arc<[[u32; 3]]>) {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut random = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut vertices = Vec::new();
    for face in 0..count {
        let centre = [2.4 * random() - 1.2, 2.4 * random() - 1.2];
        let radius = 0.1 + 0.5 * random();
        for corner in 0..3 {
            let angle = std::f64::consts::TAU * (f64::from(corner) / 3.0 + 0.2 * random());
            vertices.extend([
                centre[0] + radius * angle.cos(),
                centre[1] + radius * angle.sin(),
                if face % 7 == 3 { -1.0 } else { 2.0 },
            ]);
        }
        if face % 5 == 4 {
            // A sliver: the third corner almost on the first edge.
            let at = vertices.len() - 9;
            for axis in 0..2 {
                vertices[at + 6 + axis] =
                    0.3 * vertices[at + axis] + 0.7 * vertices[at + 3 + axis] + 1e-9;
            }
        }
    }
    let faces = (0..count as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    (vertices, faces)
}
