//! A job that ends in the middle keeps what it has finished, and goes on from it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod line;
#[path = "../examples/parabola.rs"]
mod parabola;

use std::{cell::Cell, fs, path::Path};

use anyhow::bail;
use line::{file, json, run_in, solved, timeless};
use parabola::Parabola;
use serde_json::Value;
use softrast_runner::{Batch, Description, Error, Progress, Run, Score, Settings, Task};

/// A parabola that ends the program before a batch.
struct Fragile(Parabola);

#[derive(Clone, Copy)]
enum End {
    /// As Ctrl-C does.
    Stop,
    Failure,
}

thread_local! {
    /// How many batches are solved before which end; every test has its own thread.
    static FUSE: Cell<(usize, End)> = const { Cell::new((usize::MAX, End::Stop)) };
}

impl Task for Fragile {
    const NAME: &'static str = "parabola";
    const ABOUT: &'static str = "Moves a disc until something happens";
    type Args = parabola::Args;

    fn prepare(settings: &Settings, args: &Self::Args) -> anyhow::Result<Self> {
        Parabola::prepare(settings, args).map(Self)
    }

    fn describe(&self) -> Description {
        self.0.describe()
    }

    fn batch_size(&self) -> usize {
        self.0.batch_size()
    }

    fn score(&self) -> Score {
        Score::Extra("square")
    }

    fn run(&self, batch: &Batch, progress: &mut Progress) -> anyhow::Result<Vec<Run>> {
        match FUSE.get() {
            (0, End::Stop) => return Err(Error::Interrupted.into()),
            (0, End::Failure) => bail!("the disc is full"),
            (left, end) => FUSE.set((left - 1, end)),
        }
        self.0.run(batch, progress)
    }
}

/// Runs the line, which ends after some batches; its standard output and its exit code.
fn ended_after(batches: usize, end: End, out: &Path, line: &str) -> (String, u8, String) {
    FUSE.set((batches, end));
    let (stdout, ended) = run_in::<Fragile>(out, line);
    FUSE.set((usize::MAX, End::Stop));
    let failure = ended.unwrap_err();
    (stdout, failure.code, failure.message)
}

/// Runs the line to its end, in which it may solve so many batches and no more.
fn resumed(batches: usize, out: &Path, line: &str) -> Value {
    FUSE.set((batches, End::Failure));
    let (stdout, ended) = run_in::<Fragile>(out, &format!("{line} --resume"));
    ended.unwrap();
    assert_eq!(FUSE.get().0, 0, "all batches that were not finished are solved");
    json(&stdout)
}

fn assert_same_files(one: &Path, other: &Path, names: &[&str]) {
    for name in names {
        assert!(fs::read(one.join(name)).unwrap() == fs::read(other.join(name)).unwrap(), "{name}");
    }
}

const EVALUATE: &str = "evaluate --runs 18 --size 16 --steps 9";

#[test]
fn a_stopped_evaluation_shows_what_is_finished_and_resumes_to_the_same_results() {
    let (whole, expected) = solved::<Fragile>(EVALUATE);
    let out = tempfile::tempdir().unwrap();
    let (stdout, code, message) = ended_after(2, End::Stop, out.path(), EVALUATE);
    assert_eq!(code, 130);
    assert!(message.contains("8 of 18 runs are finished") && message.ends_with("--resume"));
    let part = json(&stdout);
    assert_eq!(part, file(out.path(), "result.json"));
    assert_eq!((&part["partial"]["finished"], &part["partial"]["asked"]), (&8.into(), &18.into()));
    assert_eq!(part["runs"], 8);
    let page = fs::read_to_string(out.path().join("report.html")).unwrap();
    assert!(page.contains("Stopped: 8 of 18 runs"));

    let again = resumed(3, out.path(), EVALUATE);
    assert!(again.get("partial").is_none());
    assert_eq!(timeless(again), timeless(expected));
    let files = ["curve.csv", "convergence.csv", "before_after.png", "animation.gif"];
    assert_same_files(whole.path(), out.path(), &files);
    resumed(0, out.path(), EVALUATE);
}

#[test]
fn a_failed_comparison_keeps_pairs_and_resumes_to_the_same_results() {
    let line = format!("{EVALUATE} --against 'logistic_--learning-rate_0.02'");
    let (whole, expected) = solved::<Fragile>(&line);
    let out = tempfile::tempdir().unwrap();
    let (_, code, message) = ended_after(5, End::Failure, out.path(), &line);
    assert_eq!(code, 1);
    assert!(message.contains("--resume") && message.contains("the disc is full"), "{message}");
    assert!(!out.path().join("result.json").exists());

    let (stdout, code, _) = ended_after(2, End::Stop, out.path(), &format!("{line} --resume"));
    assert_eq!(code, 130);
    let part = json(&stdout);
    assert_eq!((&part["runs"], &part["against"]["runs"]), (&16.into(), &12.into()));
    assert_eq!(timeless(resumed(3, out.path(), &line)), timeless(expected));
    assert_same_files(whole.path(), out.path(), &["against_curve.csv", "convergence.csv"]);
}

#[test]
fn a_search_that_is_stopped_in_every_part_resumes_to_the_same_results() {
    let line = "search --runs 10 --search-runs 5 --size 16 --steps 9 --schedule static \
                --scales 0.1,0.2 --learning-rates 0.02,0.1,0.5";
    let (_whole, expected) = solved::<Fragile>(line);
    let cells = expected["search"]["cells"].as_array().unwrap().len();
    let batches = 2 * cells + 3;
    let out = tempfile::tempdir().unwrap();
    let mut done = 0;
    // In the middle of a cell, in the fine grid, before and in the held-out seeds.
    for stop in [5, 2 * 6 + 3, 2 * cells, 2 * cells + 1] {
        let line = format!("{line} --resume");
        let (stdout, code, message) = ended_after(stop - done, End::Stop, out.path(), &line);
        assert_eq!(code, 130, "{message}");
        let part = json(&stdout);
        let found = file(out.path(), "search.json");
        assert_eq!(part["search"], found);
        let finished = found["cells"].as_array().unwrap().len();
        assert_eq!(finished, cells.min(stop / 2));
        assert!(part["partial"].is_object(), "{part}");
        assert_eq!(part.get("image_error").is_some(), stop > 2 * cells);
        done = stop;
    }
    assert_eq!(timeless(resumed(batches - done, out.path(), line)), timeless(expected));
}

#[test]
fn a_line_that_was_cut_by_a_kill_is_solved_again() {
    let (_whole, expected) = solved::<Fragile>(EVALUATE);
    let out = tempfile::tempdir().unwrap();
    ended_after(3, End::Failure, out.path(), EVALUATE);
    let journal = out.path().join("evaluate.jsonl");
    let text = fs::read(&journal).unwrap();
    fs::write(&journal, &text[..text.len() - 100]).unwrap();
    assert_eq!(timeless(resumed(3, out.path(), EVALUATE)), timeless(expected));
}

#[test]
fn the_journal_of_another_job_is_refused_and_stays() {
    let out = tempfile::tempdir().unwrap();
    ended_after(3, End::Failure, out.path(), EVALUATE);
    let journal = fs::read(out.path().join("evaluate.jsonl")).unwrap();
    for (more, part) in [
        ("--radius 0.3", "method.settings.radius is 0.4 there, 0.3 here"),
        ("--runs 20", "runs is 18 there, 20 here"),
        ("--seed 1", "seed is 0 there, 1 here"),
        ("--against logistic", "against is only here"),
    ] {
        let line =
            EVALUATE.replace("--runs 18", if more.contains("runs") { "" } else { "--runs 18" });
        let (_, ended) = run_in::<Fragile>(out.path(), &format!("{line} {more} --resume"));
        let failure = ended.unwrap_err();
        assert!(failure.code == 1 && failure.message.contains(part), "{failure}");
    }
    assert_eq!(fs::read(out.path().join("evaluate.jsonl")).unwrap(), journal);
}

#[test]
fn a_stop_before_anything_is_finished_leaves_nothing() {
    for line in [EVALUATE, "solve --size 16", "evaluate --runs 1", "search --steps 2"] {
        let root = tempfile::tempdir().unwrap();
        let (stdout, code, message) = ended_after(0, End::Stop, &root.path().join("out"), line);
        assert_eq!((stdout.as_str(), code), ("", 130), "{line}");
        assert!(message.contains("before anything was finished"), "{message}");
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
    }
}

/// The example as a program, or `None` where cargo was not asked to build it.
#[cfg(unix)]
fn program() -> Option<std::path::PathBuf> {
    let mut path = std::env::current_exe().unwrap();
    path.pop();
    path.pop();
    Some(path.join("examples/parabola")).filter(|path| path.exists())
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_program_after_its_step_with_what_is_finished() {
    use std::{process::Command, thread::sleep, time::Duration};
    let Some(program) = program() else {
        eprintln!("skipped: the example is not built");
        return;
    };
    let out = tempfile::tempdir().unwrap();
    let line = "evaluate --runs 100000 --json --quiet --out";
    let mut child = Command::new(program)
        .args(line.split(' '))
        .arg(out.path())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    while !out.path().join("evaluate.jsonl").exists() {
        sleep(Duration::from_millis(20));
        assert!(child.try_wait().unwrap().is_none(), "it ended by itself");
    }
    let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let part = json(&String::from_utf8(output.stdout).unwrap());
    assert!(part["partial"]["finished"].as_u64().unwrap() >= 4);
}
