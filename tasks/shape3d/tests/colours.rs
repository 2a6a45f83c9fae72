//! Colours from pictures: of a known shape, of a found one, and error messages for flags and files that contradict each other.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

use image::{Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::{Value, json};
use softrast_mesh::{Mesh, icosphere};
use softrast_raster::{Orbit, Pinhole};
use softrast_test_kit::Program;
use softrast_views::{coloured_pixels, painted_by_texture};

/// Runs `shape3d solve` with results in `out`: its JSON, or its error line.
fn run(out: &Path, words: &[&str]) -> Result<Value, String> {
    let program = Program::new(env!("CARGO_BIN_EXE_shape3d"));
    let found = program.run_words(out, &[&["solve"], words].concat());
    found.map_err(|failure| failure.message.trim_end().to_owned())
}

/// A ball, wider than high, with colours that follow its shape.
fn ball() -> Mesh {
    let ball = icosphere(3);
    let colours = ball.positions().iter().map(|p| p.map(|x| 0.5 + 0.4 * (3.0 * x).sin())).collect();
    let wide = ball.positions().iter().map(|&[x, y, z]| [x, 0.7 * y, z]).collect();
    ball.with_positions(wide).unwrap().with_colours(colours).unwrap()
}

/// Pictures of the ball in a folder: transparent, or over white with separate masks.
fn pictures(folder: &Path, opaque: bool) {
    pictures_of(&ball(), folder, opaque);
}

/// Pictures of another mesh.
fn pictures_of(mesh: &Mesh, folder: &Path, opaque: bool) {
    let size = [60usize, 44];
    let frame = |k: usize| {
        let elevation_deg = [-50.0, 0.0, 50.0][k % 3];
        let orbit =
            Orbit { distance: 4.0, elevation_deg, azimuth_deg: 31.0 * k as f64, fov_deg: 40.0 };
        let camera = Pinhole::from_orbit(&orbit, [size[1], size[0]]);
        let [red, green, blue, covered] = coloured_pixels(mesh, &camera);
        let byte = |x: f64| (x.clamp(0.0, 1.0) * 255.0).round() as u8;
        let at = |x: u32, y: u32| y as usize * size[0] + x as usize;
        let of = |pixel: usize, colour: &dyn Fn(f64) -> f64| {
            [&red, &green, &blue].map(|channel| byte(colour(channel[pixel])))
        };
        let name = format!("{k:02}.png");
        let [width, height] = size.map(|pixels| pixels as u32);
        let mut frame = json!({"file_path": name, "transform_matrix": camera.to_opengl()});
        if opaque {
            let over_white = |x, y| {
                let pixel = at(x, y);
                Rgb(of(pixel, &|level| level + 1.0 - covered[pixel]))
            };
            RgbImage::from_fn(width, height, over_white).save(folder.join(&name)).unwrap();
            let mask = |x, y| Rgb([byte(covered[at(x, y)]); 3]);
            let beside = format!("mask_{name}");
            RgbImage::from_fn(width, height, mask).save(folder.join(&beside)).unwrap();
            frame["mask_path"] = json!(beside);
        } else {
            let over_nothing = |x, y| {
                let pixel = at(x, y);
                let [r, g, b] = of(pixel, &|level| level / covered[pixel].max(1e-9));
                Rgba([r, g, b, byte(covered[pixel])])
            };
            RgbaImage::from_fn(width, height, over_nothing).save(folder.join(&name)).unwrap();
        }
        (camera, frame)
    };
    let (cameras, frames): (Vec<_>, Vec<_>) = (0..12).map(frame).unzip();
    let Pinhole { focal, centre, .. } = cameras[0];
    let lens = json!({"fl_x": focal[0], "fl_y": focal[1], "cx": centre[0], "cy": centre[1], "frames": frames});
    fs::write(folder.join("transforms.json"), lens.to_string()).unwrap();
}

fn number(found: &Value, name: &str) -> f64 {
    found[name].as_f64().unwrap_or_else(|| panic!("{name} of {found}"))
}

#[test]
fn a_known_shape_gets_its_colours_back_over_nothing_and_over_white() {
    for opaque in [false, true] {
        let folder = tempfile::tempdir().unwrap();
        pictures(folder.path(), opaque);
        let known = folder.path().join("known.ply");
        Mesh::new(ball().positions().to_vec(), ball().faces().to_vec())
            .unwrap()
            .save(&known)
            .unwrap();
        let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
        let words = ["--views", views, "--colour", "--mesh", known.to_str().unwrap()];
        let found = run(&out, &[&words[..], &["--hold-out", "2"]].concat()).unwrap();
        assert!(number(&found, "held_out_iou") > 0.98, "{found}");
        assert!(number(&found, "held_out_psnr") > 30.0, "opaque: {opaque}: {found}");
        assert!(found["views"].as_array().unwrap().iter().all(|view| number(view, "psnr") > 15.0));
        for (name, tolerance) in [("mesh.obj", 0.0), ("mesh.ply", 0.002), ("mesh.glb", 1e-6)] {
            let mesh = Mesh::load(out.join(name)).unwrap();
            let obj = Mesh::load(out.join("mesh.obj")).unwrap();
            let pairs = mesh
                .colours()
                .unwrap()
                .iter()
                .flatten()
                .zip(obj.colours().unwrap().iter().flatten());
            assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() <= tolerance), "{name}");
            // Faces may have been subdivided: the original vertices come first.
            let before = ball().positions().to_vec();
            let moved = before
                .iter()
                .zip(mesh.positions())
                .any(|(a, b)| (0..3).any(|k| (a[k] - b[k]).abs() > 1e-6));
            assert!(!moved, "{name}");
        }
        let page = fs::read_to_string(out.join("report.html")).unwrap();
        assert!(page.contains("PSNR") && page.contains("\"colours\":\""));
        assert!(out.join("colours.png").exists());
        let textured = Mesh::load_textured(out.join("textured.glb")).unwrap().0;
        assert_eq!(textured.faces().len(), ball().faces().len());
        let picture = textured.texture().unwrap().picture().unwrap();
        let picture = image::load_from_memory(picture).unwrap().into_rgb8();
        assert!(picture.pixels().any(|texel| texel.0[0].abs_diff(texel.0[2]) > 100));
        // As `pose --colour` reads it, with the colours of the ball.
        let painted = painted_by_texture(&textured, 0).0.unwrap();
        let off = |(p, colour): (&[f64; 3], &[f64; 3])| {
            let known = [p[0], p[1] / 0.7, p[2]].map(|x| 0.5 + 0.4 * (3.0 * x).sin());
            (0..3).map(|k| (known[k] - colour[k]).powi(2)).sum::<f64>() / 3.0
        };
        let pairs = painted.positions().iter().zip(painted.colours().unwrap());
        let mean = pairs.map(off).sum::<f64>() / painted.positions().len() as f64;
        assert!(mean < 0.03f64.powi(2), "opaque: {opaque}: {mean}");
        // The same picture beside an OBJ file.
        let obj = Mesh::load_textured(out.join("textured.obj")).unwrap().0;
        assert_eq!(obj.faces().len(), ball().faces().len());
        let beside = fs::read(out.join("textured.png")).unwrap();
        for mesh in [&obj, &textured] {
            assert_eq!(mesh.texture().unwrap().picture().unwrap(), beside);
            assert_eq!(mesh.colours(), None);
        }
        let side = picture.width();
        assert_eq!(number(&found["texture"], "size"), f64::from(side));
        assert!(side.is_power_of_two() && side == picture.height(), "{side}");
    }
}

#[test]
fn shape_and_colours_are_found_together_unless_masks_alone_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), false);
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let words = ["--views", views, "--hold-out", "2", "--steps", "40"];
    let found = run(&out, &[&words[..], &["--colour"]].concat()).unwrap();
    assert!(number(&found, "held_out_iou") > 0.95, "{found}");
    assert!(number(&found, "held_out_psnr") > 20.0, "{found}");
    let usual = run(&out.join("usual"), &words).unwrap();
    assert_eq!(usual["held_out_psnr"], found["held_out_psnr"]);
    let found = run(&out.join("plain"), &[&words[..], &["--masks-only"]].concat()).unwrap();
    assert!(found.get("held_out_psnr").is_none() && found["views"][0].get("psnr").is_none());
    assert_eq!(Mesh::load(out.join("plain/mesh.ply")).unwrap().colours(), None);
    assert!(!out.join("plain/colours.png").exists());
}

#[test]
fn grey_pictures_are_masks_alone_unless_colours_are_asked_for() {
    let grey = ball().positions().iter().map(|p| [0.5 + 0.2 * p[1]; 3]).collect();
    let folder = tempfile::tempdir().unwrap();
    pictures_of(&ball().with_colours(grey).unwrap(), folder.path(), false);
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let words = ["--views", views, "--steps", "5"];
    assert!(run(&out, &words).unwrap().get("train_psnr").is_none());
    assert!(!out.join("textured.glb").exists());
    let found = run(&out, &[&words[..], &["--colour"]].concat()).unwrap();
    assert!(found.get("train_psnr").is_some(), "{found}");
}

#[test]
fn an_unreadable_picture_leaves_the_masks_alone_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), true);
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let words = ["--views", views, "--steps", "5"];
    let told = |message: &str| {
        let found = run(&out, &words).unwrap();
        assert!(found.get("train_psnr").is_none(), "{found}");
        let warnings = found["warnings"].to_string();
        assert!(warnings.contains("masks alone") && warnings.contains(message), "{warnings}");
    };
    RgbImage::new(30, 22).save(folder.path().join("03.png")).unwrap();
    told("30 x 22");
    fs::write(folder.path().join("03.png"), b"no picture").unwrap();
    told("03.png");
    fs::remove_file(folder.path().join("03.png")).unwrap();
    told("03.png");
    // A folder of masks alone is as the user has it.
    for k in 0..12 {
        let _ = fs::remove_file(folder.path().join(format!("{k:02}.png")));
    }
    assert!(run(&out, &words).unwrap()["warnings"].as_array().unwrap().is_empty());
}

#[test]
fn a_texture_shows_what_is_finer_than_the_faces() {
    let fine = ball().subdivided().subdivided();
    let stripes = |p: &[f64; 3]| p.map(|x| 0.5 + 0.45 * (9.0 * x).sin());
    let colours = fine.positions().iter().map(stripes).collect();
    let folder = tempfile::tempdir().unwrap();
    pictures_of(&fine.with_colours(colours).unwrap(), folder.path(), false);
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let words = ["--views", views, "--hold-out", "2", "--steps", "60", "--faces", "300"];
    let words = [&words[..], &["--colour", "--texture-size", "100"]].concat();
    let found = run(&out, &words).unwrap();
    let [texture, vertices] = [&found["held_out_psnr"], &found["psnr_of_vertices"]["held_out"]];
    let gain = texture.as_f64().unwrap() - vertices.as_f64().unwrap();
    assert!(gain > 1.0, "{found}");
    let picture = image::open(out.join("textured.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (100, 100));
    // The same with the same flags.
    let before = fs::read(out.join("textured.glb")).unwrap();
    run(&out, &words).unwrap();
    assert_eq!(fs::read(out.join("textured.glb")).unwrap(), before);
}

/// A hundredth of the size, in metres of a map.
#[test]
fn colours_are_found_on_a_map_and_in_a_small_unit() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), false);
    let place = |p: [f64; 3]| [4e5 + 0.01 * p[0], 5e6 + 0.01 * p[1], 0.01 * p[2]];
    let cameras = folder.path().join("transforms.json");
    let mut views: Value = serde_json::from_slice(&fs::read(&cameras).unwrap()).unwrap();
    for frame in views["frames"].as_array_mut().unwrap() {
        let rows = &mut frame["transform_matrix"];
        let eye = place([0, 1, 2].map(|row| rows[row][3].as_f64().unwrap()));
        (0..3).for_each(|row| rows[row][3] = json!(eye[row]));
    }
    fs::write(&cameras, views.to_string()).unwrap();
    let known = folder.path().join("known.obj");
    let placed = ball().positions().iter().map(|&p| place(p)).collect();
    Mesh::new(placed, ball().faces().to_vec()).unwrap().save(&known).unwrap();
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let words = ["--views", views, "--hold-out", "2", "--colour"];
    let of_known = run(&out, &[&words[..], &["--mesh", known.to_str().unwrap()]].concat()).unwrap();
    assert!(number(&of_known, "held_out_iou") > 0.98, "{of_known}");
    assert!(number(&of_known, "held_out_psnr") > 30.0, "{of_known}");
    let found = run(&out, &[&words[..], &["--steps", "40"]].concat()).unwrap();
    assert!(number(&found, "held_out_iou") > 0.95, "{found}");
    assert!(number(&found, "held_out_psnr") > 20.0, "{found}");
    for name in ["mesh.obj", "mesh.glb", "textured.glb"] {
        let [low, high] = Mesh::load(out.join(name)).unwrap().bounds();
        let (first, last) = (place([-1.1; 3]), place([1.1; 3]));
        assert!((0..3).all(|k| first[k] < low[k] && high[k] < last[k]), "{name}: {low:?} {high:?}");
    }
}

#[test]
fn a_luminance_that_is_the_mask_is_a_white_mesh() {
    let fox = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/views/fox");
    let out = tempfile::tempdir().unwrap();
    let words = ["--views", fox.to_str().unwrap(), "--colour", "--steps", "5"];
    run(out.path(), &words).unwrap();
    let mesh = Mesh::load(out.path().join("mesh.obj")).unwrap();
    // Grey pixels within the mask, as in a gap between legs, leave some grey.
    let colours = mesh.colours().unwrap();
    let white = colours.iter().filter(|colour| colour.iter().all(|&x| x > 0.95)).count();
    assert!(white * 10 > colours.len() * 9, "{white} of {}", colours.len());
}

#[test]
fn what_does_not_go_together_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), true);
    let (views, out) = (folder.path().to_str().unwrap(), folder.path().join("out"));
    let known = folder.path().join("known.ply");
    ball().save(&known).unwrap();
    let known = known.to_str().unwrap();
    let far = folder.path().join("far.ply");
    let moved = ball().positions().iter().map(|p| [p[0], p[1] + 900.0, p[2]]).collect();
    ball().with_positions(moved).unwrap().save(&far).unwrap();
    let error = |words: &[&str], parts: &[&str]| {
        let error = run(&out, words).unwrap_err();
        assert_eq!(error.lines().count(), 1, "{error}");
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        assert!(!out.join("report.html").exists());
    };
    error(&["--colour"], &["--colour", "--views"]);
    error(&["--views", views, "--mesh", known], &["--mesh", "--colour"]);
    error(
        &["--views", views, "--colour", "--mesh", known, "--smooth", "2"],
        &["--smooth", "--mesh"],
    );
    error(&["--views", views, "--colour", "--mesh", "no.ply"], &["no.ply"]);
    error(&["--views", views, "--masks-only", "--texture-size", "256"], &["--masks-only"]);
    error(&["--views", views, "--masks-only", "--colour"], &["--masks-only", "--colour"]);
    error(&["--views", views, "--normals", "--texture-size", "256"], &["--colour"]);
    error(&["--views", views, "--colour", "--texture-size", "63"], &["63", "64..=4096"]);
    error(&["--views", views, "--colour", "--texture-size", "5000"], &["5000", "64..=4096"]);
    // A mesh that lies elsewhere is painted by nothing: that is said.
    let words = ["--views", views, "--colour", "--mesh", far.to_str().unwrap(), "--steps", "1"];
    match run(&out.join("far"), &words) {
        Ok(found) => {
            assert!(found["warnings"][0].as_str().unwrap().contains("as it stands"), "{found}")
        }
        Err(error) => assert!(error.contains("no camera has the mesh before it"), "{error}"),
    }
    // A picture whose mask has another size.
    RgbImage::new(3, 3).save(folder.path().join("04.png")).unwrap();
    let words = ["--views", views, "--colour", "--mesh", known];
    error(&words, &["04.png", "3 x 3 pixels", "60 x 44"]);
}
