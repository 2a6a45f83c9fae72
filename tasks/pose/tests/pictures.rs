//! Poses from pictures: results and error messages.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{
    fs,
    path::{Path, PathBuf},
};

use image::{GrayImage, Luma, Rgba, RgbaImage};
use serde_json::{Value, json};
use softrast_inverse::{baked, silhouette_pixels};
use softrast_mesh::icosphere;
use softrast_raster::Pinhole;
use softrast_test_kit::Program;
use softrast_views::{camera_json, coloured_pixels};

/// Runs `pose solve` with results in `out`: its JSON, or its error line.
fn run(out: &Path, words: &[&str]) -> Result<Value, String> {
    let program = Program::new(env!("CARGO_BIN_EXE_pose"));
    let found = program.run_words(out, &[&["solve"], words].concat());
    found.map_err(|failure| failure.message.trim_end().to_owned())
}

fn fox(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/views/fox");
    folder.join(name).to_str().unwrap().to_owned()
}

/// Degrees between the rotations of two cameras.
fn angle_deg(a: &Value, b: &Value) -> f64 {
    let at = |of: &Value, k: usize| of["R"][k / 3][k % 3].as_f64().unwrap();
    let trace: f64 = (0..9).map(|k| at(a, k) * at(b, k)).sum();
    ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
}

#[test]
fn cameras_are_found_from_masks_alone() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for (view, file) in [(2, "2.png"), (7, "7.jpg")] {
        let mask = image::open(fox(&format!("images/{view:02}.png"))).unwrap();
        mask.to_luma8().save(folder.path().join(file)).unwrap();
    }
    let camera = fox("transforms.json");
    let words = ["--targets", folder.path().to_str().unwrap(), "--camera", &camera, "--size", "64"];
    let found = run(out.path(), &words).unwrap();
    let truth: Value = serde_json::from_slice(&fs::read(fox("truth.json")).unwrap()).unwrap();
    for (picture, view) in found["pictures"].as_array().unwrap().iter().zip([2, 7]) {
        let off = angle_deg(&picture["camera"], &truth["views"][view]);
        assert!(
            off < 5.0 && picture["iou"].as_f64().unwrap() > 0.9,
            "view {view}: {off}, {picture}"
        );
        let distance = |k: usize| {
            let of = |camera: &Value| camera["t"][k].as_f64().unwrap();
            (of(&picture["camera"]) - of(&truth["views"][view])).abs()
        };
        assert!((0..3).all(|k| distance(k) < 0.2), "view {view}: {picture}");
    }
    for file in ["result.json", "report.html", "poses.csv", "overlay-2.png", "overlay-7.jpg.png"] {
        assert!(out.path().join(file).exists(), "{file}");
    }
}

#[test]
fn a_result_is_a_start_and_a_camera_for_the_mesh_as_it_is_in_its_file() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    // The fox, three times as large and elsewhere.
    let mesh = softrast_mesh::fox();
    let place = |p: &[f64; 3]| [3.0 * p[0] + 5.0, 3.0 * p[1] - 2.0, 3.0 * p[2] + 1.0];
    let positions = mesh.positions().iter().map(place).collect();
    let path = folder.path().join("fox.obj");
    softrast_mesh::Mesh::new(positions, mesh.faces().to_vec()).unwrap().save(&path).unwrap();

    let truth: Value = serde_json::from_slice(&fs::read(fox("truth.json")).unwrap()).unwrap();
    let start = folder.path().join("start.json");
    fs::write(&start, truth["views"][4].to_string()).unwrap();
    let target = fox("images/04.png");
    let (start, camera) = (start.to_str().unwrap(), fox("transforms.json"));
    let words = ["--target", &target, "--camera", &camera, "--start", start, "--steps", "10"];
    let plain = run(out.path(), &words).unwrap();
    let result = out.path().join("result.json");
    let again = folder.path().join("again.json");
    fs::copy(&result, &again).unwrap();
    let words = [
        "--target",
        &target,
        "--camera",
        again.to_str().unwrap(),
        "--start",
        again.to_str().unwrap(),
        "--steps",
        "5",
    ];
    assert!(run(out.path(), &words).unwrap()["iou"].as_f64().unwrap() > 0.97);

    let mesh = path.to_str().unwrap();
    let words = ["--target", &target, "--camera", &camera, "--mesh", mesh, "--size", "64"];
    let moved = run(out.path(), &words).unwrap();
    let of_file = &moved["camera"];
    assert!(angle_deg(of_file, &plain["camera"]) < 3.0, "{moved}");
    // Both see the origin of the fox at the same place, three times as far away.
    let seen = |camera: &Value, p: [f64; 3]| {
        [0, 1, 2].map(|row| {
            let along = (0..3).map(|k| camera["R"][row][k].as_f64().unwrap() * p[k]).sum::<f64>();
            along + camera["t"][row].as_f64().unwrap()
        })
    };
    let ([x, y, z], [u, v, w]) =
        (seen(of_file, [5.0, -2.0, 1.0]), seen(&plain["camera"], [0.0; 3]));
    assert!((x / z - u / w).abs() < 0.02 && (y / z - v / w).abs() < 0.02, "{moved}");
    assert!((z / w / 3.0 - 1.0).abs() < 0.05, "{z} and {w}");
}

/// The fox in millimetres on a map in metres: with a start in the coordinates of the file, and searched in its own frame.
#[test]
fn a_mesh_on_a_map_is_seen_from_where_it_is() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (scale, origin) = (1e-3, [4.5e5, 5.2e6, 310.0]);
    let mesh = softrast_mesh::fox();
    let place = |p: &[f64; 3]| [0, 1, 2].map(|k| origin[k] + scale * p[k]);
    let positions = mesh.positions().iter().map(place).collect();
    let on_map = path("map.obj");
    softrast_mesh::Mesh::new(positions, mesh.faces().to_vec()).unwrap().save(&on_map).unwrap();

    let truth: Value = serde_json::from_slice(&fs::read(fox("truth.json")).unwrap()).unwrap();
    let truth = &truth["views"][4];
    let rotation = |camera: &Value| {
        [0, 1, 2].map(|row| [0, 1, 2].map(|k| camera["R"][row][k].as_f64().unwrap()))
    };
    let eye = |camera: &Value| {
        let (r, t) = (rotation(camera), [0, 1, 2].map(|k| camera["t"][k].as_f64().unwrap()));
        [0, 1, 2].map(|k| -(0..3).map(|row| r[row][k] * t[row]).sum::<f64>())
    };
    let stood = place(&eye(truth));
    let t = rotation(truth).map(|row| -(0..3).map(|k| row[k] * stood[k]).sum::<f64>());
    let start = path("start.json");
    fs::write(&start, json!({ "R": truth["R"], "t": t }).to_string()).unwrap();
    let (target, camera) = (fox("images/04.png"), fox("transforms.json"));
    let words = ["--target", &target, "--camera", &camera, "--mesh", &on_map];
    for more in [vec!["--raw", "--start", &start, "--steps", "10"], vec!["--size", "64"]] {
        let found = run(out.path(), &[&words[..], &more].concat()).unwrap();
        assert!(found["iou"].as_f64().unwrap() > 0.97, "{more:?}: {found}");
        let of_file = &found["camera"];
        assert!(angle_deg(of_file, truth) < 3.0, "{more:?}: {found}");
        let off = (0..3).map(|k| (eye(of_file)[k] - stood[k]).abs()).fold(0.0, f64::max);
        assert!(off < 0.2 * scale, "{more:?}: the camera is {off} away from where it stood");
    }
}

fn picture(folder: &Path, name: &str, pixel: impl Fn(u32, u32) -> u8) -> PathBuf {
    let path = folder.join(name);
    GrayImage::from_fn(40, 30, |x, y| Luma([pixel(x, y)])).save(&path).unwrap();
    path
}

#[test]
fn bad_input_is_one_line_that_says_what_to_do_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, value: Value| {
        let path = folder.path().join(name);
        fs::write(&path, value.to_string()).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let of = |path: PathBuf| path.to_str().unwrap().to_owned();
    let disc = of(picture(folder.path(), "disc.png", |x, y| {
        if x.abs_diff(20).pow(2) + y.abs_diff(15).pow(2) < 60 { 255 } else { 0 }
    }));
    let empty = of(picture(folder.path(), "empty.png", |_, _| 0));
    let full = of(picture(folder.path(), "full.png", |_, _| 255));
    let camera = json!({ "fx": 50.0, "width": 40, "height": 30 });
    let wrong_size = write("size.json", json!({ "fx": 50.0, "width": 80, "height": 60 }));
    let distorted = write("lens.json", json!({ "fx": 50.0, "camera_model": "FOV" }));
    let fisheye = write("fish.json", json!({ "fx": 50.0, "camera_model": "THIN_PRISM_FISHEYE" }));
    let no_focal = write("none.json", json!({ "cx": 20.0 }));
    let skewed = write("skew.json", json!({ "K": [[50, 3, 20], [0, 50, 15], [0, 0, 1]] }));
    let turned_k = write("k.json", json!({ "K": [[50, 0, 0], [0, 50, 0], [20, 15, 1]] }));
    let listed = write("cv.json", json!({ "fx": 50.0, "dist": [[-20.0, 0.0, 0.0, 0.0, 0.0]] }));
    let text = write("text.json", json!({ "fx": "50" }));
    let not_a_number = of(folder.path().join("nan.json"));
    fs::write(&not_a_number, r#"{"fx": 50.0, "cx": NaN}"#).unwrap();
    let good = write("good.json", camera);
    let turned =
        write("r.json", json!({ "R": [[1, 0, 0], [0, 1, 0.1], [0, 0, 1]], "t": [0, 0, 4] }));
    let mirrored =
        write("m.json", json!({ "R": [[1, 0, 0], [0, 1, 0], [0, 0, -1]], "t": [0, 0, 4] }));
    let inside =
        write("in.json", json!({ "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 0.1] }));
    let scaled = write("s.json", json!({ "R": [[2, 0, 0], [0, 2, 0], [0, 0, 2]], "t": [0, 0, 4] }));
    let nowhere = write("no.json", json!({}));
    let no_length = write("fx.json", json!({ "fx": 5e-324, "width": 40, "height": 30 }));
    let far =
        write("far.json", json!({ "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 1e300] }));
    let classes = of(picture(folder.path(), "zz.png", |x, y| ((x + y) % 4) as u8));
    let plain = of(folder.path().join("plain.obj"));
    icosphere(1).save(&plain).unwrap();
    for (words, parts) in [
        (vec!["--target", "missing.png"], vec!["missing.png"]),
        (vec!["--target", &good], vec!["good.json", "no picture"]),
        (vec!["--target", &empty], vec!["empty.png", "the mask is empty", "all are black"]),
        (vec!["--target", &full], vec!["full.png", "the mask is full"]),
        (
            vec!["--target", &disc, "--camera", &wrong_size],
            vec!["size.json", "disc.png", "80 x 60", "40 x 30"],
        ),
        (
            vec!["--target", &disc, "--camera", &distorted],
            vec!["lens.json", "the camera model FOV", "undistort"],
        ),
        (vec!["--target", &disc, "--camera", &fisheye], vec!["THIN_PRISM_FISHEYE", "undistort"]),
        (vec!["--target", &disc, "--camera", &no_focal], vec!["none.json", "no focal length"]),
        (vec!["--target", &disc, "--camera", &skewed], vec!["skew.json", "skew of 3"]),
        (vec!["--target", &disc, "--camera", &turned_k], vec!["k.json", "transposed"]),
        (vec!["--target", &disc, "--camera", &listed], vec!["cv.json", "fold the picture"]),
        (
            vec!["--target", &disc, "--camera", &text],
            vec!["text.json", "fx is \"50\", not a number"],
        ),
        (
            vec!["--target", &disc, "--camera", &not_a_number],
            vec!["nan.json", "cx is NaN or infinite"],
        ),
        (vec!["--target", &disc, "--range", "15-35"], vec!["--range", "leave it out"]),
        (
            vec!["--targets", folder.path().to_str().unwrap()],
            vec!["empty.png", "the mask is empty"],
        ),
        (vec!["--target", &disc, "--start", &turned], vec!["r.json", "no rotation", "1.00e-1"]),
        (vec!["--target", &disc, "--start", &mirrored], vec!["m.json", "mirrors"]),
        (
            vec!["--target", &disc, "--start", &inside],
            vec!["disc.png", "inside the mesh", "units of the mesh"],
        ),
        (vec!["--target", &disc, "--start", &nowhere], vec!["no.json", "R and t"]),
        (vec!["--target", &disc, "--start", &scaled], vec!["s.json", "a rotation times 2.0"]),
        (vec!["--target", &disc, "--start", &far], vec!["far.json", "other units"]),
        (vec!["--target", &disc, "--camera", &no_length], vec!["fx.json", "fx is 5e-324 pixels"]),
        (
            vec!["--target", &classes],
            vec!["zz.png", "brightest level is 0.0118", "--threshold 0.011"],
        ),
        (vec!["--target", "/dev/zero"], vec!["/dev/zero", "not a file"]),
        (vec!["--target", &disc, "--camera", "/dev/zero"], vec!["/dev/zero", "not a file"]),
        (vec!["--camera", &good], vec!["--target"]),
        (vec!["--targets", "missing"], vec!["missing", "folder"]),
        (vec!["--target", &disc, "--softness", "auto"], vec!["--softness auto"]),
        (
            vec!["--target", &disc, "--colour", "--mesh", &plain],
            vec!["plain.obj", "a texture or with colours at its vertices"],
        ),
    ] {
        let out = folder.path().join("out");
        let error = run(&out, &words).unwrap_err();
        assert_eq!(error.lines().count(), 1, "{words:?}: {error}");
        assert!(parts.iter().all(|part| error.contains(part)), "{words:?}: {error}");
        assert!(!out.join("report.html").exists(), "{words:?}");
    }
}

#[test]
fn a_mask_may_be_black_and_a_field_of_view_unknown() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut mask = image::open(fox("images/04.png")).unwrap().to_luma8();
    mask.pixels_mut().for_each(|pixel| pixel.0[0] = 200 - pixel.0[0] / 2);
    let path = folder.path().join("black.png");
    mask.save(&path).unwrap();
    let target = ["--target", path.to_str().unwrap(), "--invert", "--threshold", "0.5"];
    let found = run(out.path(), &[&target[..], &["--size", "64", "--optimise-fov"]].concat());
    let found = found.unwrap();
    let truth: Value = serde_json::from_slice(&fs::read(fox("truth.json")).unwrap()).unwrap();
    let off = angle_deg(&found["camera"], &truth["views"][4]);
    assert!(off < 8.0 && found["iou"].as_f64().unwrap() > 0.95, "{off} degrees off, {found}");
    assert!(found["warnings"][0].as_str().unwrap().contains("field of view"), "{found}");
    // Pictures of others are not removed, whatever their names.
    fs::write(out.path().join("overlay-a.png"), b"mine").unwrap();
    fs::write(out.path().join("mine.png"), b"mine").unwrap();
    let again = run(out.path(), &[&target[..], &["--size", "32", "--steps", "1"]].concat());
    assert!(again.is_ok());
    for name in ["overlay-a.png", "mine.png"] {
        assert_eq!(fs::read(out.path().join(name)).unwrap(), b"mine");
    }
}

/// A mask of 0 and 1, rotated in its file, from a start with three decimals: the result of the plain mask, with two warnings.
#[test]
fn masks_as_tools_write_them_give_the_pose_of_the_plain_mask() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut mask = image::open(fox("images/04.png")).unwrap().to_luma8();
    mask.pixels_mut().for_each(|pixel| pixel.0[0] = u8::from(pixel.0[0] >= 128));
    let upside_down = image::imageops::rotate180(&mask);
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (target, start) = (path("classes.png"), path("start.json"));
    let mut encoder = png_of(&upside_down);
    // Exif data for a rotation by 180 degrees, in a chunk after the head.
    let exif = b"\0\0\0\x1aeXIfII*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x03\0\0\0\0\0\0\0";
    let sum = exif[4..].iter().fold(u32::MAX, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 }
        })
    });
    encoder.splice(33..33, [&exif[..], &(!sum).to_be_bytes()].concat());
    fs::write(&target, encoder).unwrap();
    let truth: Value = serde_json::from_slice(&fs::read(fox("truth.json")).unwrap()).unwrap();
    let rounded =
        |k: usize| (1e3 * truth["views"][4]["R"][k / 3][k % 3].as_f64().unwrap()).round() / 1e3;
    let r = [0, 3, 6].map(|row| [rounded(row), rounded(row + 1), rounded(row + 2)]);
    fs::write(&start, json!({ "R": r, "t": truth["views"][4]["t"] }).to_string()).unwrap();
    let camera = fox("transforms.json");
    let words = ["--target", &target, "--camera", &camera, "--start", &start, "--steps", "5"];
    let found = run(out.path(), &words).unwrap();
    let off = angle_deg(&found["camera"], &truth["views"][4]);
    assert!(off < 2.0 && found["iou"].as_f64().unwrap() > 0.97, "{off} degrees off, {found}");
    let said = found["warnings"].to_string();
    assert!(said.contains("one level is above black and nothing else, 0.0039"), "{said}");
    assert!(said.contains("its rotation is rounded"), "{said}");
}

#[test]
fn a_lens_that_distorts_is_undone_whether_nerfstudio_or_colmap_tells_it() {
    let out = tempfile::tempdir().unwrap();
    let lens = |name: &str| fox(&format!("../fox_lens/{name}"));
    let truth: Value = serde_json::from_slice(&fs::read(lens("truth.json")).unwrap()).unwrap();
    let start = out.path().join("start.json");
    fs::write(&start, truth["views"][5].to_string()).unwrap();
    let (target, masks) = (lens("images/05.png"), lens("masks"));
    let common = ["--target", &target, "--start", start.to_str().unwrap(), "--steps", "5"];
    for camera in [
        &["--camera", &lens("transforms.json")][..],
        &["--camera", &lens("sparse/0"), "--masks", &masks],
    ] {
        let found = run(&out.path().join("results"), &[&common, camera].concat()).unwrap();
        let off = angle_deg(&found["camera"], &truth["views"][5]);
        assert!(off < 1.5 && found["iou"].as_f64().unwrap() > 0.97, "{off} degrees off, {found}");
        assert_eq!(found["undistorted"]["k1"], json!(-0.15));
        assert!(found["warnings"].to_string().contains("the lens distorts"), "{found}");
        // The pose in other formats is the same.
        let again = out.path().join("again.json");
        let frame = json!({ "transform_matrix": found["camera"]["transform_matrix"] });
        fs::write(&again, frame.to_string()).unwrap();
        let pose = softrast_views::PoseFile::load(&again).unwrap();
        let pairs = (0..9).map(|k| (k / 3, k % 3));
        let same = |(i, j): (usize, usize)| {
            (pose.rotation[i][j] - found["camera"]["R"][i][j].as_f64().unwrap()).abs() < 1e-9
        };
        assert!(pairs.into_iter().all(same), "{found}");
    }
    // Without coefficients nothing is undistorted, and a picture without a mask is refused.
    let plain = out.path().join("camera.json");
    let k = &truth["views"][5]["K"];
    fs::write(&plain, json!({ "K": k }).to_string()).unwrap();
    let words = ["--camera", plain.to_str().unwrap(), "--masks", &masks];
    let bent = run(&out.path().join("results"), &[&common[..], &words].concat()).unwrap();
    assert!(bent["undistorted"].is_null());
    let error = run(&out.path().join("none"), &[&common[..], &words[..2]].concat()).unwrap_err();
    assert!(error.contains("looks like a photograph"), "{error}");
}

fn png_of(image: &GrayImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn a_tall_picture_takes_no_more_memory_than_its_pixels_ask_for() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = folder.path().join("tall.png");
    let white = |_: u32, y: u32| Luma([if (4000..9000).contains(&y) { 255 } else { 0 }]);
    GrayImage::from_fn(2, 20_000, white).save(&path).unwrap();
    let camera = folder.path().join("camera.json");
    fs::write(&camera, r#"{"fx": 20000}"#).unwrap();
    let words = ["--target", path.to_str().unwrap(), "--camera", camera.to_str().unwrap()];
    run(out.path(), &[&words[..], &["--size", "16", "--steps", "1"]].concat()).unwrap();
    let page = fs::metadata(out.path().join("report.html")).unwrap().len();
    assert!(page < 2_000_000, "{page} bytes");
}

/// The picture shows two fifths of the fox, so that the mask has neither its place nor its size.
#[test]
fn a_fox_that_the_picture_cuts_off_is_found() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let rotation = [
        [-0.9164520202629824, 0.26906426305615627, 0.296175820927275],
        [0.38533065528645427, 0.3938902831633908, 0.8344883048467339],
        [0.1078702028013735, 0.8788941160205314, -0.4646602545646432],
    ];
    let camera = Pinhole {
        rotation,
        translation: [0.0, 0.0, 3.771634736567437],
        focal: [195.28171635289755; 2],
        centre: [80.90161451093375, 119.34375],
        size: [120, 160].into(),
    };
    // Four by four samples per pixel.
    let fine = silhouette_pixels(
        &softrast_mesh::fox(),
        &camera.cropped([0.0; 2], [160.0, 120.0], [480, 640]),
    );
    let level = |x: u32, y: u32| {
        let sample = |k: u32| fine[((4 * y + k / 4) * 640 + 4 * x + k % 4) as usize];
        Luma([((0..16).map(sample).sum::<f64>() / 16.0 * 255.0).round() as u8])
    };
    let (target, lens) = (path("mask.png"), path("camera.json"));
    GrayImage::from_fn(160, 120, level).save(&target).unwrap();
    let truth = camera_json(&camera);
    fs::write(&lens, json!({ "K": truth["K"] }).to_string()).unwrap();
    let found = run(out.path(), &["--target", &target, "--camera", &lens]).unwrap();
    let off = angle_deg(&found["camera"], &truth);
    assert!(off < 5.0, "{off} degrees off, {found}");
    assert_eq!(found["cut_sides"], json!(["bottom"]));
    let warning = found["warnings"][0].as_str().unwrap();
    assert!(warning.contains("mask.png: the mask reaches the bottom of the picture"), "{warning}");
}

/// A bottle looks the same at every rotation about its axis: one answer, not six.
#[test]
fn the_turns_of_a_bottle_are_one_pose() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    const ROUND: u32 = 48;
    let outline = [(0.0, -1.0), (0.4, -1.0), (0.45, 0.1), (0.15, 0.5), (0.15, 1.0), (0.0, 1.0)];
    let ring = |&(radius, height): &(f64, f64)| {
        (0..ROUND).map(move |k| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(ROUND)).sin_cos();
            [radius * cos, height, radius * sin]
        })
    };
    let positions = outline.iter().flat_map(ring).collect();
    let faces = (0..outline.len() as u32 - 1).flat_map(|row| {
        (0..ROUND).flat_map(move |k| {
            let (a, b) = (row * ROUND + k, row * ROUND + (k + 1) % ROUND);
            [[a, b, a + ROUND], [b, b + ROUND, a + ROUND]]
        })
    });
    let bottle = softrast_mesh::Mesh::new(positions, faces.collect()).unwrap();
    let mesh = folder.path().join("bottle.obj");
    bottle.save(&mesh).unwrap();
    let camera = Pinhole::look_at([2.0, 2.0, -3.0], [0.0; 3], [0.0, 1.0, 0.0], 45.0, [80, 80]);
    let mask: Vec<u8> =
        silhouette_pixels(&bottle, &camera).into_iter().map(|x| (255.0 * x) as u8).collect();
    let path = folder.path().join("mask.png");
    GrayImage::from_raw(80, 80, mask).unwrap().save(&path).unwrap();
    let words = ["--mesh", mesh.to_str().unwrap(), "--target", path.to_str().unwrap()];
    let found = run(out.path(), &words).unwrap();
    assert!(found["iou"].as_f64().unwrap() > 0.97, "{found}");
    // From the front, or tilted away as far as towards. Rounding decides whether one of its rotations counts as another pose.
    assert!(found["alternatives"].as_array().unwrap().len() <= 3, "{found}");
    // The unknown rotation is reported.
    assert!(
        found["warnings"].to_string().contains("turned by any angle about (0.00, 1.00, 0.00)"),
        "{found}"
    );
    assert_eq!(found["mesh"]["symmetries"][0]["degrees"], json!(null), "{found}");
}

/// Specks all over and a gap in the outline: the pose is still near the right one.
#[test]
fn specks_and_gaps_do_not_lead_astray() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut mask = image::open(fox("images/04.png")).unwrap().to_luma8();
    for (k, pixel) in mask.pixels_mut().enumerate() {
        if k * 7919 % 97 == 0 {
            pixel.0[0] = 255 - pixel.0[0];
        }
    }
    for (_, _, pixel) in
        mask.enumerate_pixels_mut().filter(|(x, y, _)| x.abs_diff(60) < 4 && y % 3 > 0)
    {
        pixel.0[0] = 0;
    }
    let path = folder.path().join("noisy.png");
    mask.save(&path).unwrap();
    let camera = fox("transforms.json");
    let words = ["--target", path.to_str().unwrap(), "--camera", &camera, "--size", "64"];
    let found = run(out.path(), &words).unwrap();
    let truth: Value = serde_json::from_slice(&fs::read(fox("truth.json")).unwrap()).unwrap();
    let off = angle_deg(&found["camera"], &truth["views"][4]);
    assert!(off < 5.0, "{off} degrees off, {found}");
    assert_eq!(found["mesh"]["symmetries"], json!([]));
}

/// A ball looks the same from everywhere except for its colours.
#[test]
fn a_ball_is_found_by_its_colours() {
    let (out, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let ball = icosphere(3);
    let colours = ball.positions().iter();
    let colours =
        colours.map(|&[x, y, z]| [0.5 + 0.4 * (2.0 * x + y).sin(), 0.9 * y.abs(), 0.5 - 0.4 * z]);
    let ball = ball.clone().with_colours(colours.collect()).unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (mesh, target, lens) = (path("ball.ply"), path("ball.png"), path("camera.json"));
    ball.save(&mesh).unwrap();
    let camera =
        Pinhole::look_at([2.0, 1.5, -2.5], [0.1, 0.0, 0.0], [0.3, 1.0, 0.0], 45.0, [60, 80]);
    let [red, green, blue, covered] = coloured_pixels(&ball, &camera);
    let picture = RgbaImage::from_fn(80, 60, |x, y| {
        let pixel = (80 * y + x) as usize;
        let level = |channel: &[f64]| (255.0 * channel[pixel] / covered[pixel].max(1e-9)) as u8;
        Rgba([level(&red), level(&green), level(&blue), (255.0 * covered[pixel]) as u8])
    });
    picture.save(&target).unwrap();
    let truth = camera_json(&camera);
    fs::write(&lens, json!({ "K": truth["K"], "width": 80, "height": 60 }).to_string()).unwrap();
    let words = ["--mesh", &mesh, "--target", &target, "--camera", &lens, "--size", "64"];
    let found = run(out.path(), &[&words[..], &["--colour"]].concat()).unwrap();
    // With these colours as a texture, as shape3d writes it.
    let textured = folder.path().join("textured.glb");
    baked(&ball, &ball).unwrap().save(&textured).unwrap();
    let of_texture = ["--mesh", textured.to_str().unwrap(), "--raw", "--colour"];
    let seen = words.iter().skip_while(|word| **word != "--target").copied().collect::<Vec<_>>();
    let out_of_texture = tempfile::tempdir().unwrap();
    let by_texture = run(out_of_texture.path(), &[&seen[..], &of_texture].concat()).unwrap();
    for found in [&found, &by_texture] {
        let off = angle_deg(&found["camera"], &truth);
        assert!(off < 4.0 && found["psnr"].as_f64().unwrap() > 25.0, "{off} degrees off, {found}");
    }
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("The mesh in its own colours"), "the colours are not shown");
    // By its silhouette alone, any pose fits.
    let found = run(out.path(), &words).unwrap();
    assert!(angle_deg(&found["camera"], &truth) > 10.0 && found["psnr"].is_null(), "{found}");
}

#[test]
fn it_ends_on_a_machine_of_one_core() {
    let program = Program::new(env!("CARGO_BIN_EXE_pose")).on_one_thread();
    let (out, target) = (tempfile::tempdir().unwrap(), fox("images/03.png"));
    let line = format!("--target {target} --camera {}", fox("transforms.json"));
    program.run_in(out.path(), &line).unwrap();
}
