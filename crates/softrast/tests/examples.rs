//! Every example runs to its end and says something. `cargo test` builds them beside this test.

use std::{env, path::PathBuf, process::Command};

fn folder() -> PathBuf {
    let test = env::current_exe().expect("a test has a path");
    test.ancestors().nth(2).expect("target/release/deps").join("examples")
}

fn runs(example: &str) -> String {
    let program = folder().join(format!("{example}{}", env::consts::EXE_SUFFIX));
    let elsewhere = tempfile::tempdir().expect("a temporary folder");
    let output = Command::new(&program).current_dir(&elsewhere).output();
    let output = output.unwrap_or_else(|error| panic!("cannot run {program:?}: {error}"));
    let [said, complained] = [&output.stdout, &output.stderr].map(|x| String::from_utf8_lossy(x));
    assert!(output.status.success(), "{example}: {said}{complained}");
    said.into_owned()
}

/// The number behind the last occurrence of some words.
fn number_after(text: &str, words: &str) -> f64 {
    let rest = text.rsplit(words).next().unwrap_or_default().trim_start();
    let end = rest.find(char::is_whitespace).unwrap_or(rest.len());
    rest[..end].parse().unwrap_or_else(|_| panic!("no number behind {words:?} in {text}"))
}

#[test]
fn a_silhouette_has_gradients() {
    assert!(number_after(&runs("silhouette"), "mean coverage") > 0.1);
}

#[test]
fn an_own_softness_draws_a_fox() {
    let picture = runs("own_softness");
    assert!(picture.contains("@@") && picture.contains("    "), "{picture}");
}

#[test]
fn a_sphere_comes_to_fit_two_silhouettes() {
    assert!(number_after(&runs("fit"), "IoU loss") < 0.1);
}

#[test]
fn a_pose_is_found_from_a_mask() {
    assert!(number_after(&runs("pose_from_mask"), "IoU") > 0.97);
}

#[test]
fn colours_are_found_from_pictures() {
    assert!(number_after(&runs("colour"), "mean squared error") < 1e-4);
}

#[test]
fn learning_lowers_the_validation_loss() {
    let said = runs("learn");
    let losses: Vec<f64> = said
        .split("validation ")
        .skip(1)
        .map(|rest| rest.split_whitespace().next().unwrap_or_default().parse().unwrap_or(f64::NAN))
        .collect();
    let best = losses.iter().copied().fold(f64::INFINITY, f64::min);
    assert!(best < 0.8 * losses[0], "{said}");
}

#[test]
fn a_meta_gradient_is_a_number() {
    let by_scale = number_after(&runs("meta_gradient"), "of the scale:");
    assert!(by_scale.is_finite() && by_scale != 0.0, "{by_scale}");
}
