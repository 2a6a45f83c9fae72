//! The surface from pictures: closed, with the requested number of faces, and corrected by normals
//! and colours where masks carry no information.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

use image::{Rgba, RgbaImage};
use serde_json::{Value, json};
use softrast_mesh::{ClosedSurface, Mesh, icosphere};
use softrast_raster::{Orbit, Pinhole};
use softrast_test_kit::Program;
use softrast_views::coloured_pixels;

/// Runs `shape3d solve` with results in `out`: its JSON, or its error line.
fn run(out: &Path, words: &[&str]) -> Result<Value, String> {
    let program = Program::new(env!("CARGO_BIN_EXE_shape3d"));
    let found = program.run_words(out, &[&["solve"], words].concat());
    found.map_err(|failure| failure.message.trim_end().to_owned())
}

/// Depth of the dent at +z.
const DEPTH: f64 = 0.35;

/// A ball with a dent at +z that is invisible in every silhouette.
fn dented() -> Mesh {
    let ball = icosphere(5);
    let place = |&[x, y, z]: &[f64; 3]| {
        let inwards = if z > 0.0 { DEPTH * (-(x * x + y * y) / 0.12).exp() } else { 0.0 };
        [x, y, z].map(|k| k * (1.0 - inwards))
    };
    ball.with_positions(ball.positions().iter().map(place).collect()).unwrap()
}

/// The dented ball with `(n + 1) / 2` of its normals as colours.
fn in_normals() -> Mesh {
    let mesh = dented();
    let mut sums = vec![[0.0; 3]; mesh.positions().len()];
    for (face, [a, b, c]) in mesh.faces().iter().zip(mesh.triangles()) {
        let [u, v] = [b, c].map(|p| [0, 1, 2].map(|k| p[k] - a[k]));
        let n = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| u[i] * v[j] - u[j] * v[i]);
        face.iter().for_each(|&v| (0..3).for_each(|k| sums[v as usize][k] += n[k]));
    }
    let colour = |n: [f64; 3]| {
        let length = n.iter().map(|x| x * x).sum::<f64>().sqrt();
        n.map(|x| 0.5 + 0.5 * x / length)
    };
    mesh.with_colours(sums.into_iter().map(colour).collect()).unwrap()
}

/// The dented ball in stripes.
fn in_stripes() -> Mesh {
    let mesh = dented();
    let colour =
        |p: &[f64; 3]| [12.0, 15.0, 18.0].map(|k| 0.5 + 0.4 * (k * p[0]).sin() * (k * p[1]).cos());
    let colours = mesh.positions().iter().map(colour).collect();
    mesh.with_colours(colours).unwrap()
}

/// Transparent pictures of a mesh, in a folder.
fn pictures(mesh: &Mesh, folder: &Path) {
    const SIZE: usize = 96;
    let frame = |k: usize| {
        let elevation_deg = [-40.0, 0.0, 40.0][k % 3];
        let azimuth_deg = 22.5 * k as f64;
        let orbit = Orbit { distance: 5.0, elevation_deg, azimuth_deg, fov_deg: 30.0 };
        let camera = Pinhole::from_orbit(&orbit, SIZE);
        let [red, green, blue, covered] = coloured_pixels(mesh, &camera);
        let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
        let pixel = |x: u32, y: u32| {
            let k = y as usize * SIZE + x as usize;
            let [r, g, b] = [&red, &green, &blue].map(|c| byte(c[k] / covered[k].max(1e-9)));
            Rgba([r, g, b, byte(covered[k])])
        };
        let name = format!("{k:02}.png");
        RgbaImage::from_fn(SIZE as u32, SIZE as u32, pixel).save(folder.join(&name)).unwrap();
        (camera, json!({"file_path": name, "transform_matrix": camera.to_opengl()}))
    };
    let (cameras, frames): (Vec<_>, Vec<_>) = (0..16).map(frame).unzip();
    let Pinhole { focal, centre, .. } = cameras[0];
    let lens = json!({"fl_x": focal[0], "fl_y": focal[1], "cx": centre[0], "cy": centre[1], "frames": frames});
    fs::write(folder.join("transforms.json"), lens.to_string()).unwrap();
}

/// The depth of the dent of a result: the distance of its surface from 1 on the axis z.
fn dent(out: &Path) -> f64 {
    let mesh = Mesh::load(out.join("mesh.ply")).unwrap();
    ClosedSurface::new(&mesh, 1.0, 0).unwrap();
    assert!(mesh.triangles().all(|[a, b, c]| a != b && b != c && c != a));
    let from_axis = |p: &[f64; 3]| p[0].hypot(p[1]);
    let mut front: Vec<_> = mesh.positions().iter().filter(|p| p[2] > 0.0).collect();
    front.sort_by(|a, b| from_axis(a).total_cmp(&from_axis(b)));
    1.0 - front[..3].iter().map(|p| p[2]).sum::<f64>() / 3.0
}

#[test]
fn normals_show_a_dent_that_masks_do_not() {
    let folder = tempfile::tempdir().unwrap();
    pictures(&in_normals(), folder.path());
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let with = |more: &[&str]| {
        let words = ["--views", views, "--size", "96", "--steps", "150"];
        run(&out, &[&words, more].concat()).unwrap()
    };
    let found = with(&["--masks-only"]);
    assert!(found["train_iou"].as_f64().unwrap() > 0.97, "{found}");
    // Up to its rim it is filled.
    assert!(dent(&out) < 0.22, "{}", dent(&out));
    let found = with(&["--normals"]);
    assert!(found["train_iou"].as_f64().unwrap() > 0.97, "{found}");
    assert!((dent(&out) - DEPTH).abs() < 0.04, "{}", dent(&out));
    // With normals from another folder, and with few faces.
    let apart = tempfile::tempdir().unwrap();
    pictures(&in_stripes(), folder.path());
    pictures(&in_normals(), apart.path());
    let found = with(&["--normals", apart.path().to_str().unwrap(), "--faces", "1500"]);
    assert!(found["faces"].as_u64().unwrap() <= 1500, "{found}");
    assert!((dent(&out) - DEPTH).abs() < 0.06, "{}", dent(&out));
    let none = folder.path().join("out");
    let error = run(&out, &["--views", views, "--normals", none.to_str().unwrap()]).unwrap_err();
    assert!(error.contains("no picture in"), "{error}");
}

#[test]
fn colours_show_it_too() {
    let folder = tempfile::tempdir().unwrap();
    pictures(&in_stripes(), folder.path());
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let words = ["--views", views, "--size", "96", "--steps", "300", "--colour", "--hold-out", "2"];
    let found = run(&out, &words).unwrap();
    assert!((dent(&out) - DEPTH).abs() < 0.08, "{}", dent(&out));
    assert!(found["held_out_psnr"].as_f64().unwrap() > 20.0, "{found}");
}

#[test]
fn flags_that_do_not_go_together_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    pictures(&dented(), folder.path());
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    for (more, part) in [
        (["--detail", "3"], "--detail"),
        (["--learning-rate", "0.1"], "--template"),
        (["--softness", "gauss"], "--template"),
        (["--smooth", "6"], "at most 5"),
        (["--faces", "5"], "100"),
        (["--size", "4"], "8"),
    ] {
        let error = run(&out, &[&["--views", views], &more[..]].concat()).unwrap_err();
        assert!(error.contains(part), "{more:?}: {error}");
    }
}
