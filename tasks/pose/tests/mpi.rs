//! Learning over the processes of `mpirun`: any number of them gives the same bits.

#![cfg(all(feature = "mpi", unix))]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{
    fs,
    path::Path,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value;
use softrast_test_kit::mpirun;

const EXACT: &str = "learn --estimator unrolled --size 16 --steps 12 --batch 3 --updates 3 --validation-runs 5 --softness logistic --quiet --json";
const ES: &str = "learn --size 16 --steps 12 --batch 3 --updates 3 --validation-runs 5 --softness gauss --estimator es:0.2 --quiet --json";

/// A mesh of few faces, because test builds may be slow.
const MESH: &str =
    "v 0 0 0\nv 1 0 0\nv 0 0.7 0\nv 0.2 0.1 0.5\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

/// The program alone, or this many processes of it.
fn start(out: &Path, processes: Option<usize>, line: &str) -> Child {
    let pose = env!("CARGO_BIN_EXE_pose");
    let mut command = match processes {
        None => Command::new(pose),
        Some(count) => mpirun(pose, count),
    };
    let mesh = out.join("mesh.obj");
    // If this fails, the program reports it.
    let _ = fs::write(&mesh, MESH);
    command.args(line.split_whitespace()).arg("--mesh").arg(mesh).arg("--out").arg(out);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// The JSON of a successful command, without times, and the learned softness.
fn learned(out: &Path, processes: Option<usize>, line: &str) -> [Value; 2] {
    let output = start(out, processes, line).wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert_eq!(stdout.lines().count(), 1, "one process prints: {stdout}");
    let mut result: Value = serde_json::from_str(&stdout).unwrap();
    let mut softness: Value =
        serde_json::from_slice(&fs::read(out.join("softness.json")).unwrap()).unwrap();
    for key in ["seconds", "peak_memory_mib", "out", "files", "settings"] {
        result.as_object_mut().unwrap().remove(key);
    }
    // It contains the command and the seconds.
    softness.as_object_mut().unwrap().remove("note");
    [result, softness]
}

#[test]
fn any_number_of_processes_learns_the_same_to_the_last_bit() {
    for line in [EXACT, ES] {
        let alone = tempfile::tempdir().unwrap();
        let expected = learned(alone.path(), None, line);
        // Also more processes than instances.
        for processes in [1, 2, 4] {
            let out = tempfile::tempdir().unwrap();
            assert_eq!(learned(out.path(), Some(processes), line), expected, "{processes}: {line}");
        }
    }
}

#[test]
fn a_lost_process_ends_all_and_another_number_goes_on() {
    let long = EXACT.replace("--updates 3", "--updates 12");
    let alone = tempfile::tempdir().unwrap();
    let expected = learned(alone.path(), None, &long);
    let out = tempfile::tempdir().unwrap();
    let mut child = start(out.path(), Some(2), &long);
    let checkpoint = out.path().join("learn.checkpoint.json");
    while !checkpoint.exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        thread::sleep(Duration::from_millis(5));
    }
    let name = out.path().display().to_string();
    // The last of its processes; mpirun is the first.
    let found = Command::new("pgrep").args(["-f", &name]).output().unwrap().stdout;
    let found = String::from_utf8(found).unwrap();
    let lost = found.lines().last().unwrap();
    assert!(Command::new("kill").args(["-9", lost]).status().unwrap().success());
    let clock = Instant::now();
    let output = child.wait_with_output().unwrap();
    assert!(!output.status.success() && clock.elapsed() < Duration::from_secs(20), "{output:?}");
    let line = format!("{long} --resume");
    assert_eq!(learned(out.path(), Some(3), &line), expected);
}

#[test]
fn what_is_wrong_for_all_is_said_once() {
    let out = tempfile::tempdir().unwrap();
    let line = format!("{EXACT} --resolution 8");
    let output = start(out.path(), Some(2), &line).wait_with_output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success());
    assert_eq!(stderr.matches("leave out --resolution").count(), 1, "{stderr}");
}
