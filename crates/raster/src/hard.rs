use burn::tensor::{Tensor, TensorData, backend::Backend};
use rayon::prelude::*;

use crate::{ImageSize, NEAR, kernel::inside_spans};

/// Hard silhouettes: 1 where the centre of a pixel lies in a face (edges included), else 0.
///
/// `vertices` `[views, vertices, 3]`: x and y in NDC, depth. The result is `[views, height, width]`,
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
    size: impl Into<ImageSize>,
) -> Tensor<B, 3> {
    let size = size.into();
    let [views, _, _] = vertices.dims();
    let (device, dtype) = (vertices.device(), vertices.dtype());
    let vertices: Vec<f64> = vertices.swap_dims(1, 2).into_data().iter().collect();
    let image = covered(&vertices, views, faces, size);
    let shape = [views, size.height, size.width];
    Tensor::from_data(TensorData::new(image, shape), (&device, dtype))
}

/// The images of `vertices` `[views, 3, vertices]`.
fn covered(vertices: &[f64], views: usize, faces: &[[u32; 3]], size: ImageSize) -> Vec<f32> {
    let mut image = vec![0.0; views * size.pixels()];
    let length = (vertices.len() / views.max(1)).max(1);
    let views = image.par_chunks_mut(size.pixels()).zip(vertices.par_chunks(length));
    views.for_each(|(image, vertices)| {
        for face in faces {
            inside_spans(vertices, face, NEAR, size, |row, start, end| {
                image[row * size.width + start..row * size.width + end].fill(1.0);
            });
        }
    });
    image
}
