use std::sync::atomic::{AtomicU8, Ordering};

use rayon::prelude::*;
use softrast_kernel::{inside_spans, is_seen_clockwise};
use softrast_tensor::{Backend, Tensor, TensorData};

use crate::{ImageSize, NEAR, Projected};

/// Faces per rayon task.
const AT_ONCE: usize = 1 << 10;

/// Hard silhouettes: 1 where the centre of a pixel lies in a face (edges included), else 0.
///
/// The result is `[views, height, width]`, top row first, in the float type of `vertices`; it has no gradient. Used for targets and
/// metrics. Faces that the soft rasterizer culls are not drawn here either.
///
/// Source: docs/notes.md, Pixels.
///
/// # Panics
///
/// If a vertex number of a face is out of range, or the backend cannot be read synchronously.
pub fn hard_silhouette<B: Backend>(
    vertices: Projected<B>,
    faces: &[[u32; 3]],
    size: impl Into<ImageSize>,
) -> Tensor<B, 3> {
    let (vertices, size) = (vertices.tensor(), size.into());
    let [views, _, _] = vertices.dims();
    let (device, dtype) = (vertices.device(), vertices.dtype());
    let vertices: Vec<f64> = vertices.swap_dims(1, 2).into_data().iter().collect();
    let image = covered(&vertices, views, faces, size);
    let shape = [views, size.height, size.width];
    Tensor::from_data(TensorData::new(image, shape), (&device, dtype))
}

/// Hard coverage, `[views, height, width]` in [0, 1], top row first: the fraction of `samples` × `samples` points, evenly spaced in each
/// pixel, that lie in a face (edges included). It has no gradient. One sample gives [`hard_silhouette`].
///
/// # Panics
///
/// If `samples` is 0, a vertex number of a face is out of range, or the backend cannot be read synchronously.
pub fn hard_coverage<B: Backend>(
    vertices: Projected<B>,
    faces: &[[u32; 3]],
    size: impl Into<ImageSize>,
    samples: usize,
) -> Tensor<B, 3> {
    hard_coverage_of(vertices, faces, size.into(), samples, false)
}

/// [`hard_coverage`], optionally without back faces.
pub(crate) fn hard_coverage_of<B: Backend>(
    vertices: Projected<B>,
    faces: &[[u32; 3]],
    size: ImageSize,
    samples: usize,
    culls: bool,
) -> Tensor<B, 3> {
    assert!(samples > 0, "hard coverage takes a sample");
    let vertices = vertices.tensor();
    let [views, count, _] = vertices.dims();
    let (device, dtype) = (vertices.device(), vertices.dtype());
    let vertices: Vec<f64> = vertices.swap_dims(1, 2).into_data().iter().collect();
    let fine: ImageSize = [samples * size.height, samples * size.width].into();
    let covers: Vec<AtomicU8> = (0..views * fine.pixels()).map(|_| AtomicU8::new(0)).collect();
    for (covers, vertices) in covers.chunks(fine.pixels()).zip(vertices.chunks((3 * count).max(1)))
    {
        faces.par_iter().with_min_len(AT_ONCE).for_each(|face| {
            let corner = |v: u32| [vertices[v as usize], vertices[count + v as usize]];
            if culls && is_seen_clockwise(face.map(corner)) {
                return;
            }
            inside_spans(vertices, face, NEAR, fine, |row, start, end| {
                let places = &covers[row * fine.width + start..row * fine.width + end];
                // All threads write the same value.
                places.iter().for_each(|place| place.store(1, Ordering::Relaxed));
            });
        });
    }
    let part = 1.0 / (samples * samples) as f32;
    let rows = covers.par_chunks(samples * fine.width);
    let image: Vec<f32> = rows
        .flat_map_iter(|rows| {
            (0..size.width).map(move |column| {
                let of_row = |row: &[AtomicU8]| -> u32 {
                    let places = &row[samples * column..samples * (column + 1)];
                    places.iter().map(|place| u32::from(place.load(Ordering::Relaxed))).sum()
                };
                rows.chunks(fine.width).map(of_row).sum::<u32>() as f32 * part
            })
        })
        .collect();
    let shape = [views, size.height, size.width];
    Tensor::from_data(TensorData::new(image, shape), (&device, dtype))
}

/// The nearest face at the centre of each pixel, edges included, row by row from the top, view after view; `None` where there is no face.
///
/// The depth of a face there is that of its plane in perspective, as in [`blended`](crate::reference::blended). The first of equally near
/// faces is used. Faces that the soft rasterizer culls are excluded.
///
/// Source: docs/notes.md, Colour.
///
/// ```
/// use softrast_raster::{HostBackend, Projected, nearest_faces, vertex_tensor};
///
/// // The second face is in front of the first.
/// let corner = |depth: f64| [[-2.0, -2.0, depth], [2.0, -2.0, depth], [0.0, 4.0, depth]];
/// let corners = vertex_tensor::<HostBackend>(&[corner(2.0), corner(1.0)].concat(), &Default::default());
/// assert_eq!(nearest_faces(Projected::new(corners), &[[0, 1, 2], [3, 4, 5]], 1), [Some(1)]);
/// ```
///
/// # Panics
///
/// If a vertex number of a face is out of range, or the backend cannot be read synchronously.
pub fn nearest_faces<B: Backend>(
    vertices: Projected<B>,
    faces: &[[u32; 3]],
    size: impl Into<ImageSize>,
) -> Vec<Option<u32>> {
    let size = size.into();
    let vertices = vertices.tensor();
    let [views, count, _] = vertices.dims();
    let vertices: Vec<f64> = vertices.swap_dims(1, 2).into_data().iter().collect();
    let mut nearest = vec![(0.0, None); views * size.pixels()];
    let views = nearest.chunks_mut(size.pixels()).zip(vertices.chunks((3 * count).max(1)));
    for (nearest, vertices) in views {
        for (k, face) in faces.iter().enumerate() {
            let corners = face.map(|v| [0, 1, 2].map(|axis| vertices[axis * count + v as usize]));
            let closeness = closeness(corners);
            inside_spans(vertices, face, NEAR, size, |row, start, end| {
                let y = size.row_centre(row);
                for column in start..end {
                    let here = closeness([size.column_centre(column), y]);
                    let seen = &mut nearest[row * size.width + column];
                    if here > seen.0 {
                        *seen = (here, Some(k as u32));
                    }
                }
            });
        }
    }
    nearest.into_iter().map(|(_, face)| face).collect()
}

/// One over the depth of the plane through three corners, which is linear over the image. The face must have an area.
fn closeness(corners: [[f64; 3]; 3]) -> impl Fn([f64; 2]) -> f64 {
    let side = move |k: usize, [x, y]: [f64; 2]| {
        let ([ax, ay, _], [bx, by, _]) = (corners[k], corners[(k + 1) % 3]);
        (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    };
    let area = side(0, [corners[2][0], corners[2][1]]);
    let [first, second, third] = corners.map(|corner| 1.0 / corner[2]);
    // Computed by differences, so that faces of constant depth tie exactly.
    move |place| {
        first + (side(2, place) * (second - first) + side(0, place) * (third - first)) / area
    }
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
