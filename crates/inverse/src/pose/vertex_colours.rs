use std::{cell::RefCell, collections::BTreeMap, sync::Arc};

use softrast_raster::{
    Attributes, ColourRenderer, Projected, RasterBackend, Width, nearest_faces, vertex_tensor,
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family};
use softrast_tensor::{Tensor, TensorData, numbers};

const EDGE: EdgeSoftness = EdgeSoftness::new(Family::Uniform);
/// Half width of the edge of a face, in pixels. A near face outweighs faces behind it within its
/// support, so the support is small (docs/notes.md, Colour).
const EDGE_PX: f64 = 0.1;
const DEPTH: DepthSoftness = DepthSoftness::Family(Family::Exp);
/// A face nearer by this share of the camera's distance has e times the weight.
const DEPTH_SCALE: f64 = 0.01;
/// Depths of nearness 1 and 0, in units of the camera's distance from the origin, which is in the middle of the mesh.
const PLANES: [f64; 2] = [0.0, 2.0];
/// Largest error of a channel.
const TOLERANCE: f64 = 1e-3;

/// The vertex colours of a mesh, for cameras at any distance.
///
/// ```
/// use softrast_inverse::pose::{ColouredViews, VertexColours};
/// use softrast_raster::{HostBackend, Projected, vertex_tensor};
/// use softrast_tensor::{Tensor, numbers};
///
/// // A red face over the whole image is its own target.
/// let corners = [[-9.0, -9.0, 2.0], [9.0, -9.0, 2.0], [0.0, 9.0, 2.0]];
/// let seen = Projected::new(vertex_tensor::<HostBackend>(&corners, &Default::default()));
/// let coat = VertexColours::new(&[[1.0, 0.0, 0.0]; 3], [[0, 1, 2]].into());
/// let red = coat.hard(seen, 4);
/// let views = ColouredViews::new(coat, red.clone(), Tensor::ones([1, 4, 4], &Default::default()));
/// let [own, black] = [red.clone(), red * 0.0].map(|colours| numbers(views.loss(colours))[0]);
/// assert!(own < 1e-9 && black > 1.0);
/// ```
#[derive(Debug)]
pub struct VertexColours<B: RasterBackend> {
    colours: Vec<[f64; 3]>,
    attributes: Attributes<B>,
    faces: Arc<[[u32; 3]]>,
    /// Renderers by pixels a side, cached because of their tables.
    renderers: RefCell<BTreeMap<usize, ColourRenderer>>,
}

impl<B: RasterBackend> VertexColours<B> {
    /// Vertex colours with the faces of their mesh.
    ///
    /// # Panics
    ///
    /// If a face has a vertex without a colour.
    pub fn new(colours: &[[f64; 3]], faces: Arc<[[u32; 3]]>) -> Self {
        let values = vertex_tensor(colours, &Default::default());
        Self {
            colours: colours.to_vec(),
            attributes: Attributes::new(values, faces.clone()),
            faces,
            renderers: RefCell::default(),
        }
    }

    /// The colours of the mesh `[views, 3, side, side]`, hardly softened, over black.
    ///
    /// `seen` `[views, vertices, 3]` holds x and y in NDC and the depth, `distance` `[views, 1]` that of each camera.
    pub fn soft(&self, seen: Projected<B>, distance: Tensor<B, 2>, side: usize) -> Tensor<B, 4> {
        let seen = seen.tensor();
        let [views, count, _] = seen.dims();
        let distance = distance.reshape([views, 1, 1]).expand([views, count, 1]);
        // Perspective is the same in any unit; in this one all meshes lie between the same planes.
        let depth = seen.clone().narrow(2, 2, 1) / distance;
        let seen = Tensor::cat(vec![seen.narrow(2, 0, 2), depth], 2);
        let mut kept = self.renderers.borrow_mut();
        let renderer = kept.entry(side).or_insert_with(|| {
            ColourRenderer::new(&self.faces, side, EDGE, Width::pixels(EDGE_PX), PLANES)
                .with_depth(DEPTH, DEPTH_SCALE / (PLANES[1] - PLANES[0]))
                .with_tolerance(TOLERANCE)
        });
        let background = renderer.background(&[0.0; 3], &seen.device());
        renderer.image(Projected::new(seen), &self.attributes, &background).narrow(1, 0, 3)
    }

    /// The hard colours `[views, 3, size, size]`: at the centre of each pixel the colour of the nearest face. They have no gradient.
    pub fn hard(&self, seen: Projected<B>, size: usize) -> Tensor<B, 4> {
        let nearest = nearest_faces(seen.clone(), &self.faces, size);
        let seen = seen.tensor();
        let [views, count, _] = seen.dims();
        let options = (&seen.device(), seen.dtype());
        let mut image = vec![0.0; 3 * views * size * size];
        let corners = numbers(seen.clone());
        let views_of_pixels = nearest.chunks(size * size).zip(image.chunks_mut(3 * size * size));
        for (corners, (nearest, image)) in corners.chunks(3 * count).zip(views_of_pixels) {
            for (pixel, face) in nearest.iter().enumerate() {
                let Some(face) = *face else { continue };
                let face = self.faces[face as usize].map(|vertex| vertex as usize);
                let centre = |k: usize| (2 * k + 1) as f64 / size as f64 - 1.0;
                let place = [centre(pixel % size), -centre(pixel / size)];
                let weights = in_space(face.map(|v| [0, 1, 2].map(|k| corners[3 * v + k])), place);
                for k in 0..3 {
                    let share = |corner: usize| weights[corner] * self.colours[face[corner]][k];
                    let level: f64 = (0..3).map(share).sum();
                    // By rounding, a centre may lie just outside its face.
                    image[k * size * size + pixel] = level.clamp(0.0, 1.0);
                }
            }
        }
        Tensor::from_data(TensorData::new(image, [views, 3, size, size]), options)
    }
}

/// Barycentric coordinates in space of a point on the screen, for a face with non-zero area in front of the camera.
fn in_space(corners: [[f64; 3]; 3], [x, y]: [f64; 2]) -> [f64; 3] {
    let on_screen = [0, 1, 2].map(|k| {
        let ([ax, ay, _], [bx, by, _]) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
        ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / corners[k][2]
    });
    let sum: f64 = on_screen.iter().sum();
    on_screen.map(|weight| weight / sum)
}

#[cfg(test)]
mod tests {
    use softrast_raster::HostBackend;
    use softrast_tensor::tensor;

    use super::*;

    /// A floor from depth 1 below the picture to depth 3 above it, black at the near end and white at the far one.
    fn floor() -> (VertexColours<HostBackend>, Projected<HostBackend>) {
        let corners = [-9.0, -1.0, 1.0, 9.0, -1.0, 1.0, 3.0, 1.0, 3.0, -3.0, 1.0, 3.0].to_vec();
        let colours = [[0.0; 3], [0.0; 3], [1.0, 0.5, 0.25], [1.0, 0.5, 0.25]];
        let faces = [[0, 1, 2], [0, 2, 3]];
        (VertexColours::new(&colours, faces.into()), Projected::new(tensor(corners, [1, 4, 3])))
    }

    #[test]
    fn a_hard_pixel_has_the_colour_in_space_of_what_is_seen() {
        let (coat, seen) = floor();
        let image = numbers(coat.hard(seen, 5));
        // In the middle 1/z = (1 + 1/3) / 2, so z = 3/2, a quarter of the way.
        for (channel, colour) in image.chunks(25).zip([1.0, 0.5, 0.25]) {
            assert!((channel[12] - 0.25 * colour).abs() < 1e-6, "{channel:?}");
        }
    }

    #[test]
    fn the_soft_picture_is_nearly_the_hard_one_at_any_distance() {
        let (coat, seen) = floor();
        let hard = numbers(coat.hard(seen.clone(), 5));
        for distance in [2.0, 20.0] {
            let scale = tensor([1.0, 1.0, distance / 2.0].to_vec(), [1, 1, 3]);
            let near = seen.clone().tensor() * scale;
            let soft = numbers(coat.soft(Projected::new(near), tensor(vec![distance], [1, 1]), 5));
            assert!(soft.iter().zip(&hard).all(|(a, b)| (a - b).abs() < 0.01), "{soft:?} {hard:?}");
        }
    }
}
