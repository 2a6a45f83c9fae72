//! Moves the vertices of a sphere until they fit the masks of a folder, with burn's own Adam, and saves the mesh.
//!
//! `cargo run --release -p softrast --example fit_masks -- data/views/fox`

use softrast::{
    mesh::icosphere,
    prelude::*,
    tensor::{
        Autodiff, NdArray,
        burn::optim::{AdamConfig, GradientsParams, Optimizer},
    },
};

type B = Autodiff<NdArray>;

fn main() -> anyhow::Result<()> {
    let device = Default::default();
    let views = Views::load(std::env::args().nth(1).unwrap_or("data/views/fox".into()))?;
    let (masks, cameras) = (views.masks::<B>(&device), views.cameras::<B>(&device));
    let sphere = icosphere(3);
    let (surface, mut shape) = (Surface::of(&sphere), VertexModel::<B>::new(&sphere, &device));
    let narrowing = Width::pixels(3.0).to(0.3);
    let mut renderer = SoftRenderer::new(sphere.faces(), views.size(), Family::Gauss, 0.01);
    let mut adam = AdamConfig::new().init();
    for step in 0..200 {
        renderer.set_width(narrowing.at(f64::from(step) / 199.0));
        let image = renderer.silhouette(project(shape.vertices(), &cameras));
        let loss = iou_loss(image, masks.clone()).mean();
        let smooth = surface.laplacian(shape.vertices()) * 0.01;
        if step % 20 == 0 {
            println!("step {step:3}: IoU loss {:.4}", loss.clone().into_scalar());
        }
        let gradients = GradientsParams::from_grads((loss + smooth).backward(), &shape);
        shape = adam.step(0.01, shape, gradients);
    }
    shape.mesh(&sphere)?.save("fit.obj")?;
    Ok(())
}
