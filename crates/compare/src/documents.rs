//! Documents whose tables are generated from stored records.
//!
//! A table lies between two comments: `<!-- table NAME -->`, or `<!-- table NAME of FILE -->` with the records' file relative to the
//! document, and `<!-- end of table -->`.

use std::{fs, path::Path};

use anyhow::{Context, ensure};

use crate::{Record, records, tables};

const BEGIN: &str = "<!-- table ";
const CLOSE: &str = " -->";
const END: &str = "<!-- end of table -->";

/// A table between its comments; empty if there is nothing to show.
///
/// # Errors
///
/// If there is no table of this name.
pub(crate) fn block(records: &[Record], name: &str) -> anyhow::Result<String> {
    block_of(records, name, name)
}

fn block_of(records: &[Record], name: &str, head: &str) -> anyhow::Result<String> {
    let table = tables::named(records, name)?;
    let table = table.map_or_else(|| "\n".to_owned(), |table| table.markdown());
    Ok(format!("{BEGIN}{head}{CLOSE}\n{table}{END}\n"))
}

/// The text of a document, and the text with its tables rebuilt from the records that they name, by default `cells.jsonl` in the folder
/// named after the document.
///
/// # Errors
///
/// If the document or records cannot be read, or a table has no end.
pub fn recomputed(document: &Path) -> anyhow::Result<[String; 2]> {
    let text = fs::read_to_string(document).with_context(|| format!("cannot read {document:?}"))?;
    let (mut rest, mut new) = (text.as_str(), String::new());
    while let Some((before, from)) = rest.split_once(BEGIN) {
        let (head, after) = from.split_once(CLOSE).context("a table has no name")?;
        let (_, after) =
            after.split_once(END).with_context(|| format!("the table {head} has no end"))?;
        let (name, path) = match head.split_once(" of ") {
            Some((name, file)) => (name, document.parent().unwrap_or(Path::new("")).join(file)),
            None => (head, document.with_extension("").join("cells.jsonl")),
        };
        let kept = fs::read_to_string(&path).with_context(|| format!("cannot read {path:?}"))?;
        let records = records::read(&kept).with_context(|| format!("{}", path.display()))?;
        ensure!(!records.is_empty(), "{} holds no records", path.display());
        new += before;
        new += block_of(&records, name, head)?.trim_end_matches('\n');
        rest = after;
    }
    new += rest;
    Ok([text, new])
}

#[cfg(test)]
mod tests {
    use super::*;

    const RECORD: &str = r#"{"task": "pose", "original": true, "method": "preset", "family": "", "setting": "scale 0.1", "chosen": true,
        "compared": true, "varied": false, "learned_on": null, "size": 64, "steps": 300, "faces": 2, "titles": ["hard IoU loss", "angle"],
        "seconds": 0.5, "in_papers_unit": [1.5, null], "successes": 1, "last": [0.1, 0.3], "returned": [0.1, 0.2], "parameter": [1, 2]}"#;

    fn document(text: &str) -> anyhow::Result<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.md");
        fs::write(&path, text).unwrap();
        fs::create_dir(folder.path().join("results")).unwrap();
        let records = RECORD.replace('\n', " ") + "\n";
        fs::write(folder.path().join("results/cells.jsonl"), records).unwrap();
        Ok(recomputed(&path)?[1].clone())
    }

    #[test]
    fn a_table_is_made_again_and_what_is_around_it_stays() {
        let of = |name: &str| {
            format!("before\n<!-- table {name} -->\n| old |\n<!-- end of table -->\nafter\n")
        };
        for (name, row) in [
            ("errors pose original", "| preset | scale 0.1 | 0.150 ("),
            ("summary of results/cells.jsonl", "| POSE | 2 | 0.150, 0.150 |  |  |"),
            ("seconds", "| POSE | original | preset | 0.500 | 1.67 |"),
        ] {
            let new = document(&of(name)).unwrap();
            assert!(new.contains(row) && !new.contains("old"), "{new}");
            assert!(new.starts_with("before\n") && new.ends_with("-->\nafter\n"), "{new}");
            assert_eq!(document(&new).unwrap(), new);
        }
        assert_eq!(document("no table\n").unwrap(), "no table\n");
    }

    #[test]
    fn a_change_stands_next_to_the_method_whose_whole_name_it_follows() {
        let line = RECORD.replace('\n', " ");
        let of = |method: &str, error: &str, varied: bool| {
            let line = line.replace("\"preset\"", &format!("\"{method}\""));
            let line = line.replace("[0.1, 0.2]", &format!("[{error}, {error}]"));
            line.replace("\"varied\": false", &format!("\"varied\": {varied}"))
        };
        let lines = [
            of("learned", "0.1", false),
            of("learned-mlp", "0.2", false),
            of("learned-mlp resolution 32", "0.4", true),
            of("exp backend flex", "0.5", true),
        ];
        let records = records::read(&lines.join("\n")).unwrap();
        let table = tables::named(&records, "variations").unwrap().unwrap().markdown();
        assert!(
            table.contains("| POSE | learned-mlp | resolution 32 | 0.200 | 0.400 |"),
            "{table}"
        );
        assert!(table.contains("| POSE | exp backend flex |  |  | 0.500 |"), "{table}");
        assert!(tables::named(&records[..2], "variations").unwrap().is_none());
    }

    #[test]
    fn a_table_that_cannot_be_made_is_said() {
        for (text, part) in [
            ("<!-- table tasks -->\n", "the table tasks has no end"),
            ("<!-- table teapot -->\n<!-- end of table -->\n", "there is no table \"teapot\""),
            ("<!-- table tasks of none.jsonl -->\n<!-- end of table -->\n", "cannot read"),
        ] {
            let error = format!("{:#}", document(text).unwrap_err());
            assert!(error.contains(part), "{error}");
        }
    }
}
