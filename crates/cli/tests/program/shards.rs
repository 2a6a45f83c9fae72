//! Processes that share a job: any split, order and interruption gives the results of one process.

use std::{fs, path::Path, thread};

use crate::disc::Disc;
use crate::line::{json, run_in, solved, timeless};
use proptest::prelude::*;
use serde_json::Value;

const EVALUATE: &str =
    "evaluate --runs 7 --size 8 --steps 2 --baseline 'logistic_--learning-rate_0.02'";
const SEARCH: &str = "search --runs 6 --search-runs 5 --size 16 --steps 4 --schedule static --scales 0.1,0.2 \
                      --learning-rates 0.02,0.5 --loops 40";

/// Runs a shard, and returns the reported number of finished runs.
fn shard(out: &Path, line: &str, shard: &str) -> u64 {
    let (stdout, ended) = run_in::<Disc>(out, &format!("{line} --shard {shard}"));
    ended.unwrap();
    json(&stdout)["finished"].as_u64().unwrap()
}

fn merged(out: &Path, line: &str) -> Value {
    let (stdout, ended) = run_in::<Disc>(out, &format!("{line} --resume"));
    ended.unwrap();
    timeless(json(&stdout))
}

fn lines(path: &Path) -> usize {
    fs::read_to_string(path).map_or(0, |text| text.lines().count())
}

fn assert_same_files(one: &Path, other: &Path, names: &[&str]) {
    for name in names {
        assert!(fs::read(one.join(name)).unwrap() == fs::read(other.join(name)).unwrap(), "{name}");
    }
}

#[test]
fn shards_part_the_runs_and_together_make_the_results() {
    let (whole, expected) = solved::<Disc>(EVALUATE);
    let out = tempfile::tempdir().unwrap();
    let finished: Vec<u64> =
        (1..=3).map(|k| shard(out.path(), EVALUATE, &format!("{k}/3"))).collect();
    // 14 runs; those of the second method are numbered after those of the first.
    assert_eq!(finished, [5, 5, 4]);
    assert!(!out.path().join("result.json").exists(), "a shard has no results");
    assert_eq!(merged(out.path(), EVALUATE), timeless(expected));
    let files =
        ["curve.csv", "against_curve.csv", "convergence.csv", "before_after.png", "animation.gif"];
    assert_same_files(whole.path(), out.path(), &files);
    assert_eq!(lines(&out.path().join("evaluate.jsonl")), 0, "nothing was made again");
}

#[test]
fn a_search_in_stages_is_the_same_in_shards_that_run_at_once() {
    let (whole, expected) = solved::<Disc>(SEARCH);
    let out = tempfile::tempdir().unwrap();
    thread::scope(|scope| {
        for k in 1..=3 {
            let folder = out.path();
            scope.spawn(move || shard(folder, SEARCH, &format!("{k}/3")));
        }
    });
    assert_eq!(merged(out.path(), SEARCH), timeless(expected));
    assert_same_files(whole.path(), out.path(), &["curve.csv", "convergence.csv"]);
    assert_eq!(lines(&out.path().join("search.jsonl")), 0, "nothing was made again");
}

#[test]
fn one_shard_alone_finishes_the_stages_of_a_search_and_its_part_of_the_rest() {
    let (whole, expected) = solved::<Disc>(SEARCH);
    let out = tempfile::tempdir().unwrap();
    assert_eq!(shard(out.path(), SEARCH, "2/3"), 2);
    assert_eq!(merged(out.path(), SEARCH), timeless(expected));
    let made = lines(&out.path().join("search.2-of-3.jsonl"));
    let all = lines(&whole.path().join("search.jsonl"));
    assert_eq!((made, lines(&out.path().join("search.jsonl"))), (all - 4, 4));
}

#[test]
fn a_choice_is_made_of_the_runs_of_shards() {
    let line = "choose --size 8 --steps 2 --search-runs 3";
    let (_, expected) = solved::<Disc>(line);
    let out = tempfile::tempdir().unwrap();
    for k in 1..=2 {
        shard(out.path(), line, &format!("{k}/2"));
    }
    assert_eq!(merged(out.path(), line)["flags"], expected["flags"]);
    assert_eq!(lines(&out.path().join("choose.jsonl")), 0, "nothing was made again");
}

#[test]
fn what_shards_cannot_share_is_refused() {
    let out = tempfile::tempdir().unwrap();
    for (line, said) in [
        ("choose --budget 3 --shard 1/2", "leave out --budget"),
        ("evaluate --softness auto --shard 1/2", "run choose first"),
        ("evaluate --shard 3/2", "expected I/N"),
        ("solve --shard 1/2", "evaluate, search, choose"),
    ] {
        let failure = run_in::<Disc>(out.path(), line).1.unwrap_err();
        assert!(failure.code == 2 && failure.message.contains(said), "{line}: {}", failure.message);
    }
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(24))]

    /// Shards of any number, in any order, some never run, some twice, and each killed anywhere.
    #[test]
    fn any_split_order_and_interruption_gives_the_same_results(
        calls in prop::collection::vec((1..6_usize, any::<prop::sample::Index>(), 0..100_usize), 0..6)
    ) {
        static WHOLE: std::sync::LazyLock<Value> =
            std::sync::LazyLock::new(|| timeless(solved::<Disc>(EVALUATE).1));
        let out = tempfile::tempdir().unwrap();
        for (of, index, part) in calls {
            let before: Vec<_> = fs::read_dir(out.path()).unwrap().map(|file| file.unwrap().path()).collect();
            shard(out.path(), EVALUATE, &format!("{}/{of}", index.index(of) + 1));
            // A killed process leaves the beginning of its file.
            for file in fs::read_dir(out.path()).unwrap().map(|file| file.unwrap().path()) {
                if !before.contains(&file) && part < 60 {
                    let bytes = fs::read(&file).unwrap();
                    fs::write(&file, &bytes[..bytes.len() * part / 60]).unwrap();
                }
            }
        }
        prop_assert_eq!(&merged(out.path(), EVALUATE), &*WHOLE);
    }
}

/// Eight processes at once, two of them killed, one of them twice.
#[cfg(unix)]
#[test]
fn killed_and_doubled_processes_change_nothing() {
    use std::process::{Child, Command, Stdio};
    let line = "evaluate --size 32 --steps 60 --runs 64 --quiet --json --out";
    let start = |out: &Path, more: &[&str]| -> Child {
        let mut command = Command::new(crate::resume::program());
        command.args(line.split(' ')).arg(out).args(more).stdout(Stdio::piped()).spawn().unwrap()
    };
    let result = |child: Child| {
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{output:?}");
        timeless(json(&String::from_utf8(output.stdout).unwrap()))
    };
    let [whole, out] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let expected = result(start(whole.path(), &[]));
    let shards = ["1/8", "2/8", "3/8", "4/8", "5/8", "6/8", "7/8", "8/8", "8/8"];
    let mut children = shards.map(|shard| start(out.path(), &["--shard", shard])).into_iter();
    for (k, mut child) in (1..).zip(children.by_ref().take(2)) {
        // As soon as it has a file, unless it has finished before.
        let file = out.path().join(format!("evaluate.{k}-of-8.jsonl"));
        while !file.exists() && child.try_wait().unwrap().is_none() {
            thread::yield_now();
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }
    children.for_each(|child| drop(result(child)));
    assert_eq!(result(start(out.path(), &["--resume"])), expected);
    assert_same_files(
        whole.path(),
        out.path(),
        &["curve.csv", "convergence.csv", "before_after.png"],
    );
}
