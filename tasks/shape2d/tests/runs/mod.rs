//! Runs of the program.

use std::path::Path;

use serde_json::Value;
use softrast_test_kit::{Failure, Program};
pub(crate) use softrast_test_kit::{assert_finite, warnings};

pub(crate) const PROGRAM: Program = Program::new(env!("CARGO_BIN_EXE_shape2d"));

/// Runs a command line with results in `out`, and returns its JSON line.
pub(crate) fn run_in(out: &Path, line: &str) -> Result<Value, Failure> {
    PROGRAM.run_in(out, line)
}

/// The JSON line of a run whose files are not needed.
pub(crate) fn run(line: &str) -> Result<Value, Failure> {
    run_in(tempfile::tempdir().unwrap().path(), line)
}
