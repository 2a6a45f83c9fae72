use std::{collections::BTreeMap, fs, path::Path};

use super::*;
use crate::{
    Error, Inputs,
    manifest::{MANIFEST, Manifest, What, content_of},
};

fn names(path: &Path) -> Vec<String> {
    let entries = fs::read_dir(path).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The content of every file except the list, by name.
fn files(path: &Path) -> BTreeMap<String, String> {
    let names = names(path).into_iter().filter(|name| name != MANIFEST);
    names.map(|name| (name.clone(), fs::read_to_string(path.join(&name)).unwrap())).collect()
}

fn open(path: &Path, command: &str) -> OutputFolder {
    OutputFolder::open(path, command, &Inputs::default()).unwrap()
}

/// Runs a command that writes files of these names and contents.
fn run(path: &Path, command: &str, files: &[(&str, &str)]) -> Result<(), Error> {
    let mut folder = open(path, command);
    files.iter().try_for_each(|(name, text)| folder.stage(name, text.as_bytes()))?;
    folder.commit()
}

fn refusal(found: Result<(), Error>, part: &str) {
    let message = found.unwrap_err().to_string();
    assert!(message.contains(part) && message.lines().count() == 1, "{message}");
}

#[test]
fn results_appear_together_and_replace_those_of_an_earlier_run() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("a/b");
    let mut folder = open(&out, "pose solve");
    folder.stage("a.gif", b"gif").unwrap();
    folder.stage("r.json", b"old").unwrap();
    assert!(!out.join("r.json").exists());
    folder.commit().unwrap();
    assert_eq!(names(&out), [MANIFEST, "a.gif", "r.json"]);

    fs::write(out.join("notes.txt"), "mine").unwrap();
    run(&out, "pose solve", &[("r.json", "new")]).unwrap();
    assert_eq!(names(&out), [MANIFEST, "notes.txt", "r.json"]);
    assert_eq!(fs::read(out.join("r.json")).unwrap(), b"new");
}

#[test]
fn nothing_that_no_earlier_run_has_listed_is_replaced_or_removed() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path();
    fs::write(out.join("r.json"), "mine").unwrap();
    fs::write(out.join("a.gif"), "mine").unwrap();
    let before = files(out);
    refusal(run(out, "pose solve", &[("b.csv", "b"), ("r.json", "r")]), "r.json is not a recorded");
    refusal(open(out, "pose solve").claim(["b.csv", "a.gif"]), "a.gif is not a recorded");
    assert_eq!((files(out), names(out).len()), (before, 2));
}

#[test]
fn a_result_that_the_user_has_changed_is_the_users() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path();
    run(out, "pose solve", &[("r.json", "r"), ("a.gif", "a")]).unwrap();
    fs::write(out.join("r.json"), "mine").unwrap();
    let before = files(out);
    refusal(run(out, "pose solve", &[("r.json", "new")]), "r.json was changed");
    assert_eq!(files(out), before);
    // It is not removed either.
    run(out, "pose solve", &[("b.csv", "b")]).unwrap();
    assert_eq!(names(out), [MANIFEST, "b.csv", "r.json"]);
    refusal(run(out, "pose solve", &[("r.json", "new")]), "r.json is not a recorded");
}

#[test]
fn commands_that_share_a_folder_leave_each_others_results() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path();
    run(out, "shape3d solve", &[("mesh.obj", "m"), ("r.json", "r")]).unwrap();
    refusal(run(out, "pose solve", &[("r.json", "p")]), "is a result of `shape3d solve`");
    run(out, "pose solve", &[("overlay.png", "p")]).unwrap();
    run(out, "shape3d solve", &[("r.json", "new")]).unwrap();
    assert_eq!(names(out), [MANIFEST, "overlay.png", "r.json"]);
}

#[test]
fn an_input_is_never_replaced_or_removed_even_if_it_is_a_result() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path();
    run(out, "learn", &[("softness.json", "s"), ("r.json", "r")]).unwrap();
    let mut inputs = Inputs::default();
    inputs.add(&out.join("softness.json"));
    let mut folder = OutputFolder::open(out, "learn", &inputs).unwrap();
    refusal(folder.claim(["softness.json"]), "is an input of this run");
    folder.stage("b.csv", b"b").unwrap();
    folder.commit().unwrap();
    assert_eq!(names(out), [MANIFEST, "b.csv", "softness.json"]);
    // It is still a result.
    run(out, "learn", &[("b.csv", "b")]).unwrap();
    assert_eq!(names(out), [MANIFEST, "b.csv"]);
}

#[test]
fn an_error_amid_renaming_leaves_the_earlier_results_whole() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path();
    run(out, "pose solve", &[("a", "1"), ("b", "1"), ("old", "1")]).unwrap();
    let before = files(out);
    let mut folder = open(out, "pose solve");
    for name in ["a", "b", "c", "d"] {
        folder.stage(name, b"2").unwrap();
    }
    // As if another process had created it between the check and the renaming.
    let staged = std::mem::take(&mut folder.staged);
    fs::create_dir(out.join("d")).unwrap();
    assert!(folder.replace(staged, &["old".to_owned()]).is_err());
    fs::remove_dir(out.join("d")).unwrap();
    assert_eq!((files(out), names(out).len()), (before, 4), "nothing hidden is left");
    // A folder that existed before is reported by its name.
    fs::create_dir(out.join("e")).unwrap();
    refusal(run(out, "pose solve", &[("a", "2"), ("e", "2")]), "e is a folder");
}

#[test]
fn a_run_that_was_killed_at_any_moment_locks_nobody_out() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path();
    run(out, "pose solve", &[("a", "old"), ("b", "old")]).unwrap();
    let [old, new] = ["old", "new"].map(|text| content_of(text.as_bytes()));
    let mut list = Manifest::of(out).unwrap();
    for name in ["a", "b", "c"] {
        list.insert(name, "pose solve", What::Result(vec![old.clone(), new.clone()]));
    }
    // The list exists, and some of the files have their names.
    fs::write(out.join(MANIFEST), list.text()).unwrap();
    fs::write(out.join("a"), "new").unwrap();
    run(out, "pose solve", &[("a", "last"), ("c", "last")]).unwrap();
    assert_eq!(names(out), [MANIFEST, "a", "c"]);
}

#[test]
fn what_a_later_call_goes_on_from_stays_and_is_known_again() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path();
    let mut folder = open(out, "learn");
    folder.keep("point.json", b"1").unwrap();
    let journal = folder.journal("steps.jsonl", "{\"step", false).unwrap();
    fs::write(&journal, "{\"step\":0}\n").unwrap();
    folder.keep("point.json", b"2").unwrap();
    drop(folder);
    run(out, "learn", &[("r.json", "r")]).unwrap();
    assert_eq!(names(out), [MANIFEST, "point.json", "r.json", "steps.jsonl"]);
    let mut folder = open(out, "learn");
    folder.claim(["point.json"]).unwrap();
    folder.journal("steps.jsonl", "{\"step", false).unwrap();
    fs::write(out.join("point.json"), "mine").unwrap();
    refusal(folder.keep("point.json", b"3"), "was changed");
    // A file that begins differently is not replaced, and renamed if the command resumes.
    fs::write(&journal, "mine").unwrap();
    let fresh = folder.journal("steps.jsonl", "{\"step", false);
    refusal(fresh.map(drop), "was changed");
    folder.journal("steps.jsonl", "{\"step", true).unwrap();
    assert_eq!(fs::read(out.join("steps.jsonl.damaged")).unwrap(), b"mine");
    assert!(!journal.exists());
}

#[test]
fn a_journal_without_a_list_is_gone_on_from_but_not_replaced() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path();
    fs::write(out.join("steps.jsonl"), "{\"step\":0}\n").unwrap();
    let fresh = open(out, "learn").journal("steps.jsonl", "{\"step", false);
    refusal(fresh.map(drop), "is not a recorded result");
    open(out, "learn").journal("steps.jsonl", "{\"step", true).unwrap();
    fs::write(out.join("mine.jsonl"), "mine").unwrap();
    let mine = open(out, "learn").journal("mine.jsonl", "{\"step", true);
    assert!(mine.is_err() && out.join("mine.jsonl").exists());
}

#[test]
fn a_run_that_comes_to_nothing_leaves_nothing() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    let mut folder = open(&out, "learn");
    folder.journal("steps.jsonl", "{", false).unwrap();
    folder.stage("r.json", b"r").unwrap();
    drop(folder);
    assert!(!out.exists());
}

#[test]
fn a_list_that_is_none_is_refused_and_names_that_lead_elsewhere_mean_nothing() {
    let root = tempfile::tempdir().unwrap();
    let (out, outside) = (root.path().join("out"), root.path().join("r.json"));
    run(&out, "pose solve", &[("r.json", "r")]).unwrap();
    fs::write(&outside, "r").unwrap();
    let list = fs::read_to_string(out.join(MANIFEST)).unwrap();
    fs::write(out.join(MANIFEST), list.replace("\"r.json", "\"../r.json")).unwrap();
    run(&out, "pose solve", &[("b", "b")]).unwrap();
    assert!(outside.exists());
    fs::write(out.join(MANIFEST), "{}").unwrap();
    let refused = OutputFolder::open(&out, "pose solve", &Inputs::default());
    refusal(refused.map(drop), "is not a list of results");
}

#[cfg(unix)]
#[test]
fn a_link_in_the_place_of_a_result_is_the_users() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    run(&out, "pose solve", &[("r.json", "r")]).unwrap();
    fs::rename(out.join("r.json"), root.path().join("r.json")).unwrap();
    std::os::unix::fs::symlink(root.path().join("r.json"), out.join("r.json")).unwrap();
    refusal(run(&out, "pose solve", &[("r.json", "new")]), "not a regular file");
    assert_eq!(fs::read(root.path().join("r.json")).unwrap(), b"r");
}

#[test]
fn a_file_that_is_named_replaces_one_of_its_kind_but_no_input() {
    let root = tempfile::tempdir().unwrap();
    let path = |name: &str| root.path().join(name);
    let is_png = |path: &Path| fs::read(path).unwrap().starts_with(b"png");
    let write = |name: &str, inputs: &Inputs| {
        OutputFile::open(&path(name), "PNG picture", is_png, inputs)?.write(b"png")
    };
    let none = Inputs::default();
    for (name, text) in [("a.png", "png of before"), ("b.obj", "v 0 0 0"), ("c.png", "png")] {
        fs::write(path(name), text).unwrap();
    }
    fs::write(path("empty.png"), "").unwrap();
    for name in ["a.png", "empty.png", "new/er/d.png"] {
        write(name, &none).unwrap();
        assert_eq!(fs::read(path(name)).unwrap(), b"png", "{name}");
    }
    refusal(write("b.obj", &none), "b.obj exists and is not a PNG picture");
    refusal(write("new", &none), "is a folder");
    let mut inputs = none;
    inputs.add(&path("c.png"));
    refusal(write("./new/../c.png", &inputs), "is an input of this run");
    assert!(OutputFile::open(&path("x/y.png"), "", is_png, &inputs).is_ok());
    assert!(!path("x").exists());
}

#[test]
fn a_folder_that_cannot_be_written_is_refused_and_leaves_nothing() {
    let root = tempfile::tempdir().unwrap();
    fs::write(root.path().join("file"), "").unwrap();
    let open =
        |name: &str| OutputFolder::open(&root.path().join(name), "pose solve", &Inputs::default());
    assert!(open("file/out").is_err() && open("file").is_err());
    fs::create_dir_all(root.path().join("out/r.json")).unwrap();
    let mut folder = open("out").unwrap();
    assert!(folder.stage("r.json", b"").unwrap_err().to_string().contains("is a folder"));
    drop(folder);
    assert_eq!(names(root.path()), ["file", "out"]);
}

#[cfg(unix)]
#[test]
fn files_are_whole_and_as_readable_as_any_new_file() {
    use std::os::unix::fs::PermissionsExt;
    let root = tempfile::tempdir().unwrap();
    let path = root.path().join("r.json");
    write_atomically(&path, b"old").unwrap();
    write_atomically(&path, b"{}").unwrap();
    assert_eq!((fs::read(&path).unwrap(), names(root.path()).len()), (b"{}".to_vec(), 1));
    fs::write(root.path().join("plain"), "").unwrap();
    let mode = |name| root.path().join(name).metadata().unwrap().permissions().mode();
    assert_eq!(mode("r.json"), mode("plain"));
}
