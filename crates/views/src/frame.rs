use softrast_mesh::{
    Mesh,
    vectors::{difference, norm},
};
use softrast_raster::Pinhole;

/// Least unit of a frame derived from depths, relative to the largest depth: the near plane is at a hundredth of that unit.
const LEAST_DEPTH: f64 = 1e-2;

/// A coordinate system with its own origin and unit.
///
/// Images are computed in 32 bits, with a near plane at a fixed depth. Cameras in metres of a map or in thousandths of a unit would lose
/// digits and depth there. A problem is therefore moved into a frame in 64 bits, solved, and moved back. Images are the same: a frame
/// changes neither the rotation of cameras nor positions in an image.
///
/// ```
/// use softrast_views::Frame;
/// use softrast_mesh::icosphere;
/// use softrast_raster::Pinhole;
///
/// let map = Frame { middle: [4e5, 5e6, 120.0], unit: 2.0 };
/// let ball = icosphere(1);
/// let placed = map.mesh_to_world(&ball)?;
/// assert_eq!(Frame::of_mesh(&placed).middle, map.middle);
/// let camera = Pinhole::look_at([4e5, 5e6, 110.0], map.middle, [0.0, 1.0, 0.0], 40.0, 64);
/// let seen = map.camera(&camera).transform([0.0; 3]);
/// assert!((seen[2] - 5.0).abs() < 1e-9, "ten world units ahead are five");
/// # Ok::<(), softrast_mesh::MeshError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The origin of the frame, in world units.
    pub middle: [f64; 3],
    /// The unit of the frame, in world units; above 0.
    pub unit: f64,
}

impl Frame {
    /// The frame in which the middle of the bounding box of a mesh is the origin, and its farthest vertex from there has distance 1. Unused
    /// vertices are ignored. A mesh without extent has unit 1.
    pub fn of_mesh(mesh: &Mesh) -> Self {
        let (middle, radius) = bounding_ball(mesh);
        Self { middle, unit: if radius > 0.0 { radius } else { 1.0 } }
    }

    /// The frame around the middle of a mesh in which no vertex in front of a camera has a depth below 1, or below a hundredth of the
    /// largest depth. Cameras may therefore be far away or between the parts of the mesh.
    pub fn of_cameras<'a>(mesh: &Mesh, cameras: impl IntoIterator<Item = &'a Pinhole>) -> Self {
        let corners: Vec<[f64; 3]> = mesh.triangles().flatten().collect();
        let unit =
            |camera: &Pinhole| unit_of_depths(corners.iter().map(|&p| camera.transform(p)[2]));
        let least = cameras.into_iter().map(unit).fold(f64::INFINITY, f64::min);
        Self { unit: if least.is_finite() { least } else { 1.0 }, ..Self::of_mesh(mesh) }
    }

    /// Transforms a world point to the frame.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|k| (p[k] - self.middle[k]) / self.unit)
    }

    /// Transforms a world mesh to the frame.
    ///
    /// A vertex that would overflow 32 bits there, which is unused if the frame is that of the mesh, is clamped.
    ///
    /// # Panics
    ///
    /// If the frame has a number that is not finite.
    #[must_use]
    pub fn mesh(&self, mesh: &Mesh) -> Mesh {
        let held = |x: f64| x.clamp(f64::from(f32::MIN), f64::from(f32::MAX));
        let place = |&p: &[f64; 3]| self.point(p).map(held);
        let positions = mesh.positions().iter().map(place).collect();
        mesh.with_positions(positions).expect("all numbers fit into 32 bits")
    }

    /// Transforms a mesh of the frame to the world.
    ///
    /// # Errors
    ///
    /// If a vertex overflows 32 bits there.
    pub fn mesh_to_world(&self, mesh: &Mesh) -> Result<Mesh, softrast_mesh::MeshError> {
        let place = |p: &[f64; 3]| [0, 1, 2].map(|k| self.middle[k] + self.unit * p[k]);
        mesh.with_positions(mesh.positions().iter().map(place).collect())
    }

    /// Transforms a world camera to the frame.
    #[must_use]
    pub fn camera(&self, camera: &Pinhole) -> Pinhole {
        Pinhole { translation: camera.transform(self.middle).map(|x| x / self.unit), ..*camera }
    }

    /// Transforms a camera of the frame to the world.
    #[must_use]
    pub fn camera_to_world(&self, camera: &Pinhole) -> Pinhole {
        let turned =
            camera.rotation.map(|row| (0..3).map(|k| row[k] * self.middle[k]).sum::<f64>());
        let translation = [0, 1, 2].map(|k| camera.translation[k] * self.unit - turned[k]);
        Pinhole { translation, ..*camera }
    }
}

/// The middle of the bounding box of a mesh, and the distance of its farthest vertex from there, in the unit of the mesh. Unused vertices
/// are ignored.
///
/// ```
/// use softrast_mesh::icosphere;
/// use softrast_views::bounding_ball;
///
/// let (middle, radius) = bounding_ball(&icosphere(1));
/// assert_eq!(middle, [0.0; 3]);
/// assert!((radius - 1.0).abs() < 1e-12);
/// ```
pub fn bounding_ball(mesh: &Mesh) -> ([f64; 3], f64) {
    let [low, high] = mesh.bounds();
    let middle = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
    let distance = |p: [f64; 3]| norm(difference(p, middle));
    (middle, mesh.triangles().flatten().map(distance).fold(0.0, f64::max))
}

/// The least depth in front of a camera, or a hundredth of the largest if that is more; 1 if there is none.
fn unit_of_depths(depths: impl Iterator<Item = f64>) -> f64 {
    let before = depths.filter(|&depth| depth > 0.0);
    let [least, largest] = before.fold([f64::INFINITY, 0.0], |[least, largest], depth| {
        [depth.min(least), depth.max(largest)]
    });
    if largest > 0.0 { least.max(LEAST_DEPTH * largest) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use softrast_mesh::icosphere;

    use super::*;

    #[test]
    fn cameras_of_a_frame_see_the_same() {
        let frame = Frame { middle: [4e5, -5e6, 7.0], unit: 1e-3 };
        let camera = Pinhole::look_at(
            [4e5 + 0.003, -5e6 + 0.002, 7.0],
            frame.middle,
            [0.0, 0.0, 1.0],
            40.0,
            [90, 120],
        );
        let moved = frame.camera(&camera);
        for p in [[4e5 + 1e-3, -5e6, 7.0], [4e5, -5e6 - 1e-3, 7.002]] {
            let (here, there) = (moved.pixel(frame.point(p)), camera.pixel(p));
            assert!(
                (here[0] - there[0]).abs().max((here[1] - there[1]).abs()) < 1e-3,
                "{here:?} {there:?}"
            );
            assert!((here[2] * frame.unit - there[2]).abs() < 1e-8);
        }
        let back = frame.camera_to_world(&moved);
        assert!((0..3).all(|k| (back.translation[k] - camera.translation[k]).abs() < 1e-8));
    }

    #[test]
    fn a_mesh_comes_back_from_its_frame() {
        let place = |p: &[f64; 3]| [4e5 + 0.01 * p[0], 5e6 + 0.01 * p[1], 0.01 * p[2]];
        let ball = icosphere(2);
        let map = ball.with_positions(ball.positions().iter().map(place).collect()).unwrap();
        let frame = Frame::of_mesh(&map);
        let framed = frame.mesh(&map);
        let farthest = |p: &[f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
        let radius = framed.positions().iter().map(farthest).fold(0.0, f64::max);
        assert!((radius - 1.0).abs() < 1e-12);
        let back = frame.mesh_to_world(&framed).unwrap();
        let pairs = back.positions().iter().flatten().zip(map.positions().iter().flatten());
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 2e-9));
    }

    #[test]
    fn vertices_without_a_face_stay_finite() {
        let positions = vec![[0.0; 3], [1e-6, 0.0, 0.0], [0.0, 1e-6, 0.0], [1e38, 0.0, 0.0]];
        let mesh = Mesh::new(positions, vec![[0, 1, 2]]).unwrap();
        assert!(
            Frame::of_mesh(&mesh)
                .mesh(&mesh)
                .positions()
                .as_flattened()
                .iter()
                .all(|x| (*x as f32).is_finite())
        );
    }

    #[test]
    fn the_unit_of_cameras_is_the_least_depth_before_them() {
        let ball = icosphere(1);
        let at = |z: f64| Pinhole::look_at([0.0, 0.0, z], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 8);
        let unit = Frame::of_cameras(&ball, &[at(4.0), at(3.0)]).unit;
        assert!((unit - 2.0).abs() < 0.1, "{unit}");
        // Inside the mesh, and with nothing in front.
        assert!(Frame::of_cameras(&ball, &[at(0.5)]).unit >= 0.01);
        assert_eq!(unit_of_depths([-1.0, 0.0].into_iter()), 1.0);
    }
}
