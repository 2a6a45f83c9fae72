//! Makes `data/views/fox`: masks of the fox, their cameras, and the ground truth; and `data/views/fox_lens`: the same cameras with a
//! distorting lens, pictures over a grey wall, separate masks, and the cameras in the formats of nerfstudio and COLMAP.
//!
//! `cargo run --release -p pose --example make_views`

use std::{fs, path::Path};

use image::{GrayImage, Luma, Rgb, RgbImage};
use serde_json::{Value, json};
use softrast_inverse::silhouette_pixels;
use softrast_mesh::fox;
use softrast_raster::Pinhole;
use softrast_views::{Distortion, camera_json, colmap_pose};

const VIEWS: usize = 12;
const HEIGHT: usize = 90;
const WIDTH: usize = 120;
/// Samples along each side of a pixel.
const SAMPLES: usize = 4;
const K: [f64; 6] = [-0.15, 0.04, 0.0, 0.0, 0.0, 0.0];
const P: [f64; 2] = [0.002, -0.0015];
/// The lens of `fox_lens`.
const LENS: Distortion = Distortion::Rational { k: K, p: P };
/// Colours of the wall and the fox.
const WALL: [f64; 3] = [0.35; 3];
const COAT: [f64; 3] = [0.85, 0.45, 0.15];

fn main() -> anyhow::Result<()> {
    let views = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/views");
    let cameras: Vec<Pinhole> = (0..VIEWS).map(camera).collect();
    // R, t, K and the size are sufficient.
    let truth = |camera: &Pinhole| {
        let mut truth = camera_json(camera);
        if let Some(fields) = truth.as_object_mut() {
            fields.retain(|name, _| !["transform_matrix", "colmap"].contains(&&**name));
        }
        truth
    };
    let truth: Vec<Value> = cameras.iter().map(truth).collect();
    let truth = json!({ "mesh": "fox", "views": truth });
    let straight = views.join("fox");
    fs::create_dir_all(straight.join("images"))?;
    for (k, camera) in cameras.iter().enumerate() {
        mask(camera, |place| place).save(straight.join(format!("images/{k:02}.png")))?;
    }
    let frame = |(k, camera): (usize, &Pinhole)| json!({ "file_path": format!("images/{k:02}.png"), "transform_matrix": camera.to_opengl() });
    let mut transforms = intrinsics(&cameras[0]);
    transforms["frames"] = cameras.iter().enumerate().map(frame).collect();
    write(&straight, &transforms, &truth)?;

    let bent = views.join("fox_lens");
    for name in ["images", "masks", "sparse/0"] {
        fs::create_dir_all(bent.join(name))?;
    }
    for (k, camera) in cameras.iter().enumerate() {
        let mask = mask(camera, |place| unbent(camera, place));
        let picture = RgbImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
            let covered = f64::from(mask.get_pixel(x, y).0[0]) / 255.0;
            Rgb([0, 1, 2]
                .map(|c| (255.0 * (WALL[c] + covered * (COAT[c] - WALL[c]))).round() as u8))
        });
        mask.save(bent.join(format!("masks/{k:02}.png")))?;
        picture.save(bent.join(format!("images/{k:02}.png")))?;
    }
    let mut transforms = LENS.json();
    transforms["camera_model"] = "OPENCV".into();
    for (name, value) in intrinsics(&cameras[0]).as_object().into_iter().flatten() {
        transforms[name] = value.clone();
    }
    let frame = |(k, camera): (usize, &Pinhole)| json!({ "file_path": format!("images/{k:02}.png"), "mask_path": format!("masks/{k:02}.png"), "transform_matrix": camera.to_opengl() });
    transforms["frames"] = cameras.iter().enumerate().map(frame).collect();
    write(&bent, &transforms, &truth)?;
    let (model_cameras, images) = colmap(&cameras);
    fs::write(bent.join("sparse/0/cameras.bin"), model_cameras)?;
    fs::write(bent.join("sparse/0/images.bin"), images)?;
    Ok(())
}

fn intrinsics(camera: &Pinhole) -> Value {
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.centre);
    json!({ "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": WIDTH, "h": HEIGHT })
}

fn write(folder: &Path, transforms: &Value, truth: &Value) -> anyhow::Result<()> {
    for (name, value) in [("transforms.json", transforms), ("truth.json", truth)] {
        fs::write(folder.join(name), serde_json::to_string_pretty(value)? + "\n")?;
    }
    Ok(())
}

/// Coverage of each pixel by the fox; `straight` maps a place to the place of the same point in a pinhole image, in pixels.
fn mask(camera: &Pinhole, straight: impl Fn([f64; 2]) -> [f64; 2]) -> GrayImage {
    let [height, width] = [SAMPLES * HEIGHT, SAMPLES * WIDTH];
    let fine = camera.cropped([0.0; 2], [WIDTH as f64, HEIGHT as f64], [height, width]);
    let drawn = silhouette_pixels(&fox(), &fine);
    let sample = |x: usize, y: usize| {
        let place = [x, y].map(|at| (at as f64 + 0.5) / SAMPLES as f64);
        let [x, y] = straight(place).map(|at| (at * SAMPLES as f64).floor());
        let inside = x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64;
        if inside { drawn[y as usize * width + x as usize] } else { 0.0 }
    };
    GrayImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
        let [x, y] = [x, y].map(|at| at as usize * SAMPLES);
        let samples = (0..SAMPLES * SAMPLES).map(|s| sample(x + s % SAMPLES, y + s / SAMPLES));
        let covered = samples.sum::<f64>() / (SAMPLES * SAMPLES) as f64;
        Luma([(255.0 * covered).round() as u8])
    })
}

/// The place in a pinhole image of the point at a place in the lens image, in pixels.
fn unbent(camera: &Pinhole, place: [f64; 2]) -> [f64; 2] {
    let Pinhole { focal, centre, .. } = *camera;
    let shown = [0, 1].map(|k| (place[k] - centre[k]) / focal[k]);
    // Fixed-point iteration: the distortion is nearly the same at nearby places.
    let ray = (0..60).fold(shown, |ray, _| {
        let bent = LENS.bend(ray);
        [0, 1].map(|k| ray[k] + shown[k] - bent[k])
    });
    [0, 1].map(|k| focal[k] * ray[k] + centre[k])
}

/// `cameras.bin` and `images.bin` of a model with one camera.
fn colmap(cameras: &[Pinhole]) -> (Vec<u8>, Vec<u8>) {
    const OPENCV: i32 = 4;
    let ([fx, fy], [cx, cy]) = (cameras[0].focal, cameras[0].centre);
    let numbers =
        |numbers: &[f64]| numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let one = [
        &1u64.to_le_bytes()[..],
        &1u32.to_le_bytes(),
        &OPENCV.to_le_bytes(),
        &(WIDTH as u64).to_le_bytes(),
        &(HEIGHT as u64).to_le_bytes(),
        &numbers(&[fx, fy, cx, cy, K[0], K[1], P[0], P[1]]),
    ];
    let mut images = (cameras.len() as u64).to_le_bytes().to_vec();
    for (k, camera) in cameras.iter().enumerate() {
        images.extend((k as u32 + 1).to_le_bytes());
        images.extend(numbers(&colmap_pose(camera)));
        images.extend(1u32.to_le_bytes());
        images.extend(format!("{k:02}.png\0").bytes());
        // No points.
        images.extend(0u64.to_le_bytes());
    }
    (one.concat(), images)
}

/// Cameras all around, none upright, none looking at the middle, with an off-centre principal point.
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
