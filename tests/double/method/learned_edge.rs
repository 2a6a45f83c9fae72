//! What learning starts from, as one vector.

use burn::backend::NdArray;
use clap::Parser;
use softrast_method::{Defaults, LearnedEdge, Method};
use softrast_raster::BackendChoice;
use softrast_runner::{Input, Judged, Order, Plan, Referee, Schedule, Settings, Variant};
use softrast_softness::{EdgeSoftness, Family, ScheduledSoftness, Softness};
use softrast_tests::{numbers, vector};

type B = NdArray<f64>;

const SIZE: usize = 64;

fn plan(input: Input, order: Order, referee: Referee) -> Plan {
    Plan {
        variant: Variant::Original,
        order,
        outer: 1,
        batch: 1,
        outer_rate: 0.03,
        learn_rate: false,
        seed: 5,
        validation_seed: 6,
        validation_runs: 1,
        patience: None,
        referee,
        judged: Judged::End,
        knots: 3,
        input,
        floor_px: 0.03,
    }
}

fn method(line: &str) -> Method {
    made(line).unwrap()
}

fn made(line: &str) -> anyhow::Result<Method> {
    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        settings: Settings,
    }
    let defaults = Defaults {
        task: "none",
        schedule: Schedule::Static,
        decay: [0.1, 0.01],
        fixed: 0.1,
        size: SIZE,
        backends: &[BackendChoice::NdArray],
    };
    let words = ["task"].into_iter().chain(line.split_whitespace());
    Method::new(&Line::parse_from(words).settings, &defaults)
}

fn edge(line: &str, input: Input) -> LearnedEdge {
    LearnedEdge::new(&method(line), &plan(input, Order::Unrolled, Referee::Fixed), 10, SIZE)
}

fn assert_near(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= 1e-5 * b.abs().max(1.0), "{found:?}, not {expected:?}");
    }
}

#[test]
fn a_learned_width_begins_with_the_softness_as_it_is() {
    for line in ["--softness mlp --scale 0.05", "--softness mlp --init fitted --scale 0.05"] {
        let (ndc, relative) = (edge(line, Input::Ndc), edge(line, Input::Relative));
        assert_eq!((ndc.parameters(), relative.parameters()), (56, 57));
        let learned = vector::<B>(&relative.start());
        assert_near(&numbers(relative.phi(&learned, 0)), &ndc.start());
        assert_eq!(relative.stage(7), 0);
    }
    // The scale of a family takes the place of its first parameter.
    assert_eq!(edge("--softness exp --scale 0.05", Input::Relative).parameters(), 2);
}

#[test]
fn a_file_without_a_path_can_have_one_put_in_front() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("softness.json");
    for line in ["--softness mlp --scale 0.05", "--softness exp --scale 0.05"] {
        let whole = edge(line, Input::Ndc);
        let (_, text) = whole.files(&whole.start(), 0.3, "a test").unwrap().remove(0);
        std::fs::write(&path, text).unwrap();
        let relative = edge(&format!("--softness {}", path.display()), Input::Relative);
        let learned = vector::<B>(&relative.start());
        assert_near(&numbers(relative.phi(&learned, 0)), &whole.start());
    }
}

#[test]
fn a_learned_vector_comes_back_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("softness.json");
    for line in [
        "--softness mlp",
        "--softness gauss --schedule decay",
        "--softness exp --schedule decay --surrogate-scale 0.2",
        "--softness logistic --surrogate-scale 0.2",
    ] {
        for input in [Input::Ndc, Input::Relative] {
            let edge = edge(line, input);
            let learned: Vec<f64> = edge.start().iter().map(|x| 0.9 * x - 0.1).collect();
            assert_eq!(edge.parameters(), learned.len());
            let (_, text) = edge.files(&learned, 0.3, "a test").unwrap().remove(0);
            std::fs::write(&path, text).unwrap();
            let read = method(&format!("--softness {}", path.display()));
            let at = vector::<B>(&learned);
            for step in [0, 4, 9] {
                let phi = read.phi(read.scale(step, 10));
                assert_near(&phi, &numbers(edge.phi(&at, step)));
            }
            let file = ScheduledSoftness::load(&path).unwrap();
            let felt = file.surrogate.as_ref().map_or(&[][..], |felt| &felt.phi);
            assert_near(felt, &learned[learned.len() - felt.len()..]);
            assert_eq!(read.learning_rate(), Some(0.3));
            assert_eq!(file.note.as_deref(), Some("a test"));
            // The rate is for the task that it was learned on.
            ScheduledSoftness { task: Some("another".into()), ..file }.save(&path).unwrap();
            assert_eq!(method(&format!("--softness {}", path.display())).learning_rate(), None);
        }
    }
}

/// A softness and its parameters.
type Step = (EdgeSoftness, Vec<f64>);

#[test]
fn a_network_takes_the_place_of_a_symmetric_softness_and_keeps_its_path() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("softness.json");
    let saved = |line: &str| {
        let edge = edge(line, Input::Ndc);
        let (_, text) = edge.files(&edge.start(), 0.3, "a test").unwrap().remove(0);
        std::fs::write(&path, text).unwrap();
        let line = format!("--softness {}", path.display());
        [method(&line), method(&format!("{line} --init fitted"))]
    };
    for line in [
        "--softness gauss --schedule decay",
        "--softness logistic --scale 0.02",
        "--softness gauss --schedule decay --surrogate-scale 0.3",
    ] {
        let [family, network] = saved(line);
        assert_eq!(network.softness().family, Family::Mlp);
        for step in [0, 9] {
            let width = family.scale(step, 10);
            let off = |of: fn(&Method, f64) -> Option<Step>| {
                let [a, b] = [&family, &network].map(|method| {
                    let (softness, phi) = of(method, method.scale(step, 10))?;
                    let places: Vec<f64> = (-40..=40).map(|k| 0.1 * f64::from(k) * width).collect();
                    Some(numbers(softness.value(vector::<B>(&phi), vector(&places))))
                });
                assert_eq!(a.is_some(), b.is_some());
                a.into_iter()
                    .flatten()
                    .zip(b.into_iter().flatten())
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f64::max)
            };
            let shown = off(|method, scale| Some((method.softness(), method.phi(scale))));
            let felt = off(|method, scale| method.surrogate(scale).map(|s| (s.softness, s.phi)));
            assert!(shown < 0.01 && felt < 0.01, "{line}, step {step}: {shown}, {felt}");
        }
    }
    let exp = edge("--softness exp --scale 0.02", Input::Ndc);
    let (_, text) = exp.files(&exp.start(), 0.3, "a test").unwrap().remove(0);
    std::fs::write(&path, text).unwrap();
    let line = format!("--softness {} --init fitted", path.display());
    let error = made(&line).unwrap_err().to_string();
    assert!(error.contains("treats both sides of an edge alike"), "{error}");
}

#[test]
fn a_surrogate_goes_only_with_orders_that_follow_what_replaces_the_derivative() {
    let both = edge("--softness logistic --surrogate-scale 0.2", Input::Ndc);
    let plain = edge("--softness logistic", Input::Ndc);
    for (order, referee, learns) in [
        (Order::Unrolled, Referee::Fixed, true),
        (Order::Truncated(3), Referee::Fixed, true),
        (Order::Es(0.05), Referee::Fixed, true),
        (Order::Joint, Referee::Fixed, false),
        (Order::Direct, Referee::Own, false),
        (Order::Unrolled, Referee::Own, false),
    ] {
        let plan = plan(Input::Ndc, order, referee);
        assert_eq!(both.suits(&plan).is_ok(), learns, "{order:?} {referee:?}");
        assert!(plain.suits(&plan).is_ok());
    }
}
