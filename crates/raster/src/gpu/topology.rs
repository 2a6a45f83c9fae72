use softrast_tensor::gpu::{CubeRuntime, CubeTensor, cubecl::prelude::*};

use super::kept::Kept;

/// The faces of an op on a device: uploaded by its first pass there, cached for later ones.
#[derive(Clone, Debug, Default)]
pub(crate) struct Topology(Kept);

/// Vertices of faces, and faces of vertices.
#[derive(Clone)]
pub(super) struct OnDevice<R: CubeRuntime> {
    /// `[faces, 3]`: the vertices of each face.
    pub(super) faces: CubeTensor<R>,
    /// `[vertices + 1 + 3 faces]`: the offset of each vertex's first corner, then the corners, each as `3 * face + corner`, in ascending
    /// order.
    pub(super) corners: CubeTensor<R>,
    vertex_count: usize,
}

impl Topology {
    /// The faces over `vertex_count` vertices on the device of `client`.
    pub(super) fn on<R: CubeRuntime>(
        &self,
        faces: &[[u32; 3]],
        vertex_count: usize,
        client: &ComputeClient<R>,
        device: &R::Device,
    ) -> OnDevice<R> {
        let upload = || OnDevice::new(faces, vertex_count, client, device);
        match self.0.get_or_set(|| (device.clone(), upload())) {
            Some((kept_on, kept)) if kept_on == device && kept.vertex_count == vertex_count => {
                kept.clone()
            }
            _ => upload(),
        }
    }
}

impl<R: CubeRuntime> OnDevice<R> {
    fn new(
        faces: &[[u32; 3]],
        vertex_count: usize,
        client: &ComputeClient<R>,
        device: &R::Device,
    ) -> Self {
        let tensor = |values: &[u32]| {
            CubeTensor::new_contiguous(
                client.clone(),
                device.clone(),
                [values.len()].into(),
                client.create_from_slice(u32::as_bytes(values)),
                softrast_tensor::DType::U32,
            )
        };
        let corners = corners_of_vertices(faces.as_flattened(), vertex_count);
        Self { faces: tensor(faces.as_flattened()), corners: tensor(&corners), vertex_count }
    }
}

/// Offsets of the first corners, then the corners, both in the order of vertices.
fn corners_of_vertices(vertices: &[u32], vertex_count: usize) -> Vec<u32> {
    let mut places = vec![0u32; vertex_count + 1];
    for &vertex in vertices {
        places[vertex as usize + 1] += 1;
    }
    for vertex in 0..vertex_count {
        places[vertex + 1] += places[vertex];
    }
    let mut next = places.clone();
    places.resize(vertex_count + 1 + vertices.len(), 0);
    for (corner, &vertex) in vertices.iter().enumerate() {
        places[vertex_count + 1 + next[vertex as usize] as usize] = corner as u32;
        next[vertex as usize] += 1;
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vertex_knows_its_corners_in_order() {
        let found = corners_of_vertices(&[0, 2, 3, 3, 2, 0], 5);
        assert_eq!(found, [0, 2, 2, 4, 6, 6, 0, 5, 1, 4, 2, 3]);
    }
}
