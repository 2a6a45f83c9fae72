//! Resumed learning, also from damaged files.

use std::{fs, path::Path, sync::LazyLock};

use proptest::{prelude::*, sample::Index};
use serde_json::{Value, json};
use softrast_inverse::Checkpoint;
use softrast_lab::Failure;

use crate::{
    disc::Disc,
    line::{file, json as of_text, run_in, solved, timeless},
};

const LEARN: &str =
    "learn --updates 3 --steps 3 --batch 2 --validation-runs 1 --size 8 --estimator es";

/// The checkpoint, the steps and the result of a run.
static WHOLE: LazyLock<(String, String, Value)> = LazyLock::new(|| {
    let (out, json) = solved::<Disc>(LEARN);
    let text = |name: &str| fs::read_to_string(out.path().join(name)).unwrap();
    (text("learn.checkpoint.json"), text("learn.jsonl"), timeless(json))
});

fn resumed(checkpoint: &[u8], steps: &[u8]) -> Result<Value, Failure> {
    let out = tempfile::tempdir().unwrap();
    let file = |name: &str| out.path().join(name);
    fs::write(file("learn.checkpoint.json"), checkpoint).unwrap();
    fs::write(file("learn.jsonl"), steps).unwrap();
    let (stdout, ended) = run_in::<Disc>(out.path(), &format!("{LEARN} --resume"));
    ended.map(|()| timeless(of_text(&stdout)))
}

fn assert_one_line(failure: &Failure, file: &str) {
    assert_eq!(failure.code, 1, "{failure}");
    assert_eq!(failure.to_string().lines().count(), 1, "{failure}");
    assert!(failure.message.contains(file), "{failure}");
}

/// Bytes changed, removed, inserted, doubled, and the end cut off.
fn damaged(text: &str, changes: &[(Index, u8, u8)]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for (at, byte, kind) in changes {
        if bytes.is_empty() {
            break;
        }
        let k = at.index(bytes.len());
        match kind {
            0 => bytes[k] = *byte,
            1 => bytes.truncate(k),
            2 => drop(bytes.remove(k)),
            3 => bytes.insert(k, *byte),
            _ => bytes.extend_from_within(k..),
        }
    }
    bytes
}

fn changes() -> impl Strategy<Value = Vec<(Index, u8, u8)>> {
    prop::collection::vec((any::<Index>(), any::<u8>(), 0..5_u8), 1..5)
}

/// All places in a value that can be replaced.
fn places(value: &Value, at: &str, all: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            map.iter().for_each(|(key, value)| places(value, &format!("{at}/{key}"), all));
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(k, value)| places(value, &format!("{at}/{k}"), all));
        }
        _ => {}
    }
    all.push(at.to_owned());
}

#[test]
fn a_finished_run_is_gone_on_from_without_a_step() {
    let (checkpoint, steps, expected) = &*WHOLE;
    let again = resumed(checkpoint.as_bytes(), steps.as_bytes()).unwrap();
    assert_eq!(again["best"], expected["best"]);
    assert!(Path::new(expected["files"][0].as_str().unwrap()).ends_with("softness.json"));
}

#[test]
fn settings_of_learning_reach_the_result() {
    let more = "--schedule decay --scale 0.3 --scale-end 0.05 --knots 2 --floor 0.5";
    let (out, json) = solved::<Disc>(&format!("{LEARN} {more} --outer-steps quarters"));
    let config = &json["config"];
    assert_eq!([&config["outer_steps"], &config["floor_px"]], [&json!("quarters"), &json!(0.5)]);
    let schedule = &file(out.path(), "softness.json")["schedule"];
    assert_eq!(schedule["floor_px"], 0.5);
    assert_eq!(schedule["knots"].as_array().unwrap().len(), 2);
    // The start is validated after fewer steps too, where the ball is farther away.
    let (_, last) = solved::<Disc>(&format!("{LEARN} {more}"));
    let start = |json: &Value| json["start_validation_loss"].as_f64().unwrap();
    assert!(start(&json) != start(&last), "{json}");
}

#[test]
fn a_learned_width_is_a_parameter_more() {
    let line = "learn --updates 1 --steps 1 --batch 1 --validation-runs 1 --size 8 --softness mlp";
    let parameters = ["ndc", "relative"].map(|input| {
        solved::<Disc>(&format!("{line} --schedule static --input {input}")).1["parameters"].clone()
    });
    assert_eq!(parameters, [json!(56), json!(57)]);
}

#[test]
fn learning_ends_when_patience_is_exhausted() {
    // Steps this large lead away from any useful softness.
    let line = LEARN.replace("--updates 3", "--updates 9 --outer-rate 3");
    let steps = |more: &str| solved::<Disc>(&format!("{line} {more}")).1["outer_steps"].clone();
    assert_eq!([steps(""), steps("--patience 1")], [json!(9), json!(1)]);
}

#[test]
fn older_names_of_flags_are_read() {
    let adaptive = format!("{LEARN} --schedule decay --adaptive");
    let evaluate = "evaluate --runs 2 --steps 2 --size 8 --baseline gauss";
    for (line, flag, older) in [
        (LEARN, "--updates", "--outer"),
        (&adaptive, "--adaptive", "--feedback"),
        (evaluate, "--baseline", "--against"),
    ] {
        let numbers = [line.to_owned(), line.replace(flag, older)].map(|line| {
            let (_, mut json) = solved::<Disc>(&line);
            json.as_object_mut().unwrap().remove("files");
            timeless(json)
        });
        assert_eq!(numbers[0], numbers[1], "{older}");
        let command = line.split(' ').next().unwrap();
        let (help, _) = run_in::<Disc>(Path::new("out"), &format!("{command} --help"));
        let [shows, hides] = [flag, older].map(|name| help.split_whitespace().any(|x| x == name));
        assert!(shows && !hides, "{help}");
    }
    let (_, json) = solved::<Disc>(&adaptive);
    assert_eq!(json["config"]["adaptive"], true);
    let (_, wrong) = run_in::<Disc>(Path::new("out"), "solve --outer 3");
    assert!(wrong.unwrap_err().message.starts_with("--outer goes with learn"));
}

proptest! {
    #![proptest_config(softrast_test_kit::cases(60))]

    #[test]
    fn a_damaged_checkpoint_is_one_line(changes in changes()) {
        let (checkpoint, steps, expected) = &*WHOLE;
        match resumed(&damaged(checkpoint, &changes), steps.as_bytes()) {
            Ok(json) => prop_assert_eq!(&json["best"], &expected["best"]),
            Err(failure) => assert_one_line(&failure, "learn.checkpoint.json"),
        }
    }

    /// Incomplete lines are omitted; invalid steps give one error line.
    #[test]
    fn damaged_steps_are_one_line_or_an_intact_rest(changes in changes()) {
        let (checkpoint, steps, expected) = &*WHOLE;
        match resumed(checkpoint.as_bytes(), &damaged(steps, &changes)) {
            Ok(json) => prop_assert_eq!(&json["best"], &expected["best"]),
            Err(failure) => assert_one_line(&failure, "learn.jsonl"),
        }
    }

    /// Another value at some place, with a matching checksum.
    #[test]
    fn a_checkpoint_with_other_values_is_one_line_or_something_to_go_on_from(
        place in any::<Index>(),
        other in prop::sample::select(vec![
            json!(null), json!(true), json!(-1), json!(0), json!(2), json!(1_000_000_000_u64), json!(0.5), json!(-1e300), json!("x"),
            json!([]), json!([0.5]), json!([0.1, 0.2, 0.3]), json!([[0.5]]), json!([[], []]), json!({}),
        ]),
    ) {
        let (checkpoint, steps, _) = &*WHOLE;
        let mut file: Value = serde_json::from_str(checkpoint).unwrap();
        let mut all = Vec::new();
        places(&file["checkpoint"], "/checkpoint", &mut all);
        *file.pointer_mut(&all[place.index(all.len())]).unwrap() = other;
        let text = match serde_json::from_value::<Checkpoint>(file["checkpoint"].clone()) {
            Ok(checkpoint) => checkpoint.text().unwrap(),
            Err(_) => file.to_string(),
        };
        if let Err(failure) = resumed(text.as_bytes(), steps.as_bytes()) {
            // A softness may also break down, which is reported without a file.
            prop_assert_eq!(failure.code, 1, "{}", failure);
            prop_assert_eq!(failure.to_string().lines().count(), 1, "{}", failure);
        }
    }
}
