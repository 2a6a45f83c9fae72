//! Initial parameters of learning, as one vector.

use std::path::Path;

use softrast_cli::{MethodArgs, Scales, Schedule};
use softrast_inverse::{
    AdaptiveSchedule, Input, Instances, LearnConfig, Method, OuterLoss, PhiLayout, ScaleSchedule,
    ScheduledSoftness, SolveConfig,
};
use softrast_meta::{MetaGradient, Objective, TaskDistribution};
use softrast_softness::{EdgeSoftness, Family, Softness};
use softrast_tensor::{Autodiff, NdArray};
use softrast_tests::{numbers, vector};

use super::square::Square;

type B = NdArray<f64>;

const SIZE: usize = 64;
const STEPS: usize = 10;
const SCALES: Scales = Scales { schedule: Schedule::Static, decay: [0.1, 0.01], fixed: 0.1 };

fn made(line: &str) -> anyhow::Result<Method> {
    MethodArgs::parse(line).unwrap().method("none", &SCALES, true)
}

fn method(line: &str) -> Method {
    made(line).unwrap()
}

fn config(input: Input) -> LearnConfig {
    LearnConfig { input, ..LearnConfig::default() }
}

fn layout(line: &str, input: Input) -> PhiLayout {
    PhiLayout::learned(&method(line).softness, Vec::new(), STEPS, SIZE, &config(input))
}

fn instances(line: &str, config: &LearnConfig) -> anyhow::Result<Instances<Square, B>> {
    let solve = SolveConfig { size: SIZE, steps: STEPS, learning_rate: 0.1 };
    Instances::new(Square { floor: 0.0, seen: true }, &method(line), &solve, config)
}

/// Parameters at a step computed by tensor ops on the vector, as in learning.
fn phi_at(line: &str, input: Input, learned: &[f64], step: usize) -> Vec<f64> {
    let instances = instances(line, &config(input)).unwrap();
    let problem = instances.problem(5, &vector(learned));
    let phi = vector::<Autodiff<Autodiff<B>>>(learned).require_grad();
    numbers(problem.objective.prepared(phi, step))
}

/// Saves the softness of a vector, and returns the line with its file.
fn saved(line: &str, input: Input, learned: &[f64], path: &Path) -> String {
    let (softness, own) = layout(line, input).softness(learned);
    assert!(own.is_empty());
    let (rate, note) = (Some(0.3), Some("a test".to_owned()));
    ScheduledSoftness { learning_rate: rate, note, ..softness }.save(path).unwrap();
    path.display().to_string()
}

fn assert_near(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= 1e-5 * b.abs().max(1.0), "{found:?}, not {expected:?}");
    }
}

#[test]
fn a_learned_width_begins_with_the_softness_as_it_is() {
    for line in ["mlp --scale 0.05", "mlp --init fitted --scale 0.05"] {
        let [ndc, relative] = [Input::Ndc, Input::Relative].map(|input| layout(line, input));
        assert_eq!([ndc.start().len(), relative.start().len()], [56, 57]);
        assert_near(&phi_at(line, Input::Relative, &relative.start(), 0), &ndc.start());
        assert_eq!(relative.stage(7), 0);
    }
    // The scale of a family replaces its first parameter.
    assert_eq!(layout("exp --scale 0.05", Input::Relative).start().len(), 2);
}

#[test]
fn a_file_without_a_schedule_can_have_one_put_in_front() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("softness.json");
    for line in ["mlp --scale 0.05", "exp --scale 0.05"] {
        let whole = layout(line, Input::Ndc).start();
        let file = saved(line, Input::Ndc, &whole, &path);
        let relative = layout(&file, Input::Relative).start();
        assert_near(&phi_at(&file, Input::Relative, &relative, 0), &whole);
    }
}

#[test]
fn a_learned_vector_comes_back_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("softness.json");
    for line in [
        "mlp",
        "gauss --schedule decay",
        "exp --schedule decay --surrogate-scale 0.2",
        "logistic --surrogate-scale 0.2",
    ] {
        for input in [Input::Ndc, Input::Relative] {
            let start = layout(line, input).start();
            let learned: Vec<f64> = start.iter().map(|x| 0.9 * x - 0.1).collect();
            let file = saved(line, input, &learned, &path);
            let read = method(&file).softness;
            for step in [0, 4, 9] {
                let phi = read.phi_at(ScaleSchedule::progress(step, STEPS), SIZE);
                assert_near(&phi, &phi_at(line, input, &learned, step));
            }
            let surrogate = read.surrogate.as_ref().map_or(&[][..], |other| &other.phi);
            assert_eq!(surrogate.is_empty(), !line.contains("surrogate"));
            assert_near(surrogate, &learned[learned.len() - surrogate.len()..]);
            assert_eq!(read.learning_rate, Some(0.3));
            assert_eq!(read.note.as_deref(), Some("a test"));
            // The rate is only used for the task that it was learned on.
            ScheduledSoftness { task: Some("another".into()), ..read }.save(&path).unwrap();
            assert_eq!(method(&file).softness.learning_rate, None);
        }
    }
}

/// The largest difference between two softnesses within four widths of the edge.
fn off([a, b]: [(EdgeSoftness, Vec<f64>); 2], width: f64) -> f64 {
    let places: Vec<f64> = (-40..=40).map(|k| 0.1 * f64::from(k) * width).collect();
    let [a, b] =
        [a, b].map(|(softness, phi)| numbers(softness.value(vector::<B>(&phi), vector(&places))));
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn a_network_takes_the_place_of_a_symmetric_softness_and_keeps_its_schedule() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("softness.json");
    for line in [
        "gauss --schedule decay",
        "logistic --scale 0.02",
        "gauss --schedule decay --surrogate-scale 0.3",
    ] {
        let file = saved(line, Input::Ndc, &layout(line, Input::Ndc).start(), &path);
        let both = [file.clone(), format!("{file} --init fitted")].map(|line| method(&line));
        let [family, network] = both.map(|method| method.softness);
        assert_eq!(network.softness.family, Family::Mlp);
        for step in [0, 9] {
            let progress = ScaleSchedule::progress(step, STEPS);
            let width = family.scale_at(progress, SIZE);
            let shown = [&family, &network].map(|of| (of.softness, of.phi_at(progress, SIZE)));
            assert!(off(shown, width) < 0.01, "{line}, step {step}");
            let surrogates = [&family, &network].map(|of| of.surrogate_at(progress, SIZE));
            assert_eq!(
                surrogates.iter().flatten().count(),
                if line.contains("su") { 2 } else { 0 }
            );
            if let [Some(a), Some(b)] = surrogates {
                let surrogates = [a, b].map(|of| (of.softness, of.phi));
                assert!(off(surrogates, width) < 0.01, "{line}, step {step}: surrogates");
            }
        }
    }
    let line = "exp --scale 0.02";
    let file = saved(line, Input::Ndc, &layout(line, Input::Ndc).start(), &path);
    let error = made(&format!("{file} --init fitted")).unwrap_err().to_string();
    assert!(error.contains("treats both sides of an edge alike"), "{error}");
}

#[test]
fn a_surrogate_goes_only_with_estimators_that_follow_what_replaces_the_derivative() {
    use MetaGradient::{AlternatingDescent, Direct, EvolutionStrategy, Truncated, Unrolled};
    let unrolled = Unrolled { clip: Some(1.0) };
    for (estimator, outer_loss, learns) in [
        (unrolled, OuterLoss::Fixed, true),
        (Truncated { steps: 3, clip: Some(1.0) }, OuterLoss::Fixed, true),
        (EvolutionStrategy { sigma: 0.05, pairs: 1 }, OuterLoss::Fixed, true),
        (AlternatingDescent { learning_rate: 0.1 }, OuterLoss::Fixed, false),
        (Direct, OuterLoss::Own, false),
        (unrolled, OuterLoss::Own, false),
    ] {
        let (estimator, outer_loss) = (Some(estimator), Some(outer_loss));
        let config = LearnConfig { estimator, outer_loss, ..LearnConfig::default() };
        let found = instances("logistic --surrogate-scale 0.2", &config);
        assert_eq!(found.is_ok(), learns, "{config:?}");
        assert!(instances("logistic", &config).is_ok());
    }
}

#[test]
fn an_adaptive_schedule_is_part_of_the_vector_and_uses_the_returned_loss() {
    let config = LearnConfig { adaptive: true, ..LearnConfig::default() };
    let line = "logistic --schedule decay --surrogate-scale 0.2";
    let softness = method(line).softness;
    let layout = PhiLayout::learned(&softness, vec![7.0], STEPS, SIZE, &config);
    let start = layout.start();
    // Three knots preceded by the surrogate and followed by a custom parameter of the problem.
    assert_eq!((start.len(), &start[4..10]), (11, &AdaptiveSchedule::START.parameters()[..]));
    let (learned, own) = layout.softness(&start);
    assert_eq!(
        (learned.adaptive, own),
        (Some(AdaptiveSchedule { steps: STEPS, ..AdaptiveSchedule::START }), vec![7.0])
    );

    // From 5, ten steps of 0.1 arrive at 4, whose image of integers has an error of 16.
    let instances = instances(line, &config).unwrap();
    assert!((instances.loss(5, &vector(&start[..10])) - 4.0).abs() < 1e-12);
}
