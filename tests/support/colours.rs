//! All results of the colour op for one scene.

use softrast_mesh::fox;
use softrast_raster::{
    Attributes, Background, ColourRenderer, Projected, RasterBackend, Weighting, project,
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, Tensor, numbers};

use crate::{outputs::Outputs, tensors::tensor};

/// Height and width of the image in pixels: more than twice the rows of a band.
const SIZE: [usize; 2] = [101, 110];
const AZIMUTHS_DEG: [f64; 2] = [0.0, 100.0];
const CHANNELS: usize = 3;

/// Image, gradients and gradients of these, on two views of the fox with vertex colours, in the float type of `B`.
///
/// # Panics
///
/// If one of them does not depend on the input that it is differentiated with respect to.
pub fn colours<B: RasterBackend>() -> Outputs {
    let fox = fox();
    let edge = EdgeSoftness::new(Family::Logistic);
    let depth = DepthSoftness::Family(Family::Exp);
    let weighting = Weighting { edge, depth, planes: [1.7, 3.8] };
    let phi = [edge.default_phi(0.01), depth.default_phi(0.02)];
    let renderer = ColourRenderer::with_weighting(fox.faces().into(), SIZE, weighting, phi.clone());
    let world = tensor::<B, 3>(fox.positions().as_flattened(), [1, fox.positions().len(), 3]);
    let orbits: Vec<f64> =
        AZIMUTHS_DEG.iter().flat_map(|&azimuth| [2.732, 17.0, azimuth, 60.0]).collect();
    let seen = project(world, tensor(&orbits, [AZIMUTHS_DEG.len(), 4])).tensor();
    let wave = |count: usize, step: f64| -> Vec<f64> {
        (0..count).map(|k| (step * k as f64).sin()).collect()
    };
    let vertices = fox.positions().len();
    let colour = tensor::<B, 3>(&wave(CHANNELS * vertices, 0.3), [1, vertices, CHANNELS]);
    let parameters = phi.map(|phi| tensor::<B, 1>(&phi, [phi.len()]));
    let behind = tensor::<B, 1>(&[0.1, 0.2, 0.3, -20.0], [CHANNELS + 1]);

    let [edge, depth] = parameters;
    let flat = [seen.clone().reshape([-1]), colour.reshape([-1]), edge, depth, behind];
    let inner = flat.map(|x| Tensor::<Autodiff<B>, 1>::from_inner(x).require_grad());
    let leaves = inner.clone().map(|x| Tensor::<Autodiff<_>, 1>::from_inner(x).require_grad());
    let [seen, colour, edge, depth, behind] = leaves.clone();
    let seen = Projected::new(seen.reshape([AZIMUTHS_DEG.len() as i64, -1, 3]));
    let colour = colour.reshape([1, -1, CHANNELS as i64]);
    let attributes = Attributes::of_vertices(colour, fox.faces());
    let background = Background {
        colour: behind.clone().narrow(0, 0, CHANNELS),
        log_weight: behind.narrow(0, CHANNELS, 1),
    };
    let image = renderer.image_with(seen, &attributes, [&edge, &depth], &background);
    let shape = image.dims();
    let weights = tensor::<Autodiff<Autodiff<B>>, 4>(&wave(shape.iter().product(), 0.37), shape);
    let grads = (image.clone() * image.clone() * weights).sum().backward();
    let grads = leaves.map(|leaf| leaf.grad(&grads).expect("the image depends on it"));
    let product = grads.iter().map(|grad| {
        let count = grad.dims()[0];
        (grad.clone() * tensor(&wave(count, 0.11), [count])).sum()
    });
    let again = product.reduce(|a, b| a + b).expect("five inputs").backward();
    let names =
        ["to the vertices", "to the colours", "to the edge", "to the depth", "to the background"];
    let mut outputs = vec![("image", numbers(image.inner().inner()))];
    for ((name, grad), inner) in names.into_iter().zip(grads).zip(inner) {
        outputs.push((name, numbers(grad.inner())));
        outputs.push((name, numbers(inner.grad(&again).expect("the gradient depends on it"))));
    }
    outputs
}
