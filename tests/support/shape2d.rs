//! A small 2-D problem: triangles that are fitted to a target.

use softrast_meta::Objective;
use softrast_raster::{
    RasterBackend, TConorm,
    low_level::{Rasterizer, Silhouette},
    mse_loss, reference,
};
use softrast_softness::Softness;
use softrast_tensor::{Backend, Tensor, TensorData};

/// Width and height of the image in pixels.
const SIZE: usize = 12;
/// Triangles in a row along the diagonal.
const FACES: usize = 6;

/// Two implementations of drawing.
#[derive(Clone, Debug)]
enum Drawing<S> {
    /// Plain tensor ops over every pair.
    Reference(S),
    /// The fused op, with support and knots chosen beforehand.
    Fused(Box<Silhouette<S>>),
}

/// Six triangles with free corners, fitted to the image of a disk.
///
/// θ `[36]` holds x and y of all corners in NDC, φ belongs to the softness; the loss is the mean squared difference.
#[derive(Clone, Debug)]
pub struct Shape2d<S> {
    drawing: Drawing<S>,
}

impl<S: Softness> Shape2d<S> {
    /// Creates a problem drawn by the reference.
    pub fn by_reference(softness: S) -> Self {
        Self { drawing: Drawing::Reference(softness) }
    }

    /// Creates a problem drawn by the fused op, prepared for parameters near `phi`.
    pub fn by_fused_op<B: RasterBackend>(softness: S, phi: &Tensor<B, 1>, tolerance: f64) -> Self {
        let rasterizer = Rasterizer { tolerance, ..Rasterizer::new(SIZE) };
        let silhouette = rasterizer.prepare(&faces().into(), softness, phi);
        Self { drawing: Drawing::Fused(Box::new(silhouette)) }
    }
}

/// Initial corners of [`Shape2d`]: triangles of unequal shape that overlap their neighbours.
pub fn shape2d_start() -> Vec<f64> {
    let corner = |face: usize, corner: usize| {
        let along = 0.26 * face as f64 - 0.65;
        let turn = 0.7 * face as f64 + 2.1 * corner as f64;
        let reach = 0.23 + 0.03 * corner as f64;
        [along + reach * turn.cos(), 0.8 * along + reach * turn.sin()]
    };
    (0..FACES).flat_map(|face| (0..3).flat_map(move |k| corner(face, k))).collect()
}

fn faces() -> Vec<[u32; 3]> {
    (0..FACES as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect()
}

/// The image of a disk, `[1, size, size]`, in the float type of `like`.
fn target<B: Backend>(like: &Tensor<B, 1>) -> Tensor<B, 3> {
    let at = |index: usize| (2.0 * index as f64 + 1.0) / SIZE as f64 - 1.0;
    let inside = |pixel: usize| {
        let [x, y] = [at(pixel % SIZE) - 0.2, at(pixel / SIZE) + 0.1];
        f64::from(x * x + y * y < 0.3)
    };
    let values: Vec<f64> = (0..SIZE * SIZE).map(inside).collect();
    let data = TensorData::new(values, [1, SIZE, SIZE]);
    Tensor::from_data(data, (&like.device(), like.dtype()))
}

impl<B: RasterBackend, S: Softness> Objective<B> for Shape2d<S> {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let target = target(&theta);
        let corners = theta.reshape([1, 3 * FACES, 2]);
        let depth = corners.zeros_like().narrow(2, 0, 1) + 1.0;
        let vertices = Tensor::cat(vec![corners, depth], 2);
        let image = match &self.drawing {
            Drawing::Fused(silhouette) => silhouette.coverage(vertices, phi),
            Drawing::Reference(softness) => {
                let conorm = TConorm::default();
                let faces = faces();
                let scene = reference::Scene { faces: &faces, size: SIZE.into() };
                conorm.coverage(reference::sums(scene, vertices, softness, conorm, phi))
            }
        };
        mse_loss(image, target)
    }
}
