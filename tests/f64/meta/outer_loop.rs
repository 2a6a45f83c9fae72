//! Learning a step size: one softness parameter whose optimum is known.

use softrast_inverse::Checkpoint;
use softrast_meta::{
    Adam, Best, BilevelProblem, InnerLoop, LearnError, MetaGradient, Objective, OuterLoop,
    OuterSteps, Progress, Record, Sgd, TaskDistribution, Validation,
};
use softrast_tensor::{Backend, NdArray, Tensor};

type B = NdArray<f64>;

/// An attraction of strength exp(φ): gradient descent at rate 0.25 converges in two steps if `0.25 exp(φ) = 1`. A broken instance has NaN.
#[derive(Clone, Copy)]
struct Pull {
    broken: bool,
}

impl<B: Backend> Objective<B> for Pull {
    fn loss(&self, theta: Tensor<B, 1>, phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        let scale = if self.broken { f64::NAN } else { 0.5 };
        (theta.clone() * theta).sum() * phi.exp() * scale
    }
}

#[derive(Clone, Copy)]
struct Distance;

impl<B: Backend> Objective<B> for Distance {
    fn loss(&self, theta: Tensor<B, 1>, _phi: Tensor<B, 1>, _step: usize) -> Tensor<B, 1> {
        (theta.clone() * theta).sum()
    }
}

/// Starts that depend on the seed; the one in `broken`, if any, is NaN.
struct Pulls {
    broken: Option<u64>,
}

const SOUND: Pulls = Pulls { broken: None };

impl TaskDistribution<B> for Pulls {
    type Objective = Pull;
    type OuterLoss = Distance;
    type Optimizer = Sgd;

    fn problem(&self, seed: u64, _phi: &Tensor<B, 1>) -> BilevelProblem<B, Pull, Distance, Sgd> {
        let start = [1.0 + (seed % 7) as f64 / 7.0, -0.3 * (seed % 5) as f64];
        BilevelProblem {
            objective: Pull { broken: self.broken.is_some_and(|one_in| seed % one_in == 1) },
            outer_loss: Distance,
            inner: InnerLoop { optimizer: Sgd { learning_rate: 0.25 }, steps: 2 },
            start: Tensor::from_data(start, &Default::default()),
            outer_steps: OuterSteps::Last,
        }
    }
}

fn learner() -> OuterLoop {
    OuterLoop {
        estimator: MetaGradient::default(),
        optimizer: Adam::new(0.1),
        clip: 1.0,
        steps: 20,
        batch: 3,
        seed: 100,
        validation: Validation { seed: 0, count: 4, every: 5, patience: None },
    }
}

fn run(learner: &OuterLoop, tasks: &Pulls, progress: &mut Progress) -> Vec<Record> {
    std::iter::from_fn(|| learner.step(tasks, progress).expect("finite instances")).collect()
}

/// The text of a checkpoint.
fn text(job: &str, progress: &Progress) -> Vec<u8> {
    let checkpoint = Checkpoint { job: job.into(), progress: progress.clone() };
    checkpoint.text().unwrap().into_bytes()
}

/// Records without fields that differ between runs.
fn timeless(records: Vec<Record>) -> Vec<Record> {
    records.into_iter().map(|record| Record { seconds: 0.0, ..record }).collect()
}

#[test]
fn the_best_step_size_is_learned() {
    let mut progress = Progress::new(vec![0.3]);
    let records = run(&OuterLoop { steps: 60, ..learner() }, &SOUND, &mut progress);
    let best = progress.best.as_ref().unwrap();
    assert!((best.phi[0] - 4_f64.ln()).abs() < 0.1, "{best:?}");
    assert_eq!(progress.best_phi(), best.phi);
    assert!(best.loss < 1e-3 * records[0].validation_loss.unwrap(), "{best:?}");
    assert_eq!((records.len(), progress.step, progress.tried), (61, 60, 180));
    assert!(records[60].loss.is_none() && records[60].validation_loss.is_some());
    assert!(records[7].validation_loss.is_none() && records[7].loss.is_some());
}

#[test]
fn a_resumed_run_ends_as_an_uninterrupted_one_to_the_last_bit() {
    for estimator in
        [MetaGradient::default(), MetaGradient::EvolutionStrategy { sigma: 0.07, pairs: 2 }]
    {
        let learner = OuterLoop { estimator, ..learner() };
        let mut whole = Progress::new(vec![1.0 / 3.0]);
        let expected = timeless(run(&learner, &SOUND, &mut whole));
        for stop in [1, 6, 20] {
            let mut first = Progress::new(vec![1.0 / 3.0]);
            for _ in 0..stop {
                learner.step(&SOUND, &mut first).unwrap();
            }
            let text = text("pulls", &first);
            let mut second = Checkpoint::parse(&text, "pulls", &learner, 1).unwrap();
            assert_eq!(second, first);
            assert_eq!(timeless(run(&learner, &SOUND, &mut second)), expected[stop..]);
            second.seconds = whole.seconds;
            assert_eq!(second, whole);
        }
    }
}

#[test]
fn instances_that_are_not_finite_are_dropped_and_counted() {
    let mut progress = Progress::new(vec![0.3]);
    // Seeds 101, 105, 109: one in four, and one of the validation.
    let records = run(&learner(), &Pulls { broken: Some(4) }, &mut progress);
    assert_eq!(records[0].dropped, 1);
    assert_eq!(progress.dropped, 15);
    assert!(progress.phi[0].is_finite() && records[0].loss.is_some_and(f64::is_finite));
    assert!(progress.best.is_none() && records[0].validation_loss.is_none());
    assert_eq!(progress.best_phi(), progress.phi);
}

#[test]
fn a_batch_without_a_finite_instance_is_an_error_and_changes_nothing() {
    let mut progress = Progress::new(vec![f64::MAX]);
    let before = progress.clone();
    let error = learner().step(&SOUND, &mut progress).unwrap_err();
    assert_eq!(error, LearnError::AllDropped { step: 0, batch: 3 });
    assert_eq!(progress, before);
}

#[test]
fn patience_ends_a_run_that_does_not_get_better() {
    let validation = Validation { patience: Some(2), ..learner().validation };
    let learner = OuterLoop { optimizer: Adam::new(0.0), steps: 1000, validation, ..learner() };
    let mut progress = Progress::new(vec![0.3]);
    let records = run(&learner, &SOUND, &mut progress);
    assert_eq!((records.len(), progress.step), (11, 10));
    assert_eq!(progress.best.as_ref().unwrap().step, 0);
    assert!(progress.finished && learner.step(&SOUND, &mut progress).unwrap().is_none());
}

#[test]
fn a_long_gradient_is_shortened_to_the_limit() {
    // Adam is invariant to the length of a first gradient, so its moment is compared.
    let mut progress = Progress::new(vec![0.3]);
    let learner = OuterLoop { clip: 1e-3, ..learner() };
    let record = learner.step(&SOUND, &mut progress).unwrap().unwrap();
    assert!(record.gradient_norm.unwrap() > 0.1, "before clipping");
    let json = serde_json::to_value(&progress).unwrap();
    let mean: f64 = json["optimizer"][0][0].as_f64().unwrap();
    assert!((mean.abs() - 0.1 * 1e-3).abs() < 1e-12, "{mean}");
}

/// The reason why a learner of one number rejects these bytes as a checkpoint.
fn refusal(bytes: &[u8], job: &str) -> String {
    Checkpoint::parse(bytes, job, &learner(), 1).unwrap_err().to_string()
}

#[test]
fn a_damaged_checkpoint_is_refused() {
    let mut progress = Progress::new(vec![0.3]);
    learner().step(&SOUND, &mut progress).unwrap();
    let whole = text("pulls", &progress);
    // Any changed digit or letter and any truncation is detected.
    for at in 0..whole.trim_ascii_end().len() {
        assert!(refusal(&whole[..at], "pulls").contains("is no checkpoint, or a damaged one"));
        let mut bytes = whole.clone();
        if bytes[at].is_ascii_alphanumeric() {
            bytes[at] ^= 1;
            let message = refusal(&bytes, "pulls");
            assert!(message.contains("damaged") && message.lines().count() == 1, "{message}");
        }
    }
    assert!(refusal(b"{\"phi\": [0]}", "pulls").contains("damaged"));
    assert!(refusal(b"\xff\xfe", "pulls").contains("damaged"));
}

#[test]
fn a_checkpoint_of_another_job_is_refused() {
    let message = refusal(&text("pose, 50 steps", &Progress::new(vec![0.3])), "pose, 60 steps");
    assert!(message.ends_with("it is for pose, 50 steps, this is pose, 60 steps"), "{message}");
}

#[test]
fn a_checkpoint_that_nothing_can_go_on_from_is_refused() {
    let refused = |change: fn(&mut Progress)| {
        let mut progress = Progress::new(vec![0.3]);
        change(&mut progress);
        refusal(&text("pulls", &progress), "pulls")
    };
    let start = text("pulls", &Progress::new(vec![0.3]));
    assert!(Checkpoint::parse(&start, "pulls", &learner(), 1).is_ok());
    let two = refused(|progress| progress.phi.push(0.1));
    assert!(two.contains("a vector has 2 numbers, not 1"), "{two}");
    let late = refused(|progress| progress.step = 21);
    assert!(late.contains("step 21 of 20"), "{late}");
    let ahead = refused(|progress| {
        progress.best = Some(Best { step: 5, loss: 0.1, phi: vec![0.3] });
    });
    assert!(ahead.contains("the best after 5"), "{ahead}");
    let dropped = refused(|progress| progress.dropped = 1);
    assert!(dropped.contains("counts cannot be"), "{dropped}");
}
