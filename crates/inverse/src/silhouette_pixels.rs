use softrast_mesh::Mesh;
use softrast_raster::{HostBackend, Pinhole, Pinholes, hard_silhouette, project, vertices};
use softrast_tensor::numbers;
use softrast_views::Frame;

/// The hard silhouette of a mesh in a camera: its pixels, row by row from the top. Mesh and camera may be anywhere, in any unit.
pub fn silhouette_pixels(mesh: &Mesh, camera: &Pinhole) -> Vec<f64> {
    let device = Default::default();
    let frame = Frame::of_cameras(mesh, [camera]);
    let positions: Vec<[f64; 3]> = mesh.positions().iter().map(|&p| frame.point(p)).collect();
    let corners = vertices::<HostBackend>(&positions, &device);
    let seen = project(corners, Pinholes::new(&[frame.camera(camera)], &device));
    numbers(hard_silhouette(seen, mesh.faces(), camera.size))
}
