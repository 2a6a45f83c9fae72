//! A mesh file is an ordinary file, although it is first written under another name.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, os::unix::fs::PermissionsExt, path::Path};

use softrast_mesh::icosphere;

fn mode(path: &Path) -> u32 {
    fs::metadata(path).unwrap().permissions().mode()
}

#[test]
fn whoever_can_read_other_files_can_read_a_written_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, mesh] = ["plain.obj", "mesh.obj"].map(|name| folder.path().join(name));
    fs::write(&plain, "").unwrap();
    icosphere(0).save(&mesh).unwrap();
    assert_eq!(mode(&mesh), mode(&plain));
}
