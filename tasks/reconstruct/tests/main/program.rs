use std::{
    fs,
    path::{Path, PathBuf},
};

use reconstruct::{Checkpoint, execute};
use serde_json::Value;
use softrast_test_kit::Program;

/// Runs the program, and returns its output or its error line.
pub(crate) fn run(line: &str) -> Result<String, String> {
    let words =
        ["reconstruct"].into_iter().chain(line.split_whitespace()).map(Into::into).collect();
    let mut printed = Vec::new();
    match execute(words, &mut printed) {
        Ok(()) => Ok(String::from_utf8(printed).unwrap()),
        Err(failure) => Err(failure.to_string()),
    }
}

/// The smallest possible training.
fn train(out: &Path, more: &str) -> Result<String, String> {
    run(&format!(
        "train --quick --pairs 2 --steps 2 --shapes 4 --val 1 --quiet --out {} {more}",
        out.display()
    ))
}

fn checkpoint(out: &Path) -> PathBuf {
    out.join("checkpoint.bin")
}

/// The history without times.
fn history(out: &Path) -> Value {
    let mut header =
        serde_json::to_value(Checkpoint::load(&checkpoint(out)).unwrap().header).unwrap();
    for epoch in header["epochs"].as_array_mut().unwrap() {
        epoch.as_object_mut().unwrap().remove("time");
    }
    header
}

#[test]
fn a_training_that_was_stopped_goes_on_as_if_it_had_not() {
    let root = tempfile::tempdir().unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| root.path().join(name));
    let printed = train(&whole, "--epochs 3").unwrap();
    assert!(printed.contains("voxel IoU") && printed.contains("airplane"), "{printed}");
    // A folder in the place of a picture stops the second epoch at its very end.
    let obstacle = parts.join("epoch_002.png");
    fs::create_dir_all(obstacle.join("x")).unwrap();
    assert!(train(&parts, "--epochs 3").unwrap_err().contains("epoch_002.png"));
    assert_eq!(history(&parts)["epochs"].as_array().unwrap().len(), 2);
    fs::remove_dir_all(obstacle).unwrap();
    train(&parts, "--epochs 3 --resume").unwrap();
    assert_eq!(history(&parts)["epochs"], history(&whole)["epochs"]);
    for file in ["report.html", "history.json", "epoch_003.png"] {
        assert!(parts.join(file).is_file(), "{file}");
    }
    let page = fs::read_to_string(whole.join("report.html")).unwrap();
    assert!(page.contains("data:image/png") && page.contains("<svg"));
}

#[test]
fn the_softness_learns_beside_the_network_unless_it_is_told_not_to() {
    let root = tempfile::tempdir().unwrap();
    for (name, more, moves) in [
        ("logistic", "--softness logistic", true),
        ("mlp", "--softness mlp --t-conorm einstein", true),
        ("fixed", "--softness gauss --softness-rate 0", false),
    ] {
        let out = root.path().join(name);
        train(&out, &format!("--epochs 1 {more}")).unwrap();
        let header = Checkpoint::load(&checkpoint(&out)).unwrap().header;
        let moved = |&(a, b): &(&f64, &f64)| (a - b).abs() > 1e-5;
        let phi = header.epochs[0].phi.iter().zip(&header.epochs[1].phi);
        let moved = phi.clone().filter(moved).count();
        assert_eq!(moved > phi.len() / 2, moves, "{name}: {moved} of {}", phi.len());
    }
}

#[test]
fn nothing_is_overwritten_and_every_refusal_says_why() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    train(&out, "--epochs 1").unwrap();
    let path = checkpoint(&out);
    let before = fs::read(&path).unwrap();
    let refuse = |found: Result<String, String>, parts: &[&str]| {
        let message = found.unwrap_err();
        assert!(!message.contains('\n'), "{message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
        assert_eq!(fs::read(&path).unwrap().len(), before.len());
    };
    refuse(train(&out, "--epochs 1"), &["is there already", "--resume", "--out"]);
    refuse(
        train(&out, "--epochs 2 --resume --width paper"),
        &["belongs to another training", "width is \"quarter\" there, \"paper\" here"],
    );
    refuse(train(&out, "--epochs 2 --resume --seed 9"), &["seed is 0 there, 9 here"]);
    refuse(train(&out, "--softness soft"), &["unknown softness", "logistic"]);
    refuse(
        train(&out, "--backend opencl"),
        &["no backend", "expected ndarray, flex, wgpu or cuda"],
    );
    refuse(train(&out, "--t-conorm soft"), &["unknown T-conorm"]);
    refuse(train(&out, "--data /no/such/folder"), &["--data", "--shapes"]);
    let evaluate = || run(&format!("evaluate --checkpoint {} --shapes 1", path.display()));
    assert!(evaluate().unwrap().contains("mean"));

    let mut damaged = before.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    fs::write(&path, &damaged).unwrap();
    refuse(evaluate(), &["checkpoint.bin is damaged or cut off"]);
    refuse(train(&out, "--epochs 2 --resume"), &["damaged or cut off"]);
    fs::write(&path, &before[..middle]).unwrap();
    assert!(evaluate().unwrap_err().contains("damaged or cut off"));
    fs::write(&path, b"something else").unwrap();
    assert!(evaluate().unwrap_err().contains("is not a checkpoint of reconstruct"));
    fs::write(&path, b"softrast reconstruct 0\n").unwrap();
    assert!(evaluate().unwrap_err().contains("another version"));
    assert!(run("evaluate --checkpoint no.bin").unwrap_err().contains("no.bin"));
}

#[test]
fn a_picture_becomes_a_mesh() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    train(&out, "--epochs 1").unwrap();
    let [picture, mesh] = ["car.png", "car.obj"].map(|name| root.path().join(name));
    let predict = || {
        let [picture, mesh, checkpoint] =
            [&picture, &mesh, &checkpoint(&out)].map(|path| path.display().to_string());
        run(&format!("predict {picture} --out {mesh} --checkpoint {checkpoint}"))
    };
    assert!(predict().unwrap_err().contains("cannot read"));
    fs::write(&picture, b"no picture").unwrap();
    assert!(predict().unwrap_err().contains("is no PNG picture"));
    image::RgbaImage::new(64, 64).save(&picture).unwrap();
    assert!(predict().unwrap_err().contains("shows nothing"));
    image::RgbaImage::new(64, 32).save(&picture).unwrap();
    assert!(predict().unwrap_err().contains("64 x 32 pixels, expected a square"));
    assert!(!mesh.exists());
    let disc = |x: u32, y: u32| {
        let inside = (x as f64 - 49.5).hypot(y as f64 - 49.5) < 30.0;
        image::Rgba([200, 90, 40, if inside { 255 } else { 0 }])
    };
    image::RgbaImage::from_fn(100, 100, disc).save(&picture).unwrap();
    assert!(predict().unwrap().contains("642 vertices, 1280 faces"));
    assert_eq!(softrast_mesh::Mesh::load(&mesh).unwrap().faces().len(), 1280);
}

#[test]
fn methods_are_compared_in_one_table() {
    let root = tempfile::tempdir().unwrap();
    let line = format!(
        "compare --quick --pairs 2 --steps 1 --epochs 1 --shapes 4 --val 1 --test-shapes 1 --quiet \
         --methods logistic,gauss+yager:2 --out {}",
        root.path().display()
    );
    let table = run(&line).unwrap();
    for part in ["| sphere, not deformed |", "| logistic |", "| gauss+yager:2 |", "Table 4"] {
        assert!(table.contains(part), "{table}");
    }
    assert!(run(&line).unwrap_err().contains("is there already"));
    // Finished work is not repeated: the times are the same.
    assert_eq!(run(&format!("{line} --resume")).unwrap(), table);
}

#[test]
fn it_ends_on_a_machine_of_one_core() {
    let program = Program::new(env!("CARGO_BIN_EXE_reconstruct")).on_one_thread();
    let out = tempfile::tempdir().unwrap();
    let line = "train --quick --pairs 2 --steps 2 --shapes 4 --val 1 --epochs 1";
    program.run_in(out.path(), line).unwrap();
}
