use crate::Texture;

/// A textured rectangle that faces the camera. Its depth is optimised and stored separately.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quad {
    /// Centre in NDC (the image is [-1, 1]², x right, y up).
    pub centre: [f64; 2],
    /// Half of its width and of its height, in NDC.
    pub half: [f64; 2],
    /// Rotation in degrees, counterclockwise.
    pub angle_deg: f64,
    /// Texture of the rectangle.
    pub texture: Texture,
}

impl Quad {
    /// Signed distance to the outline in NDC, positive inside.
    pub fn distance(&self, place: [f64; 2]) -> f64 {
        let local = self.local(place);
        let [x, y] = [0, 1].map(|axis| local[axis].abs() - self.half[axis]);
        if x <= 0.0 && y <= 0.0 { -x.max(y) } else { -x.max(0.0).hypot(y.max(0.0)) }
    }

    /// Colour at a place in NDC, see [`Texture::colour_at`].
    pub fn colour_at(&self, place: [f64; 2]) -> [f64; 3] {
        let local = self.local(place);
        self.texture.colour_at([0, 1].map(|axis| local[axis] / self.half[axis]))
    }

    /// The corners in NDC, counterclockwise.
    pub fn corners(&self) -> [[f64; 2]; 4] {
        let (sin, cos) = self.angle_deg.to_radians().sin_cos();
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[u, v]| {
            let (x, y) = (u * self.half[0], v * self.half[1]);
            [self.centre[0] + cos * x - sin * y, self.centre[1] + sin * x + cos * y]
        })
    }

    /// A place relative to the centre, along the sides.
    fn local(&self, place: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = self.angle_deg.to_radians().sin_cos();
        let [x, y] = [0, 1].map(|axis| place[axis] - self.centre[axis]);
        [cos * x + sin * y, cos * y - sin * x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pattern;

    fn quad(angle_deg: f64) -> Quad {
        let texture = Texture { colour: [1.0; 3], pattern: Pattern::Stripes, fields: 2 };
        Quad { centre: [0.1, -0.2], half: [0.4, 0.3], angle_deg, texture }
    }

    #[test]
    fn distances_are_to_the_nearest_point_of_the_outline() {
        for (place, expected) in [
            ([0.1, -0.2], 0.3),
            ([0.4, -0.2], 0.1),
            ([0.5, 0.0], 0.0),
            ([0.7, -0.2], -0.2),
            ([0.8, 0.5], -0.5),
        ] {
            let found = quad(0.0).distance(place);
            assert!((found - expected).abs() < 1e-12, "{place:?}: {found}");
        }
        assert!((quad(90.0).distance([0.1, 0.5]) + 0.3).abs() < 1e-12);
    }

    #[test]
    fn corners_lie_on_the_outline_and_turn_with_the_texture() {
        for angle_deg in [0.0, 30.0, -75.0] {
            let quad = quad(angle_deg);
            assert!(quad.corners().iter().all(|&corner| quad.distance(corner).abs() < 1e-12));
            let [a, b, ..] = quad.corners();
            let along = |t: f64| [0, 1].map(|k| a[k] + t * (b[k] - a[k]));
            assert_eq!(quad.colour_at(along(0.25)), [1.0; 3]);
            assert_ne!(quad.colour_at(along(0.75)), [1.0; 3]);
        }
    }
}
