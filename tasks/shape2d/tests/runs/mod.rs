//! Runs of the program.

use std::{path::Path, process::Command};

use serde_json::Value;
use softrast_lab::Failure;

/// Runs a command line with results in `out`; its JSON line.
pub(crate) fn run_in(out: &Path, line: &str) -> Result<Value, Failure> {
    let output = Command::new(env!("CARGO_BIN_EXE_shape2d"))
        .args(line.split_whitespace())
        .args(["--quiet", "--json", "--out"])
        .arg(out)
        .output()
        .unwrap();
    match output.status.code() {
        Some(0) => Ok(serde_json::from_slice(&output.stdout).unwrap()),
        code => Err(Failure {
            code: code.unwrap().try_into().unwrap(),
            message: String::from_utf8(output.stderr).unwrap(),
        }),
    }
}

/// The same, of which only the JSON line is kept.
pub(crate) fn run(line: &str) -> Result<Value, Failure> {
    run_in(tempfile::tempdir().unwrap().path(), line)
}

/// Its warnings.
pub(crate) fn warnings(json: &Value) -> String {
    json["warnings"].to_string()
}

/// Asserts that no error is NaN or infinite.
pub(crate) fn assert_finite(json: &Value) {
    for error in ["image_error", "parameter_error"] {
        for key in ["initial", "final", "best"] {
            assert!(json[error][key].as_f64().is_some_and(f64::is_finite), "{error} {key}: {json}");
        }
    }
}
