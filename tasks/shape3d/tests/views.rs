//! Meshes from pictures: results and error messages.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path};

use serde_json::{Value, json};
use softrast_mesh::Mesh;
use softrast_test_kit::Program;

/// Runs `shape3d solve` with results in `out`: its JSON, or its error line.
fn run(out: &Path, words: &[&str]) -> Result<Value, String> {
    let program = Program::new(env!("CARGO_BIN_EXE_shape3d"));
    let found = program.run_words(out, &[&["solve"], words].concat());
    found.map_err(|failure| failure.message.trim_end().to_owned())
}

fn fox() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/views/fox").to_str().unwrap().to_owned()
}

#[test]
fn views_that_were_kept_aside_are_met() {
    let out = tempfile::tempdir().unwrap();
    let found = run(out.path(), &["--views", &fox(), "--hold-out", "2", "--steps", "60"]).unwrap();
    let iou = |name: &str| found[name].as_f64().unwrap();
    assert!(iou("train_iou") > 0.95 && iou("held_out_iou") > 0.93, "{found}");
    assert_eq!(
        found["views"].as_array().unwrap().iter().filter(|v| v["held_out"] == true).count(),
        2
    );
    let mesh = Mesh::load(found["mesh"].as_str().unwrap()).unwrap();
    assert_eq!(mesh.faces().len() as u64, found["faces"].as_u64().unwrap());
    for file in ["result.json", "report.html", "views.png", "mesh.obj", "mesh.ply", "mesh.glb"] {
        assert!(out.path().join(file).exists(), "{file}");
    }
}

/// The fox through a distorting lens, with opaque pictures and separate masks.
fn lens(name: &str) -> String {
    format!("{}_lens/{name}", fox())
}

#[test]
fn pictures_of_a_lens_that_distorts_make_a_mesh_and_so_does_a_model_of_colmap() {
    let out = tempfile::tempdir().unwrap();
    let with = |views: &str, more: &[&str]| {
        let words = ["--views", views, "--hold-out", "2", "--steps", "60"];
        run(out.path(), &[&words, more].concat())
    };
    let found = with(&lens(""), &["--colour"]).unwrap();
    let iou = |found: &Value, name: &str| found[name].as_f64().unwrap();
    assert!(iou(&found, "train_iou") > 0.95 && iou(&found, "held_out_iou") > 0.93, "{found}");
    assert!(found["warnings"].to_string().contains("the lens distorts the pictures"), "{found}");
    // The fox of these pictures has one colour, without any of the wall.
    let mesh = Mesh::load(found["mesh"].as_str().unwrap()).unwrap();
    let colours = mesh.colours().unwrap();
    for (channel, of_fox) in [0.85, 0.45, 0.15].into_iter().enumerate() {
        let mean = colours.iter().map(|colour| colour[channel]).sum::<f64>() / colours.len() as f64;
        assert!((mean - of_fox).abs() < 0.02, "channel {channel}: {mean}");
    }
    let model = with(&lens("sparse/0"), &[]).unwrap();
    for name in ["train_iou", "held_out_iou"] {
        assert!((iou(&found, name) - iou(&model, name)).abs() < 0.01, "{name}: {model}");
    }
    // A picture that is no mask is refused, and a missing file is named.
    let error = with(&lens(""), &["--masks", &lens("images")]).unwrap_err();
    assert!(error.contains("looks like a photograph") && error.contains("--masks"), "{error}");
    let error = with(&lens(""), &["--masks", out.path().to_str().unwrap()]).unwrap_err();
    assert!(error.contains("frame 0 (images/00.png): no mask in"), "{error}");
    let error = with(out.path().to_str().unwrap(), &[]).unwrap_err();
    assert!(error.contains("there are no cameras") && error.contains("COLMAP"), "{error}");
}

#[test]
fn a_sphere_becomes_the_fox_without_a_hull() {
    let out = tempfile::tempdir().unwrap();
    let words = ["--views", &fox(), "--start", "sphere", "--steps", "80"];
    let found = run(out.path(), &words).unwrap();
    assert!(found["train_iou"].as_f64().unwrap() > 0.85, "{found}");
    assert!(found["held_out_iou"].is_null());
}

/// Changes the cameras of the fox in a copy of its folder, then runs.
fn with(change: impl Fn(&mut Value), more: &[&str]) -> Result<Value, String> {
    with_results(change, more, |_| ())
}

/// Runs the case and passes the folder of results, if there are any, to `look`.
fn with_results(
    change: impl Fn(&mut Value),
    more: &[&str],
    look: impl FnOnce(&Path),
) -> Result<Value, String> {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("images")).unwrap();
    for k in 0..12 {
        let name = format!("images/{k:02}.png");
        fs::copy(Path::new(&fox()).join(&name), folder.path().join(&name)).unwrap();
    }
    let text = fs::read(Path::new(&fox()).join("transforms.json")).unwrap();
    let mut cameras: Value = serde_json::from_slice(&text).unwrap();
    change(&mut cameras);
    fs::write(folder.path().join("transforms.json"), cameras.to_string()).unwrap();
    let out = folder.path().join("out");
    let words = [&["--views", folder.path().to_str().unwrap(), "--steps", "1"], more].concat();
    let found = run(&out, &words);
    assert!(found.is_ok() || !out.join("report.html").exists(), "{found:?}");
    if found.is_ok() {
        look(&out);
    }
    found
}

/// Cameras on a map in metres, on a map in millimetres, and of a scene a thousandth of the size.
#[test]
fn the_unit_and_the_origin_of_the_cameras_do_not_matter() {
    let more = ["--hold-out", "2"];
    let plain = with(|_| (), &more).unwrap();
    let number = |found: &Value, name: &str| found[name].as_f64().unwrap();
    for (scale, offset) in [
        (1.0, [5e5, 4.5e6, 0.0]),
        (1e3, [1e6, -4e6, 2e5]),
        (1e-3, [0.0; 3]),
        (1e-3, [40.0, -7.0, 0.0]),
    ] {
        let placed = |cameras: &mut Value| {
            for frame in cameras["frames"].as_array_mut().unwrap() {
                for (row, offset) in offset.iter().enumerate() {
                    let x = &mut frame["transform_matrix"][row][3];
                    *x = json!(offset + scale * x.as_f64().unwrap());
                }
            }
        };
        let mut boxes = Vec::new();
        let found = with_results(placed, &more, |out| {
            for name in ["mesh.obj", "mesh.ply", "mesh.glb"] {
                boxes.push(Mesh::load(out.join(name)).unwrap().bounds());
            }
        });
        let found = found.unwrap();
        for name in ["train_iou", "held_out_iou"] {
            let off = (number(&found, name) - number(&plain, name)).abs();
            assert!(off < 0.005, "scale {scale}, offset {offset:?}: {found}");
        }
        assert!(found["warnings"].as_array().unwrap().is_empty(), "{found}");
        // The fox extends from about -1 to 1, at the point that the cameras look at.
        for [low, high] in &boxes {
            let relative = |x: f64, k: usize| (x - offset[k]) / scale;
            for k in 0..3 {
                let extent = relative(high[k], k) - relative(low[k], k);
                assert!((0.3..2.6).contains(&extent), "scale {scale}: {low:?} {high:?}");
                assert!(
                    relative(low[k], k) > -1.4 && relative(high[k], k) < 1.4,
                    "{low:?} {high:?}"
                );
                // All files have the same digits.
                let apart = (low[k] - boxes[0][0][k]).abs().max((high[k] - boxes[0][1][k]).abs());
                assert!(apart < 1e-5 * scale, "scale {scale}: {boxes:?}");
            }
        }
        assert_eq!(found["glb_origin"][1] == 0.0, offset[1] == 0.0, "{found}");
    }
}

#[test]
fn cameras_come_in_many_ways() {
    // Intrinsics per frame, paths without an extension, or an angle alone.
    let each = |cameras: &mut Value| {
        let of_all = cameras.clone();
        for frame in cameras["frames"].as_array_mut().unwrap() {
            for key in ["fl_x", "fl_y", "cx", "cy", "w", "h"] {
                frame[key] = of_all[key].clone();
            }
            let path = frame["file_path"].as_str().unwrap().trim_end_matches(".png").to_owned();
            frame["file_path"] = json!(format!("./{path}"));
        }
        *cameras = json!({ "frames": cameras["frames"] });
    };
    assert!(with(each, &[]).unwrap()["train_iou"].as_f64().unwrap() > 0.9);
    let angle = |focal: f64| {
        move |cameras: &mut Value| {
            let angle = 2.0 * (60.0 / focal).atan();
            let [cx, cy] = ["cx", "cy"].map(|key| cameras[key].clone());
            let frames = cameras["frames"].clone();
            *cameras = json!({ "camera_angle_x": angle, "cx": cx, "cy": cy, "frames": frames });
        }
    };
    assert!(with(angle(130.0), &[]).unwrap()["train_iou"].as_f64().unwrap() > 0.9);
    // An invalid angle next to a length.
    let error = with(angle(-1.0), &[]).unwrap_err();
    assert!(error.contains("camera_angle_x") && error.contains("radians"), "{error}");
    // A mask named next to the picture has priority.
    let masks = |cameras: &mut Value| {
        for frame in cameras["frames"].as_array_mut().unwrap() {
            frame["mask_path"] = frame["file_path"].clone();
            frame["file_path"] = json!("images/no.png");
        }
    };
    assert!(with(masks, &[]).unwrap()["train_iou"].as_f64().unwrap() > 0.9);
}

/// The format of Blender's NeRF data: training views and test views.
#[test]
fn views_of_another_file_of_cameras_are_held_out() {
    let train = |cameras: &mut Value| cameras["frames"].as_array_mut().unwrap().truncate(9);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("transforms_test.json");
    let text = fs::read(Path::new(&fox()).join("transforms.json")).unwrap();
    let mut cameras: Value = serde_json::from_slice(&text).unwrap();
    let mut frames = cameras["frames"].as_array().unwrap()[9..].to_vec();
    for frame in &mut frames {
        frame["file_path"] = json!(Path::new(&fox()).join(frame["file_path"].as_str().unwrap()));
    }
    cameras["frames"] = json!(frames);
    fs::write(&file, cameras.to_string()).unwrap();
    let found = with(train, &["--hold-out", file.to_str().unwrap()]).unwrap();
    let views = found["views"].as_array().unwrap();
    let held_out: Vec<bool> = views.iter().map(|view| view["held_out"] == true).collect();
    assert_eq!(held_out, [[false; 9].as_slice(), &[true; 3]].concat(), "{found}");
    assert!(found["held_out_iou"].as_f64().unwrap() > 0.8, "{found}");
}

/// Rotations of three decimals, Windows file names, and names with a dot and no extension.
#[test]
fn cameras_as_tools_write_them_are_taken_and_what_was_rounded_is_said() {
    let change = |cameras: &mut Value| {
        for (k, frame) in cameras["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
            for at in 0..9 {
                let number = &mut frame["transform_matrix"][at / 3][at % 3];
                *number = json!((1e3 * number.as_f64().unwrap()).round() / 1e3);
            }
            frame["file_path"] = json!(format!(".\\images\\{k:02}"));
        }
    };
    let found = with(change, &["--hold-out", "2"]).unwrap();
    assert!(found["train_iou"].as_f64().unwrap() > 0.9, "{found}");
    let said = found["warnings"].as_array().unwrap();
    let rounded = |line: &&Value| line.as_str().unwrap().contains("rounded");
    assert_eq!(said.iter().filter(rounded).count(), 1, "{said:?}");
    // Deviations of a hundredth or more are refused.
    let scaled = |cameras: &mut Value| {
        for at in 0..9 {
            let number = &mut cameras["frames"][5]["transform_matrix"][at / 3][at % 3];
            *number = json!(1.01 * number.as_f64().unwrap());
        }
    };
    let error = with(scaled, &[]).unwrap_err();
    assert!(error.contains("frame 5") && error.contains("a rotation times 1.01000"), "{error}");
    let mirrored = |cameras: &mut Value| {
        for row in 0..3 {
            let number = &mut cameras["frames"][5]["transform_matrix"][row][0];
            *number = json!(-number.as_f64().unwrap());
        }
    };
    let error = with(mirrored, &[]).unwrap_err();
    assert!(error.contains("frame 5") && error.contains("mirrors"), "{error}");
}

#[test]
fn bad_views_are_one_line_that_names_file_and_frame() {
    let frame = |of: fn(&mut Value)| move |cameras: &mut Value| of(&mut cameras["frames"][3]);
    type Change = Box<dyn Fn(&mut Value)>;
    let checks: [(Change, &[&str]); 13] = [
        (Box::new(frame(|f| f["file_path"] = json!("images/no.png"))), &["frame 3", "no.png"]),
        (Box::new(frame(|f| f["transform_matrix"] = json!([[1.0]]))), &["frame 3", "4 x 4"]),
        (
            Box::new(frame(|f| f["transform_matrix"][0][0] = json!(9.0))),
            &["frame 3", "no rotation"],
        ),
        (Box::new(frame(|f| f["camera_model"] = json!("FOV"))), &["frame 3", "FOV", "undistort"]),
        (Box::new(frame(|f| f["w"] = json!(7))), &["frame 3", "7 x 90", "120 x 90"]),
        (Box::new(|c: &mut Value| c["frames"] = json!([])), &["no frame"]),
        (
            Box::new(|c: &mut Value| c["frames"] = json!({})),
            &["transforms.json", "frames is no list"],
        ),
        (Box::new(frame(|f| f["fl_x"] = json!("a"))), &["frame 3", "fl_x is \"a\", not a number"]),
        (Box::new(|c: &mut Value| c["fl_x"] = json!(-1.0)), &["frame 0", "positive"]),
        (
            // World to camera instead of camera to world.
            Box::new(|c: &mut Value| {
                for f in c["frames"].as_array_mut().unwrap() {
                    for row in 0..3 {
                        f["transform_matrix"][row][3] = json!(5.0 * f64::from(u8::from(row == 2)));
                    }
                }
            }),
            &["the camera has the object behind it", "transform_matrix"],
        ),
        (Box::new(frame(|f| f["transform_matrix"][3][0] = json!(2.0))), &["frame 3", "transposed"]),
        (
            Box::new(frame(|f| {
                (0..3).for_each(|row| f["transform_matrix"][row][3] = json!(0.01));
            })),
            &["images/03.png", "inside the object"],
        ),
        (
            Box::new(|c: &mut Value| {
                c["frames"].as_array_mut().unwrap().truncate(1);
            }),
            &["one view"],
        ),
    ];
    for (k, (change, parts)) in checks.iter().enumerate() {
        let error = with(change, &[]).expect_err(&k.to_string());
        assert_eq!(error.lines().count(), 1, "{k}: {error}");
        assert!(parts.iter().all(|part| error.contains(part)), "{k}: {error}");
    }
    let error = with(|_| (), &["--hold-out", "11"]).unwrap_err();
    assert!(error.contains("--hold-out 11 leaves fewer than two of 12 views"), "{error}");
    let error = with(|_| (), &["--hold-out", "18446744073709551615"]).unwrap_err();
    assert!(error.contains("leaves fewer than two"), "{error}");
    let error = with(|_| (), &["--hold-out", "no.json"]).unwrap_err();
    assert!(error.contains("no.json"), "{error}");
    let out = tempfile::tempdir().unwrap();
    let error = run(out.path(), &["--invert"]).unwrap_err();
    assert!(error.contains("--views"), "{error}");
    let error = with(|_| (), &["--elevation", "3"]).unwrap_err();
    assert!(error.contains("--views"), "{error}");
}

#[test]
fn a_template_is_deformed_and_pictures_may_cut_the_object_off() {
    let folder = tempfile::tempdir().unwrap();
    let template = folder.path().join("template.ply");
    softrast_mesh::icosphere(2).save(&template).unwrap();
    let words = ["--views", &fox(), "--template", template.to_str().unwrap(), "--steps", "30"];
    let found = run(&folder.path().join("out"), &words).unwrap();
    assert!(found["train_iou"].as_f64().unwrap() > 0.7, "{found}");
    // Column 60 of one picture and everything left of it is missing, including the object's left half.
    let cut = folder.path().join("cut.png");
    let whole = image::open(Path::new(&fox()).join("images/03.png")).unwrap();
    whole.crop_imm(60, 0, 60, 90).save(&cut).unwrap();
    let with_cut = |cameras: &mut Value| {
        let frame = &mut cameras["frames"][3];
        frame["file_path"] = json!(cut);
        frame["cx"] = json!(62.5 - 60.0);
        frame["w"] = json!(60);
    };
    let found = with(with_cut, &["--hold-out", "2"]).unwrap();
    assert!(found["held_out_iou"].as_f64().unwrap() > 0.9, "{found}");
}

#[test]
fn two_views_are_enough_for_a_mesh_that_has_both_masks() {
    let two = |cameras: &mut Value| cameras["frames"].as_array_mut().unwrap().truncate(2);
    assert!(with(two, &[]).unwrap()["train_iou"].as_f64().unwrap() > 0.9);
}

#[test]
fn it_ends_on_a_machine_of_one_core() {
    let program = Program::new(env!("CARGO_BIN_EXE_shape3d")).on_one_thread();
    let out = tempfile::tempdir().unwrap();
    let line = format!("--views {} --colour --steps 2", fox());
    program.run_in(out.path(), &line).unwrap();
}
