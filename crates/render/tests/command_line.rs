//! The program from its command line: output, files and errors.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path, process::Command};

use image::{Rgb, RgbImage};
use serde_json::{Value, json};
use softrast_inverse::ScheduledSoftness;
use softrast_lab::Failure;
use softrast_mesh::{Mesh, icosphere};
use softrast_softness::{EdgeSoftness, Family};
use softrast_test_kit::{Program, ended};

fn mesh(folder: &Path) -> String {
    let path = folder.join("sphere.obj");
    icosphere(1).save(&path).expect("the folder can be written");
    path.to_str().expect("a path in ASCII").to_owned()
}

fn run(words: &[&str]) -> Result<String, Failure> {
    let output = Command::new(env!("CARGO_BIN_EXE_render")).args(words).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).expect("all that is printed is UTF-8");
    match output.status.code() {
        Some(0) => Ok(text(output.stdout)),
        code => Err(Failure {
            code: code.unwrap().try_into().unwrap(),
            message: text(output.stderr).trim_end().to_owned(),
        }),
    }
}

fn json(words: &[&str]) -> Value {
    let printed = run(words).expect("the command line is right");
    let last = printed.lines().last().expect("something is printed");
    serde_json::from_str(last).expect("the last line is JSON")
}

#[test]
fn the_fused_op_gives_the_numbers_of_the_reference() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, out) = (mesh(folder.path()), folder.path().join("a/sphere.png"));
    let words = "--size 24 --azimuths 0,50,100 --scale 0.02 --target disk:0.1,-0.05,0.4 --json";
    let words: Vec<&str> = words.split(' ').collect();
    let words = [&[&mesh, "--out", out.to_str().unwrap()], &words[..]].concat();
    let fused = json(&words);
    let dense = json(&[&words[..], &["--reference"]].concat());
    for (key, bound) in [("mean_alpha", 1e-4), ("loss", 1e-4), ("gradient_norm", 1e-3)] {
        let [a, b] = [&fused, &dense].map(|report| report[key].as_f64().unwrap());
        assert!((a - b).abs() <= bound * b, "{key}: {a} and {b}");
    }
    assert_eq!(dense["pairs"], 24 * 24 * 80 * 3);
    assert!(fused["pairs"].as_u64() <= dense["pairs"].as_u64());
    assert_eq!([&fused["faces"], &fused["views"], &fused["size"]], [80, 3, 24]);
    for key in ["forward_ms", "backward_ms", "total_ms", "profile_knots"] {
        assert!(fused[key].as_f64().unwrap() > 0.0, "{key}");
    }
    let picture = image::open(&out).unwrap();
    assert_eq!(picture.width(), 3 * 24 + 4 * 2, "a contact sheet of three");
    assert_eq!(fs::read_dir(out.parent().unwrap()).unwrap().count(), 1, "nothing else is left");
}

#[test]
fn a_picture_is_its_own_target() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh(folder.path());
    let [first, second] = ["first.png", "second.png"].map(|name| folder.path().join(name));
    let [first, second] = [&first, &second].map(|path| path.to_str().unwrap());
    run(&[&mesh, "--size", "40", "--out", first]).unwrap();
    let report = json(&[&mesh, "--size", "40", "--out", second, "--target", first, "--json"]);
    // The picture has 8 bits.
    assert!(report["loss"].as_f64().unwrap() < 1e-5, "{report}");
}

#[test]
fn a_softness_file_whose_scale_moves_is_drawn_as_at_its_last_step() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh(folder.path());
    let [out, file] = ["sphere.png", "learned.json"].map(|name| folder.path().join(name));
    let decay = ScheduledSoftness::decay(EdgeSoftness::new(Family::Logistic), 0.3, 0.02);
    decay.save(&file).unwrap();
    let words = |softness: [&str; 2]| {
        let common = [&mesh, "--size", "32", "--json", "--out", out.to_str().unwrap()];
        json(&[&common[..], &softness].concat())["mean_alpha"].as_f64().unwrap()
    };
    let [of_file, named] = [["--softness", file.to_str().unwrap()], ["--scale", "0.02"]].map(words);
    assert!((of_file / named - 1.0).abs() < 1e-6, "{of_file}, not {named}");
}

#[test]
fn a_tolerance_that_culls_most_of_what_counts_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh(folder.path());
    let out = folder.path().join("sphere.png");
    let culled = |tolerance: &str| {
        let words = ["--size", "32", "--scale", "0.05", "--json", "--out", out.to_str().unwrap()];
        let words = [&[&mesh, "--tolerance", tolerance], &words[..]].concat();
        json(&words)["culled_by_tolerance"].as_f64().unwrap()
    };
    assert_eq!(culled("1e-5"), 0.0);
    assert_eq!(culled("1e-7"), 0.0);
    assert!(culled("0.9") > 0.5);
}

#[test]
fn bad_input_is_one_line_and_leaves_no_picture() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = mesh(folder.path());
    let blocked = folder.path().join("sphere.obj/out.png");
    let blocked = blocked.to_str().unwrap();
    let out = folder.path().join("out.png");
    let cases: [(&[&str], u8, &str); 13] = [
        (&["missing.obj"], 1, "missing.obj: cannot be read"),
        (&[&mesh, "--size", "0"], 2, "whole number from 1 to 4096"),
        (&[&mesh, "--scale", "-1"], 2, "expected a positive number"),
        (&[&mesh, "--azimuths", "1,,2"], 2, "with commas between them"),
        (&[&mesh, "--fov", "180"], 2, "between 0 and 180"),
        (&[&mesh, "--tolerance", "1"], 2, "above 0 and below 1"),
        (&[&mesh, "--softness", "soft"], 2, "known are logistic, bilogit, gauss"),
        (&[&mesh, "--softness", "missing.json"], 1, "missing.json"),
        (&[&mesh, "--softness", "a.json", "--squared"], 2, "a file has its own"),
        (&[&mesh, "--t-conorm", "max"], 2, "use probabilistic, einstein"),
        (&[&mesh, "--backend", "opencl"], 2, "expected ndarray, flex, wgpu or cuda"),
        (&[&mesh, "--target", &mesh], 1, "cannot read the target"),
        (&[&mesh, "--out", blocked], 1, "choose another with --out"),
    ];
    for (words, code, message) in cases {
        let mut words = words.to_vec();
        if !words.contains(&"--out") {
            words.extend(["--out", out.to_str().unwrap()]);
        }
        let failure = run(&words).unwrap_err();
        let line = failure.to_string();
        assert!(line.contains(message) && !line.contains('\n'), "{words:?}: {line}");
        assert_eq!(failure.code, code, "{line}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "the mesh alone is left");
}

/// A square from -1 to 1 in x and y at z = 0, which looks along z. A picture on it has its v up and its u along x.
const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
    f 1/1 2/2 3/3 4/4\n";
const RED: [u8; 3] = [255, 0, 0];
const GREEN: [u8; 3] = [0, 255, 0];
const BLUE: [u8; 3] = [0, 0, 255];
const WHITE: [u8; 3] = [255; 3];
/// View of the square from the front: it fills the middle half of the image in each direction.
const FRONT: [&str; 10] = [
    "--colour",
    "--raw",
    "--azimuths",
    "180",
    "--elevation",
    "0",
    "--fov",
    "90",
    "--distance",
    "2",
];

/// The square with a picture that is red and green above, blue and black below, as OBJ and as GLB.
fn pictured(folder: &Path) -> [String; 2] {
    let picture = RgbImage::from_fn(32, 16, |x, y| {
        Rgb(match (x < 16, y < 8) {
            (true, true) => RED,
            (false, true) => GREEN,
            (true, false) => BLUE,
            (false, false) => [0; 3],
        })
    });
    picture.save(folder.join("square.png")).unwrap();
    fs::write(folder.join("square.mtl"), "newmtl a\nmap_Kd square.png\n").unwrap();
    fs::write(folder.join("square.obj"), format!("mtllib square.mtl\nusemtl a\n{SQUARE}")).unwrap();
    let [obj, glb] = ["square.obj", "square.glb"].map(|name| folder.join(name));
    let (mesh, warnings) = Mesh::load_textured(&obj).unwrap();
    assert!(warnings.is_empty());
    mesh.save(&glb).unwrap();
    [obj, glb].map(|path| path.to_str().expect("a path in ASCII").to_owned())
}

/// The picture and the results of a square from the front, on 64 pixels a side.
fn front(mesh: &str, words: &[&str]) -> (RgbImage, Value) {
    let out = format!("{mesh}.out.png");
    let common = [mesh, "--size", "64", "--json", "--out", &out];
    let report = json(&[&common[..], &FRONT, words].concat());
    (image::open(out).unwrap().into_rgb8(), report)
}

#[test]
fn faces_that_reach_behind_a_camera_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (floor, out) = (path("floor.obj"), path("floor.png"));
    let text = "v -9 -1 -9\nv 9 -1 -9\nv 9 -1 9\nv -9 -1 9\nf 1 3 2\nf 1 4 3\n";
    fs::write(&floor, text).unwrap();
    let run = |more: &[&str]| {
        let words = [&[&*floor, "--size", "16", "--out", &out, "--quiet"], more].concat();
        let output = Command::new(env!("CARGO_BIN_EXE_render")).args(words).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let said = run(&["--raw", "--distance", "1"]);
    assert!(said.contains("2 of 2 faces reach behind the camera of azimuth 30"), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert_eq!(run(&[]), "");
}

/// A mask of 20,000 x 20,000 and a texture of 8192 x 8192 are drawn within a gibibyte.
#[test]
fn large_pictures_take_less_than_a_gibibyte() {
    use image::{ExtendedColorType, ImageEncoder, codecs::png};
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let written = |name: &str, side: u32, colour: ExtendedColorType, channels: usize| {
        // Black, which compresses well, except a white square in the middle.
        let (side, mut pixels) = (side as usize, vec![0; side as usize * side as usize * channels]);
        for row in 4 * side / 9..5 * side / 9 {
            let start = (row * side + 4 * side / 9) * channels;
            pixels[start..start + side / 9 * channels].fill(255);
        }
        let side = side as u32;
        let file = std::io::BufWriter::new(fs::File::create(path(name)).unwrap());
        let (fast, plain) = (png::CompressionType::Fast, png::FilterType::NoFilter);
        let encoder = png::PngEncoder::new_with_quality(file, fast, plain);
        encoder.write_image(&pixels, side, side, colour).unwrap();
        path(name)
    };
    let target = written("mask.png", 20_000, ExtendedColorType::L8, 1);
    let texture = written("texture.png", 8192, ExtendedColorType::Rgb8, 3);
    let square = path("square.obj");
    let text = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\n";
    fs::write(&square, text).unwrap();
    let out = path("out.png");
    let most = |words: &[&str]| {
        let words = [&[&*square, "--size", "32", "--repeat", "1", "--out", &out, "--json"], words];
        json(&words.concat())["peak_rss_mib"].as_f64().unwrap()
    };
    let [of_mask, of_texture] =
        [most(&["--target", &target]), most(&["--colour", "--texture", &texture])];
    assert!(of_mask < 1024.0 && of_texture < 1024.0, "{of_mask} and {of_texture} MiB");
}

#[test]
fn a_texture_is_seen_where_its_coordinates_place_it() {
    let folder = tempfile::tempdir().unwrap();
    let [obj, glb] = pictured(folder.path());
    let (picture, report) = front(&obj, &[]);
    for (x, y, colour) in
        [(20, 20, RED), (44, 20, GREEN), (20, 44, BLUE), (44, 44, [0; 3]), (8, 32, WHITE)]
    {
        assert_eq!(picture.get_pixel(x, y).0, colour, "at {x}, {y}");
    }
    assert_eq!(report["colour"], "texture of 32 x 16 texels");
    assert_eq!([&report["samples"], &report["shade"]], [&json!(4), &json!(false)]);
    // A quarter of the image, except a thousandth of it for the background.
    let covered = report["mean_alpha"].as_f64().unwrap();
    assert!((0.2497..0.2503).contains(&covered), "{covered}");
    assert!(report["forward_ms"].as_f64().unwrap() > 0.0);
    assert_eq!(report["t_conorm"], Value::Null);
    assert_eq!(front(&glb, &[]).0, picture);
    for one in [["--samples", "1"], ["--scale", "0.05"], ["--softness", "logistic"]] {
        assert_eq!(front(&obj, &one).1["samples"], 1);
    }
}

#[test]
fn each_material_shows_its_own_picture_or_colour() {
    let folder = tempfile::tempdir().unwrap();
    // A column of three squares: a picture, a colour, another picture.
    let square = |k: u32| {
        let (low, first) = (f64::from(k) - 1.5, 4 * k);
        let at = |x: f64, y: f64| format!("v {x} {} 0\n", low + y);
        let v = [at(-1.5, 0.0), at(1.5, 0.0), at(1.5, 1.0), at(-1.5, 1.0)].concat();
        let corner = |n: u32| format!("{}/{n}", first + n);
        format!("{v}usemtl m{k}\nf {} {} {} {}\n", corner(1), corner(2), corner(3), corner(4))
    };
    let all: String = (0..3).map(square).collect();
    let obj = format!("mtllib a.mtl\nvt 0 0\nvt 2 0\nvt 2 1\nvt 0 1\n{all}");
    let path = folder.path().join("a.obj");
    fs::write(&path, obj).unwrap();
    let mtl = "newmtl m0\nmap_Kd halves.png\nnewmtl m1\nKd 0 1 0\nnewmtl m2\nmap_Kd blue.png\n";
    fs::write(folder.path().join("a.mtl"), mtl).unwrap();
    let halves = |x: u32, _| Rgb(if x < 8 { RED } else { WHITE });
    RgbImage::from_fn(16, 8, halves).save(folder.path().join("halves.png")).unwrap();
    RgbImage::from_pixel(5, 3, Rgb(BLUE)).save(folder.path().join("blue.png")).unwrap();
    let (picture, _) = front(path.to_str().unwrap(), &[]);
    // Twice red and white from the left to the right.
    for (x, y, colour) in [
        (14, 48, RED),
        (26, 48, WHITE),
        (38, 48, RED),
        (50, 48, WHITE),
        (20, 32, GREEN),
        (44, 32, GREEN),
        (14, 16, BLUE),
        (50, 16, BLUE),
    ] {
        assert_eq!(picture.get_pixel(x, y).0, colour, "at {x}, {y}");
    }
}

#[test]
fn a_picture_may_be_replaced_and_may_be_missing() {
    let folder = tempfile::tempdir().unwrap();
    let [obj, _] = pictured(folder.path());
    let other = folder.path().join("other.png");
    RgbImage::from_pixel(2, 3, Rgb([10, 20, 30])).save(&other).unwrap();
    let texture = ["--texture", other.to_str().unwrap()];
    let own = folder.path().join("square.png");
    let truncated = fs::read(&own).unwrap()[..40].to_vec();
    for broken in [None, Some(truncated)] {
        match broken {
            None => fs::remove_file(&own).unwrap(),
            Some(bytes) => fs::write(&own, bytes).unwrap(),
        }
        let (picture, report) = front(&obj, &[]);
        assert_eq!(picture.get_pixel(20, 20).0, [179; 3], "grey");
        assert_eq!(report["colour"], "grey: the mesh has no texture and no colours");
        assert_eq!(front(&obj, &texture).0.get_pixel(20, 20).0, [10, 20, 30]);
    }
    let out = folder.path().join("a.png");
    let words = [&[obj.as_str(), "--out", out.to_str().unwrap()], &FRONT[..]].concat();
    let warned = Command::new(env!("CARGO_BIN_EXE_render")).args(words).output().unwrap();
    let warned = String::from_utf8(warned.stderr).unwrap();
    assert!(warned.starts_with("warning: drawn without its texture: "), "{warned}");
    assert!(warned.contains("square.obj: its picture: ") && warned.trim().lines().count() == 1);
}

#[test]
fn colours_of_vertices_are_lit_from_the_camera() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.ply");
    let square = Mesh::parse(SQUARE.as_bytes(), "a.obj").unwrap();
    let painted = square.clone().with_colours(vec![[1.0, 0.4, 0.0]; 4]).unwrap();
    painted.save(&path).unwrap();
    let path = path.to_str().unwrap();
    let (plain, report) = front(path, &[]);
    assert_eq!(plain.get_pixel(20, 40).0, [255, 102, 0]);
    assert_eq!(report["colour"], "colours of vertices");
    // All four corners are seen at the same angle, from 2 away and √2 from the middle.
    let light = 0.3 + 0.7 * 2.0 / 6f64.sqrt();
    let lit = [255.0, 102.0, 0.0].map(|level: f64| (level * light).round() as u8);
    let (shaded, _) = front(path, &["--shade"]);
    assert_eq!(shaded.get_pixel(20, 40).0, lit);
    assert_eq!(shaded.get_pixel(2, 2).0, WHITE);
    // Its back is as bright, whichever way the faces turn.
    let (back, _) = front(path, &["--shade", "--azimuths", "0"]);
    assert_eq!(back.get_pixel(20, 40).0, lit);
}

#[test]
fn what_cannot_be_drawn_in_colour_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let [obj, _] = pictured(folder.path());
    let plain = mesh(folder.path());
    let picture = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let whole = fs::read(folder.path().join("square.png")).unwrap();
    let cut = picture("cut.png", &whole[..40]);
    // A head that claims 60,000 x 60,000 pixels.
    let mut head = whole.clone();
    head[16..24].copy_from_slice(&[0, 0, 234, 96, 0, 0, 234, 96]);
    let crc = 0xffff_ffff
        ^ head[12..29].iter().fold(0xffff_ffffu32, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| {
                (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 }
            })
        });
    head[29..33].copy_from_slice(&crc.to_be_bytes());
    let huge = picture("huge.png", &head);
    let text = picture("text.png", b"no picture");
    let cases: [(&[&str], u8, &str); 11] = [
        (&[&obj, "--colour", "--size", "2048", "--samples", "3"], 2, "is above 4096: take fewer"),
        (&[&plain, "--colour", "--texture", &cut], 1, "has no texture coordinates"),
        (
            &[&obj, "--colour", "--texture", "none.png"],
            1,
            "--texture: cannot read the picture none.png: No such",
        ),
        (&[&obj, "--colour", "--texture", &cut], 1, "cut.png: "),
        (&[&obj, "--colour", "--texture", &text], 1, "text.png: "),
        (&[&obj, "--colour", "--texture", &huge], 1, "huge.png: it has 60000 x 60000 pixels"),
        (&[&obj, "--texture", &cut], 2, "--colour"),
        (&[&obj, "--shade"], 2, "--colour"),
        (&[&obj, "--colour", "--target", "disk:0,0,1"], 2, "cannot be used with"),
        (&[&obj, "--colour", "--reference"], 2, "cannot be used with"),
        (&[&obj, "--colour", "--t-conorm", "einstein"], 2, "cannot be used with"),
    ];
    let out = folder.path().join("out.png");
    for (words, code, message) in cases {
        let failure = run(&[words, &["--out", out.to_str().unwrap()]].concat()).unwrap_err();
        let line = failure.to_string();
        assert!(line.contains(message) && !line.contains('\n'), "{words:?}: {line}");
        assert_eq!(failure.code, code, "{line}");
    }
    assert!(!out.exists());
}

#[test]
fn meshes_without_size_or_behind_the_camera_leave_the_picture_white() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.png");
    for (name, obj) in [
        ("point.obj", "v 1 1 1\nf 1 1 1\n"),
        // A vertex without a face does not blur the depths of the others.
        ("stray.obj", "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 1e30\nf 1 2 3\n"),
        ("behind.obj", "v 0 0 -9\nv 1 0 -9\nv 0 1 -9\nf 1 2 3\n"),
        ("far.obj", "v 0 0 3e38\nv 3e38 0 3e38\nv 0 3e38 3e38\nf 1 2 3\n"),
    ] {
        let path = folder.path().join(name);
        fs::write(&path, obj).unwrap();
        let words = ["--colour", "--shade", "--raw", "--azimuths", "0", "--elevation", "0"];
        let paths =
            [path.to_str().unwrap(), "--json", "--size", "32", "--out", out.to_str().unwrap()];
        let report = json(&[&paths[..], &words].concat());
        let covered = report["mean_alpha"].as_f64().unwrap();
        assert!((0.0..=1.0).contains(&covered), "{name}: {covered}");
        let picture = image::open(&out).unwrap().into_rgb8();
        assert_eq!(picture.get_pixel(31, 31).0, WHITE, "{name}");
    }
}

#[test]
fn it_ends_on_a_machine_of_one_core() {
    let folder = tempfile::tempdir().unwrap();
    let (mesh, out) = (mesh(folder.path()), folder.path().join("sphere.png"));
    let program = Program::new(env!("CARGO_BIN_EXE_render")).on_one_thread();
    for more in [&[][..], &["--reference"], &["--colour"], &["--threads", "2"]] {
        let mut command = program.command();
        let output = ended(command.args([&mesh, "--size", "16", "--out"]).arg(&out).args(more));
        assert!(output.status.success(), "{more:?}: {output:?}");
    }
}
