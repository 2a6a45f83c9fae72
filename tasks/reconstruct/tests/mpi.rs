//! Training over the processes of `mpirun`: any number of them gives the same bits.

#![cfg(all(feature = "mpi", unix))]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::Path, process::Command};

use serde_json::Value;
use softrast_test_kit::mpirun;

const LINE: &str =
    "train --shapes 3 --pairs 4 --parts 4 --steps 2 --val 1 --softness gauss --quiet --json";

/// Results of the program alone, or of this many processes: the history, and the checkpoint, both without times.
fn trained(out: &Path, processes: Option<usize>, more: &str) -> [Value; 2] {
    let program = env!("CARGO_BIN_EXE_reconstruct");
    let mut command = match processes {
        None => Command::new(program),
        Some(count) => mpirun(program, count),
    };
    command.args(LINE.split_whitespace()).args(more.split_whitespace()).arg("--out").arg(out);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let stdout = String::from_utf8(output.stdout).unwrap();
    assert_eq!(stdout.lines().count(), 1, "one process prints: {stdout}");
    let mut result: Value = serde_json::from_str(&stdout).unwrap();
    result.as_object_mut().unwrap().remove("report");
    let mut history: Value =
        serde_json::from_slice(&fs::read(out.join("history.json")).unwrap()).unwrap();
    for epoch in history["epochs"].as_array_mut().unwrap() {
        epoch.as_object_mut().unwrap().remove("time");
    }
    [result, history]
}

#[test]
fn any_number_of_processes_trains_the_same_to_the_last_bit() {
    let alone = tempfile::tempdir().unwrap();
    let expected = trained(alone.path(), None, "--epochs 3");
    for processes in [1, 2, 4] {
        let out = tempfile::tempdir().unwrap();
        assert_eq!(trained(out.path(), Some(processes), "--epochs 3"), expected, "{processes}");
    }
    // The first epochs by two processes, the rest by three; rates fall in the second epoch of two as of three.
    let out = tempfile::tempdir().unwrap();
    trained(out.path(), Some(2), "--epochs 2");
    assert_eq!(trained(out.path(), Some(3), "--epochs 3 --resume"), expected);
}

#[test]
fn more_processes_than_parts_are_refused() {
    let out = tempfile::tempdir().unwrap();
    let output = mpirun(env!("CARGO_BIN_EXE_reconstruct"), 3)
        .args(["train", "--parts", "2", "--quiet", "--out"])
        .arg(out.path())
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && stderr.contains("give --parts 3"), "{stderr}");
}
