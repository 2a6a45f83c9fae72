use burn::tensor::{Tensor, TensorData, backend::Backend};

use crate::{NEAR, kernel::inside_spans};

/// Hard silhouettes: 1 where the centre of a pixel lies in a face (edges included), else 0.
///
/// `vertices` `[views, vertices, 3]`: x and y in NDC, depth. The result is `[views, size, size]`,
/// top row first, in the float type of `vertices`; it has no gradient. Used for targets and metrics.
/// Faces that the soft rasterizer does not draw are not drawn here either.
///
/// Source: docs/notes.md, Pixels.
///
/// # Panics
///
/// If a face uses a vertex that is not there, or the backend cannot be read synchronously.
pub fn hard_silhouette<B: Backend>(
    vertices: Tensor<B, 3>,
    faces: &[[u32; 3]],
    size: usize,
) -> Tensor<B, 3> {
    let [views, _, _] = vertices.dims();
    let (device, dtype) = (vertices.device(), vertices.dtype());
    let vertices: Vec<f64> = vertices.swap_dims(1, 2).into_data().iter().collect();
    let image = TensorData::new(covered(&vertices, views, faces, size), [views, size, size]);
    Tensor::from_data(image, (&device, dtype))
}

/// The images of `vertices` `[views, 3, vertices]`.
fn covered(vertices: &[f64], views: usize, faces: &[[u32; 3]], size: usize) -> Vec<f64> {
    let mut image = vec![0.0; views * size * size];
    let length = (vertices.len() / views.max(1)).max(1);
    for (vertices, image) in vertices.chunks(length).zip(image.chunks_mut(size * size)) {
        for face in faces {
            inside_spans(vertices, face, NEAR, size, |row, start, end| {
                image[row * size + start..row * size + end].fill(1.0);
            });
        }
    }
    image
}
