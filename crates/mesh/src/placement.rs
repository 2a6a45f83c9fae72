//! Placement of the mesh of a node in a glTF tree.

use crate::{
    gltf::Node,
    vectors::{cross, dot, rotation},
};

/// `p ↦ linear p + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    /// In row-major order.
    linear: [[f64; 3]; 3],
    offset: [f64; 3],
}

impl Placement {
    pub(crate) const IDENTITY: Self =
        Self { linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], offset: [0.0; 3] };

    /// The placement of a node relative to its parent.
    ///
    /// Source: glTF 2.0 specification, Sec. 3.5.3: scaled, then rotated, then translated; or a matrix.
    pub(crate) fn of(node: &Node) -> Self {
        let each = [0, 1, 2];
        if let Some(m) = &node.matrix {
            return Self {
                linear: each.map(|i| each.map(|j| m[4 * j + i])),
                offset: each.map(|i| m[12 + i]),
            };
        }
        let [x, y, z, w] = node.rotation.as_deref().copied().unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let scale = node.scale.as_deref().copied().unwrap_or([1.0; 3]);
        Self {
            linear: rotation([w, x, y, z]).map(|row| each.map(|j| row[j] * scale[j])),
            offset: node.translation.as_deref().copied().unwrap_or_default(),
        }
    }

    /// First `local`, then `self`: the placement of a child.
    pub(crate) fn then_local(&self, local: &Self) -> Self {
        let column = |j: usize| [0, 1, 2].map(|k| local.linear[k][j]);
        let linear = self.linear.map(|row| [0, 1, 2].map(|j| dot(row, column(j))));
        Self { linear, offset: self.apply(local.offset) }
    }

    pub(crate) fn apply(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| dot(self.linear[i], p) + self.offset[i])
    }

    /// Whether it is a reflection.
    pub(crate) fn mirrors(&self) -> bool {
        let [a, b, c] = self.linear;
        dot(cross(a, b), c) < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrix_and_its_parts_place_alike() {
        // Twice as large along x, a quarter turn about z, then one step along y.
        let half = 0.5f64.sqrt();
        let parts = Node {
            mesh: None,
            children: vec![],
            matrix: None,
            translation: Some(Box::new([0.0, 1.0, 0.0])),
            rotation: Some(Box::new([0.0, 0.0, half, half])),
            scale: Some(Box::new([2.0, 1.0, 1.0])),
        };
        let matrix = [0., 2., 0., 0., -1., 0., 0., 0., 0., 0., 1., 0., 0., 1., 0., 1.];
        let whole = Node {
            matrix: Some(Box::new(matrix)),
            translation: None,
            rotation: None,
            scale: None,
            children: vec![],
            mesh: None,
        };
        for node in [parts, whole] {
            let placed = Placement::of(&node).apply([1.0, 5.0, 7.0]);
            let expected = [-5.0, 3.0, 7.0];
            assert!((0..3).all(|k| (placed[k] - expected[k]).abs() < 1e-14), "{placed:?}");
        }
    }
}
