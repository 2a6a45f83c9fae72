use std::{fs, sync::OnceLock};

use proptest::prelude::*;
use reconstruct::{Checkpoint, sealed};
use serde_json::{Value, json};

use crate::program::run;

/// The file of the smallest possible training: its header, and the bytes after it.
fn written() -> &'static (Value, Vec<u8>) {
    static WRITTEN: OnceLock<(Value, Vec<u8>)> = OnceLock::new();
    WRITTEN.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().display();
        run(&format!(
            "train --quick --epochs 1 --pairs 1 --steps 1 --shapes 1 --val 1 --quiet --out {out}"
        ))
        .unwrap();
        let Checkpoint { header, records } =
            Checkpoint::load(&folder.path().join("checkpoint.bin")).unwrap();
        (serde_json::to_value(header).unwrap(), records)
    })
}

/// Evaluates a file: succeeds, or fails with one line that names it and the remedy.
fn evaluate(bytes: &[u8]) -> Result<(), TestCaseError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.bin");
    fs::write(&path, bytes).unwrap();
    let ended = run(&format!("evaluate --shapes 1 --views 1 --checkpoint {}", path.display()));
    if let Err(line) = ended {
        let says = line.contains("checkpoint.bin") && line.contains("train");
        prop_assert!(says && line.lines().count() == 1, "{line}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(48))]

    #[test]
    fn a_damaged_file_ends_in_one_line(at in any::<prop::sample::Index>(), byte: u8, cut: bool) {
        let (header, records) = written();
        let mut bytes = sealed(header.to_string().as_bytes(), records);
        let at = at.index(bytes.len());
        if cut { bytes.truncate(at) } else { bytes[at] = byte }
        evaluate(&bytes)?;
    }

    #[test]
    fn records_that_are_cut_end_in_one_line(at in any::<prop::sample::Index>()) {
        let (header, records) = written();
        evaluate(&sealed(header.to_string().as_bytes(), &records[..at.index(records.len())]))?;
    }
}

#[test]
fn a_softness_or_a_t_conorm_that_this_version_does_not_have_ends_in_one_line() {
    let (header, records) = written();
    let others = [
        ("/settings/t_conorm", json!("max")),
        ("/settings/phi", json!([])),
        ("/settings/phi/0", json!(1e300)),
        ("/settings/softness/family", json!("soft")),
    ];
    for (place, other) in others {
        let mut header = header.clone();
        *header.pointer_mut(place).unwrap() = other;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.bin");
        fs::write(&path, sealed(header.to_string().as_bytes(), records)).unwrap();
        let line = format!("{:#}", Checkpoint::load(&path).unwrap_err());
        assert!(line.contains("train anew") && line.lines().count() == 1, "{line}");
    }
}
