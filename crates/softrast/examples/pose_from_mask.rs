//! Finds the camera of a picture from its mask.
//!
//! `cargo run --release -p softrast --example pose_from_mask`

use softrast::{mesh::fox, prelude::*, tensor::NdArray};

fn main() -> anyhow::Result<()> {
    let (mesh, device) = (fox(), Default::default()); // of your own: Mesh::load("my.obj")?

    // A mask, here drawn from a known pose. For your own: Picture::load_mask("mask.png")?
    let truth = Pinhole::look_at([2.0, 1.5, -2.5], [0.0; 3], [0.0, 1.0, 0.0], 45.0, [90, 120]);
    let corners = vertex_tensor::<NdArray>(mesh.positions(), &device);
    let seen = project(corners, Pinholes::new(&[truth], &device));
    let file = std::env::temp_dir().join(format!("softrast-mask-{}.png", std::process::id()));
    save_picture(hard_silhouette(seen, mesh.faces(), [90, 120]), &file)?;
    let mask = Picture::load_mask(&file)?;

    // The lens is known, the pose is not. For your own: Lens::load("camera.json")?.pinhole(mask.size())?
    let camera = Lens::of_fov(45.0, mask.size()).pinhole(mask.size())?;
    let found = PoseSearch::new(&mesh, camera).run::<NdArray>(&mask)?;
    let FoundPose { camera, iou, .. } = found[0]; // the best; others that fit nearly as well stand behind it
    println!("R {:.3?}\nt {:.3?}", camera.rotation, camera.translation);
    println!("stood at {:.2?}, found at {:.2?}, IoU {iou:.3}", truth.eye(), camera.eye());
    Ok(())
}
