//! Fits the vertices of a sphere to the masks of a folder, with burn's own Adam, and saves the mesh.
//!
//! `cargo run --release -p softrast --example fit_masks -- data/views/fox`

use softrast::{
    mesh::icosphere,
    prelude::*,
    tensor::{Autodiff, NdArray, burn::optim::AdamConfig},
};

type B = Autodiff<NdArray>;

fn main() -> anyhow::Result<()> {
    let device = Default::default();
    let views = Views::load(std::env::args().nth(1).unwrap_or("data/views/fox".into()))?;
    let (masks, cameras) = (views.masks::<B>(&device), views.cameras::<B>(&device));
    let mut shape = VertexModel::<B>::new(&icosphere(3), &device);
    let width = Width::pixels(2.0).to(0.3);
    let mut renderer = SoftRenderer::new(shape.faces(), views.size(), Family::Gauss, width.at(0.0));
    let mut adam = AdamConfig::new().init();
    for step in 0..200 {
        renderer.set_width(width.at(f64::from(step) / 199.0));
        let image = renderer.silhouette(project(shape.vertices(), &cameras));
        let loss = iou_loss(image, masks.clone()).mean() + shape.laplacian() * 0.01;
        println!("step {step:3}: loss {:.4}", loss.clone().into_scalar());
        shape = shape.step(&mut adam, 0.01, loss);
    }
    Ok(shape.mesh()?.save("fit.obj")?)
}
