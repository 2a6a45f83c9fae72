//! The library call that finds the cheapest settings, on a task whose errors are known.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use softrast_runner::{
    Batch, Choice, Description, Detail, Error, Measure, NoArgs, Point, Progress, Resolution, Run,
    Schedule, Settings, SoftnessChoice, Task, Variant, choose,
};

/// A task that draws nothing: its error is the sum of what each setting costs. In the original variant
/// a logistic is enough, on half of the pixels, at a hundred times the tolerance and level 2.
struct Known {
    settings: Settings,
    softness: &'static str,
    level: usize,
}

impl Known {
    fn error(&self, seed: u64) -> f64 {
        let Settings { variant, schedule, resolution, tolerance, .. } = self.settings;
        // One method is better on even seeds, another on odd ones: on average they are alike.
        let noise = if seed.is_multiple_of(2) { 0.01 } else { -0.01 };
        let softness = match (self.softness, variant) {
            ("logistic", Variant::Original) => noise,
            ("logistic", Variant::Transfer) => 0.3 + noise,
            ("gauss", _) => -0.0005,
            ("exp", _) => f64::NAN,
            _ => 0.2,
        };
        let schedule = if schedule == Some(Schedule::Decay) { 0.0 } else { 0.001 };
        let resolution = match resolution {
            Some(Resolution::Side(8)) => 0.5,
            Some(Resolution::Side(16)) => 2.0 * noise,
            _ => 0.0,
        };
        let tolerance = if tolerance.is_some_and(|x| x > 2e-3) { 0.1 } else { 0.0 };
        let level = if self.level < 2 { 0.4 } else { 0.0 };
        1.0 + softness + schedule + resolution + tolerance + level
    }
}

impl Task for Known {
    const NAME: &'static str = "known";
    const ABOUT: &'static str = "Has errors that are known";
    type Args = NoArgs;

    fn prepare(settings: &Settings, _args: &NoArgs) -> anyhow::Result<Self> {
        let softness = match settings.softness {
            None => "logistic",
            Some(SoftnessChoice::Named(name)) if name != "mlp" => name,
            _ => return Err(Error::Usage("there is no such softness here".into()).into()),
        };
        let level = settings.detail.unwrap_or(4);
        Ok(Self { settings: settings.clone(), softness, level })
    }

    fn describe(&self) -> Description {
        let measure = Measure { name: "error", unit: "" };
        Description {
            softness: self.softness.into(),
            parameters: 1,
            backend: String::new(),
            steps: 1,
            size: 32,
            faces: self.level,
            runs: 1,
            image_error: measure,
            parameter_error: measure,
            extra: Vec::new(),
            success: String::new(),
            settings: serde_json::Map::new(),
        }
    }

    fn detail(&self) -> Option<Detail> {
        Some(Detail { flag: "level", values: vec![1, 2, 4], usual: 4 })
    }

    fn run(&self, batch: &Batch, _progress: &mut Progress) -> anyhow::Result<Vec<Run>> {
        let run = |&seed: &u64| {
            let error = self.error(seed);
            let point = Point {
                step: 0,
                loss: error,
                image_error: error,
                parameter_error: error,
                scale: 1.0,
                extra: Vec::new(),
            };
            Run {
                seed,
                curve: vec![point],
                success: true,
                step_seconds: vec![0.5],
                pictures: None,
                warnings: Vec::new(),
            }
        };
        Ok(batch.seeds.iter().map(run).collect())
    }
}

fn chosen(settings: &Settings, budget: Option<f64>) -> Choice {
    choose::<Known>(settings, &NoArgs {}, &[5, 6, 7, 8], budget).unwrap()
}

#[test]
fn where_a_logistic_is_enough_it_is_the_answer_and_so_is_what_is_cheap() {
    let choice = chosen(&Settings::default(), None);
    let flags = "--softness logistic --schedule static --resolution 16 --tolerance 0.001 --level 2";
    assert_eq!(choice.flags(), flags);
    // Not by its error: a decaying Gauss curve has the least.
    assert_eq!(
        choice.stages[0].reasons[choice.stages[0].best].flags,
        "--softness gauss --schedule decay"
    );
    assert!(choice.whole && choice.stages.len() == 4);
    let Settings { softness, resolution, tolerance, detail, .. } = choice.settings;
    assert_eq!(softness, Some(SoftnessChoice::Named("logistic")));
    assert_eq!((resolution, tolerance), (Some(Resolution::Side(16)), Some(1e-3)));
    assert_eq!(detail, Some(2));
    let softnesses = &choice.stages[0].reasons;
    assert!(softnesses.iter().all(|reason| !reason.flags.contains("mlp")));
    let exp = softnesses.iter().find(|reason| reason.flags.contains("exp")).unwrap();
    assert_eq!((exp.verdict, exp.mean), ("not finite", None));
    assert_eq!(choice.stages[3].answer().with, "2 faces");
    assert_eq!(choice.stages[3].answer().seconds, 0.5);
}

#[test]
fn where_a_logistic_is_not_enough_it_is_not_the_answer() {
    let settings = Settings { variant: Variant::Transfer, ..Settings::default() };
    assert!(chosen(&settings, None).flags().starts_with("--softness gauss"));
}

#[test]
fn what_is_asked_for_is_not_asked_again() {
    let settings = Settings {
        resolution: Some(Resolution::Auto),
        tolerance: Some(0.5),
        ..Settings::default()
    };
    let choice = chosen(&settings, None);
    let asked: Vec<_> = choice.stages.iter().map(|stage| stage.of).collect();
    assert_eq!(asked, ["softness", "detail"]);
    assert_eq!(choice.settings.resolution, Some(Resolution::Auto));
}

#[test]
fn without_time_the_simplest_is_the_answer() {
    let choice = chosen(&Settings::default(), Some(1e-12));
    assert_eq!(choice.flags(), "--softness logistic --schedule static");
    assert!(!choice.whole && choice.stages.len() == 1 && choice.stages[0].reasons.len() == 1);
}
