//! The tables of the documents match their stored records.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::Path;

use compare::recomputed;

#[test]
fn every_table_of_the_documents_is_that_of_its_records() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for document in ["docs/findings.md", "docs/results.md", "docs/studies/learning.md"] {
        let [old, new] = recomputed(&root.join(document)).unwrap();
        assert!(
            old == new,
            "{document}: run cargo run --release -p compare -- --recompute {document}"
        );
    }
}
