use softrast_mesh::Mesh;
use softrast_raster::{HostBackend, Pinhole, Pinholes, hard_silhouette, project, vertex_tensor};
use softrast_tensor::numbers;
use softrast_views::Frame;

/// The hard silhouette of a mesh in a camera: its pixels, row by row from the top. Mesh and camera may be anywhere, in any unit.
///
/// ```
/// use softrast_inverse::silhouette_pixels;
/// use softrast_mesh::icosphere;
/// use softrast_raster::Pinhole;
///
/// let camera = Pinhole::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0, 8);
/// let pixels = silhouette_pixels(&icosphere(2), &camera);
/// assert_eq!((pixels[0], pixels[8 * 4 + 4]), (0.0, 1.0));
/// ```
pub fn silhouette_pixels(mesh: &Mesh, camera: &Pinhole) -> Vec<f64> {
    let device = Default::default();
    let frame = Frame::of_cameras(mesh, [camera]);
    let positions: Vec<[f64; 3]> = mesh.positions().iter().map(|&p| frame.point(p)).collect();
    let corners = vertex_tensor::<HostBackend>(&positions, &device);
    let seen = project(corners, Pinholes::new(&[frame.camera(camera)], &device));
    numbers(hard_silhouette(seen, mesh.faces(), camera.size))
}
