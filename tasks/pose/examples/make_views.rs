//! Makes `data/views/fox`: masks of the fox, the cameras that took them, and the truth.
//!
//! `cargo run --release -p pose --example make_views`

use std::{fs, path::Path};

use image::{GrayImage, Luma};
use serde_json::json;
use softrast_inverse::{camera_json, silhouette_pixels};
use softrast_mesh::fox;
use softrast_raster::Pinhole;

const VIEWS: usize = 12;
const HEIGHT: usize = 90;
const WIDTH: usize = 120;
/// Samples along each side of a pixel.
const SAMPLES: usize = 4;

fn main() -> anyhow::Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/views/fox");
    fs::create_dir_all(folder.join("images"))?;
    let mesh = fox();
    let (mut frames, mut truth) = (Vec::new(), Vec::new());
    for (k, camera) in (0..VIEWS).map(|k| (k, camera(k))) {
        let fine = [SAMPLES * HEIGHT, SAMPLES * WIDTH];
        let fine = camera.cropped([0.0; 2], [WIDTH as f64, HEIGHT as f64], fine);
        let drawn = silhouette_pixels(&mesh, &fine);
        let covered = |x: usize, y: usize| {
            let sample = |s: usize| {
                (SAMPLES * y + s / SAMPLES) * SAMPLES * WIDTH + SAMPLES * x + s % SAMPLES
            };
            (0..SAMPLES * SAMPLES).map(|s| drawn[sample(s)]).sum::<f64>()
                / (SAMPLES * SAMPLES) as f64
        };
        let name = format!("images/{k:02}.png");
        let mask = GrayImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
            Luma([(255.0 * covered(x as usize, y as usize)).round() as u8])
        });
        mask.save(folder.join(&name))?;
        frames.push(json!({ "file_path": name, "transform_matrix": camera.to_opengl() }));
        truth.push(camera_json(&camera));
    }
    let [[fx, fy], [cx, cy]] = [camera(0).focal, camera(0).centre];
    let transforms = json!({
        "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": WIDTH, "h": HEIGHT, "frames": frames,
    });
    let truth = json!({ "mesh": "fox", "views": truth });
    for (name, value) in [("transforms.json", transforms), ("truth.json", truth)] {
        fs::write(folder.join(name), serde_json::to_string_pretty(&value)? + "\n")?;
    }
    Ok(())
}

/// Cameras all around, none upright, none that looks at the middle, with the principal point off the middle.
fn camera(k: usize) -> Pinhole {
    let turn = 2.4 * k as f64;
    let height = 0.8 - 1.6 * (k as f64 + 0.5) / VIEWS as f64;
    let around = (1.0 - height * height).sqrt();
    let distance = 4.2 + 0.3 * (1.7 * turn).sin();
    let eye = [around * turn.sin(), height, around * turn.cos()].map(|x| distance * x);
    let target = [0.12 * (3.1 * turn).sin(), 0.1 * (1.3 * turn).cos(), 0.1 * (2.3 * turn).sin()];
    let up = [0.2 * (1.9 * turn).sin(), 1.0, 0.0];
    let camera = Pinhole::look_at(eye, target, up, 40.0, [HEIGHT, WIDTH]);
    Pinhole { focal: [130.0, 131.0], centre: [62.5, 43.0], ..camera }
}
