//! All results of the fused op for one scene.

use softrast_mesh::fox;
use softrast_raster::{RasterBackend, low_level::Rasterizer, project};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Backend, Tensor, numbers};

use crate::tensors::tensor;

/// Width and height of the image in pixels: more than twice the rows of a band.
const SIZE: usize = 150;
const AZIMUTHS_DEG: [f64; 2] = [0.0, 70.0];

/// Results of an op, by name.
pub type Outputs = Vec<(&'static str, Vec<f64>)>;

/// All outputs of the fused op on two views of the fox, 150 × 150, in the float type of `B`.
///
/// The sums; the gradients of a weighted sum of these with respect to vertices and table; and the gradients of a weighted sum of both with
/// respect to vertices, table and first weights.
///
/// # Panics
///
/// If one of them does not depend on the input that it is differentiated with respect to.
pub fn outputs<B: RasterBackend>() -> Outputs {
    type Second<B> = Autodiff<Autodiff<B>>;

    // A network, because its tail is not 0.
    let softness = EdgeSoftness::new(Family::Mlp);
    let fox = fox();
    let phi = softness.default_phi(0.02);
    let phi = tensor::<B, 1>(&phi, [phi.len()]);
    let silhouette = Rasterizer::new(SIZE).prepare(&fox.faces().into(), softness, &phi);
    let projected = projected::<B>(fox.positions());

    let inner_vertices = Tensor::<Autodiff<B>, 3>::from_inner(projected).require_grad();
    let inner_table = Tensor::<Autodiff<B>, 2>::from_inner(silhouette.table(phi)).require_grad();
    let weights = wave::<Autodiff<B>, 3>([AZIMUTHS_DEG.len(), SIZE, SIZE], 0.37).require_grad();
    let vertices = Tensor::<Second<B>, 3>::from_inner(inner_vertices.clone()).require_grad();
    let table = Tensor::<Second<B>, 2>::from_inner(inner_table.clone()).require_grad();

    let sums = silhouette.sums(vertices.clone(), table.clone());
    let grads = (sums.clone() * Tensor::from_inner(weights.clone())).sum().backward();
    let by_vertices = vertices.grad(&grads).expect("the sums depend on the vertices");
    let by_table = table.grad(&grads).expect("the sums depend on the table");
    let product = (by_vertices.clone() * wave(by_vertices.dims(), 0.11)).sum()
        + (by_table.clone() * wave(by_table.dims(), 0.23)).sum();
    let again = product.backward();
    let expect = "the gradient depends on it";
    vec![
        ("sums", numbers(sums.inner().inner())),
        ("gradient to the vertices", numbers(by_vertices.inner())),
        ("gradient to the table", numbers(by_table.inner())),
        ("second order, vertices", numbers(inner_vertices.grad(&again).expect(expect))),
        ("second order, table", numbers(inner_table.grad(&again).expect(expect))),
        ("second order, weights", numbers(weights.grad(&again).expect(expect))),
    ]
}

/// The projected vertices of all views, `[views, vertices, 3]`.
fn projected<B: RasterBackend>(positions: &[[f64; 3]]) -> Tensor<B, 3> {
    let orbits: Vec<f64> =
        AZIMUTHS_DEG.iter().flat_map(|&azimuth| [2.732, 17.0, azimuth, 60.0]).collect();
    let world = tensor(positions.as_flattened(), [1, positions.len(), 3]);
    project(world, tensor(&orbits, [AZIMUTHS_DEG.len(), 4])).tensor()
}

/// Numbers between -1 and 1 that differ between positions.
fn wave<B: Backend, const D: usize>(shape: [usize; D], step: f64) -> Tensor<B, D> {
    let values: Vec<f64> =
        (0..shape.iter().product()).map(|k: usize| (step * k as f64).sin()).collect();
    tensor(&values, shape)
}
