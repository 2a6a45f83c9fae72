//! Scenes in the image plane.

use std::sync::Arc;

/// Triangles in the image plane: x and y in NDC, and depth.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarScene {
    /// Corners of the faces.
    pub corners: Vec<[f64; 3]>,
    /// Three corners per face.
    pub faces: Arc<[[u32; 3]]>,
}

impl PlanarScene {
    /// Loose triangles, three corners each.
    pub fn loose(corners: Vec<[f64; 3]>) -> Self {
        let faces = (0..corners.len() as u32 / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        Self { corners, faces }
    }

    /// One triangle at depth 2.
    pub fn triangle(corners: [[f64; 2]; 3]) -> Self {
        Self::loose(corners.map(|[x, y]| [x, y, 2.0]).into())
    }

    /// A triangle of about a third of the image, aligned with no axis or pixel.
    pub fn plain() -> Self {
        Self::triangle([[-0.61, -0.47], [0.73, -0.33], [0.08, 0.69]])
    }

    /// `count` triangles of all sizes all over the image.
    pub fn random(seed: u64, count: usize) -> Self {
        let mut random = Random::new(seed);
        let corners = (0..count).flat_map(|_| {
            let centre = [random.within(1.1), random.within(1.1)];
            let (reach, depth) = (0.1 + 0.4 * random.unit(), 1.5 + random.unit());
            let turn = random.within(3.2);
            [0.0, 2.1, 4.1].map(|angle: f64| {
                let (sin, cos) = (turn + angle).sin_cos();
                [centre[0] + reach * cos, centre[1] + reach * sin, depth]
            })
        });
        Self::loose(corners.collect())
    }

    /// A stack of `count` copies of one face.
    pub fn stack(count: usize) -> Self {
        let one = Self::plain().corners;
        Self::loose((0..count).flat_map(|_| one.clone()).collect())
    }

    /// The square from -0.5 to 0.5 as `2 side²` triangles.
    pub fn grid(side: usize) -> Self {
        let at = |k: usize| k as f64 / side as f64 - 0.5;
        let cell = |k: usize| {
            let (x, y) = (k % side, k / side);
            let [a, b] = [at(x), at(x + 1)];
            let [c, d] = [at(y), at(y + 1)];
            [[a, c], [b, c], [b, d], [a, c], [b, d], [a, d]].map(|[x, y]| [x, y, 2.0])
        };
        Self::loose((0..side * side).flat_map(cell).collect())
    }

    /// This scene with every image coordinate multiplied by `factor`.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.corners.iter_mut().for_each(|p| {
            p[0] *= factor;
            p[1] *= factor;
        });
        self
    }
}

/// Reproducible pseudorandom numbers (`SplitMix64`).
pub struct Random(u64);

impl Random {
    /// The generator of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0xd134_2543_de82_ef95).wrapping_add(1))
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number from `-reach` to `reach`.
    pub fn within(&mut self, reach: f64) -> f64 {
        reach * (2.0 * self.unit() - 1.0)
    }
}
