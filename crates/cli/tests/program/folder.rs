//! Tests of the files in the folder for the results.

use std::fs;

use softrast_cli::execute;

use crate::{
    disc::Disc,
    line::{files, run_in, solved},
};

const COMMANDS: [&str; 6] = [
    "--size 8 --steps 2",
    "evaluate --size 8 --steps 2 --runs 2",
    "evaluate --size 8 --steps 2 --runs 2 --baseline gauss",
    "search --size 8 --steps 2 --runs 2 --search-runs 1 --loops 4 --schedule static --scale 0.05 --learning-rates 0.01,0.1",
    "choose --size 8 --steps 2 --search-runs 1 --resolution full --tolerance 1e-3",
    "learn --updates 1 --steps 2 --batch 1 --validation-runs 1 --size 8 --estimator es",
];

#[test]
fn a_second_run_replaces_the_results_of_the_first_and_leaves_the_rest() {
    for line in COMMANDS {
        let (out, _) = solved::<Disc>(line);
        let names = |out: &tempfile::TempDir| files(out.path()).into_keys().collect::<Vec<_>>();
        let before = names(&out);
        fs::write(out.path().join("notes.txt"), "mine").unwrap();
        run_in::<Disc>(out.path(), line).1.unwrap();
        fs::remove_file(out.path().join("notes.txt")).unwrap();
        assert_eq!(names(&out), before, "{line}");
    }
}

#[test]
fn what_a_run_of_this_kind_does_not_make_does_not_stay() {
    let (out, _) = solved::<Disc>("evaluate --size 8 --steps 2 --runs 2 --baseline gauss");
    assert!(out.path().join("against_curve.csv").exists());
    run_in::<Disc>(out.path(), "evaluate --size 8 --steps 2 --runs 2").1.unwrap();
    assert!(!out.path().join("against_curve.csv").exists());
}

#[test]
fn a_file_that_the_user_has_put_in_the_place_of_a_result_stops_the_run_before_its_work() {
    for line in COMMANDS {
        let (out, _) = solved::<Disc>(line);
        for (name, bytes) in files(out.path()) {
            let path = out.path().join(&name);
            fs::write(&path, "mine").unwrap();
            let before = files(out.path());
            let (_, ended) = run_in::<Disc>(out.path(), line);
            let failure = ended.expect_err(&format!("{line} replaces {name}"));
            assert!(failure.message.contains(&name) && failure.code == 1, "{line}: {failure}");
            assert_eq!(failure.to_string().lines().count(), 1, "{failure}");
            assert!(files(out.path()) == before, "{line} touches files beside {name}");
            fs::write(&path, bytes).unwrap();
        }
        // Without the list, as in folders of earlier versions.
        fs::remove_file(out.path().join(".softrast.json")).unwrap();
        let before = files(out.path());
        run_in::<Disc>(out.path(), line).1.unwrap_err();
        assert!(files(out.path()) == before, "{line}");
    }
}

#[test]
fn a_folder_in_the_place_of_a_result_leaves_the_earlier_ones_whole() {
    for line in COMMANDS {
        let (out, _) = solved::<Disc>(line);
        let path = out.path().join("report.html");
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        let before = files(out.path());
        let failure = run_in::<Disc>(out.path(), line).1.unwrap_err();
        assert!(failure.message.contains("report.html is a folder"), "{failure}");
        assert!(files(out.path()) == before, "{line}");
    }
}

#[test]
fn commands_have_folders_of_their_own_unless_one_is_named() {
    let help = |command: &str| {
        let words = ["disc", command, "--help"].map(Into::into).to_vec();
        let mut stdout = Vec::new();
        execute::<Disc>(words, &mut stdout).unwrap();
        String::from_utf8(stdout).unwrap()
    };
    assert!(help("evaluate").contains("out/TASK-COMMAND"));
    let (out, _) = solved::<Disc>(COMMANDS[1]);
    let before = files(out.path());
    for line in [COMMANDS[0], COMMANDS[3], COMMANDS[4], COMMANDS[5]] {
        let failure = run_in::<Disc>(out.path(), line).1.unwrap_err();
        assert!(failure.message.contains("is a result of `disc evaluate`"), "{line}: {failure}");
        assert!(files(out.path()) == before, "{line}");
    }
}

#[cfg(unix)]
#[test]
fn a_killed_run_locks_nobody_out_of_its_folder() {
    use std::{process::Command, thread::sleep, time::Duration};
    let out = tempfile::tempdir().unwrap();
    fs::write(out.path().join("notes.txt"), "mine").unwrap();
    for line in [
        "evaluate --size 8 --runs 100000 --quiet --out",
        "learn --updates 100000 --steps 2 --batch 1 --validation-runs 1 --size 8 --estimator es --quiet --out",
    ] {
        let name = line.split(' ').next().unwrap();
        let mut child = Command::new(crate::resume::program())
            .args(line.split(' '))
            .arg(out.path())
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        let records = out.path().join(format!("{name}.jsonl"));
        while fs::metadata(&records).map_or(0, |found| found.len()) < 2000 {
            sleep(Duration::from_millis(5));
            assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
    run_in::<Disc>(out.path(), COMMANDS[1]).1.unwrap();
    fs::remove_file(out.path().join("report.html")).unwrap();
    run_in::<Disc>(out.path(), COMMANDS[5]).1.unwrap();
    assert_eq!(fs::read(out.path().join("notes.txt")).unwrap(), b"mine");
}
