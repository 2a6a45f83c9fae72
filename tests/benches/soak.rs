//! Draws random scenes, softnesses, T-conorms and tolerances, and searches for pixels with errors above the renderer's bound.
//!
//! `cargo bench -p softrast-tests --bench soak -- SEED CASES SECONDS`, in f64 and f32 alternately. Failing cases are printed as a line of
//! JSON: once fixed, a case is added to `tests/f64/raster/found.json` or `tests/f32/raster/found.json`, which the tests replay.

use std::{
    env,
    process::ExitCode,
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use softrast_tests::{Deviation, ToleranceCase};

/// Float types of each case.
const FLOATS: [&str; 2] = ["f64", "f32"];

/// Time between two lines of progress.
const PROGRESS: Duration = Duration::from_secs(60);

/// Statistics of the compared images.
#[derive(Default)]
struct Tally {
    images: usize,
    stated_above: usize,
    violations: usize,
}

impl Tally {
    fn take(&mut self, float: &str, case: &ToleranceCase, deviations: &[Deviation]) {
        self.images += deviations.len();
        self.stated_above += deviations.iter().filter(|it| it.stated > case.tolerance).count();
        if let Some(worst) = deviations.iter().find(|deviation| !deviation.is_kept()) {
            self.violations += 1;
            let case = serde_json::to_string(case).expect("a case is JSON");
            println!("{float}: {worst:?}\n{case}");
        }
    }
}

fn main() -> ExitCode {
    // Cargo adds the flag `--bench`.
    let words = env::args().skip(1).filter(|word| word != "--bench");
    let numbers: Vec<u64> = words.map(|word| word.parse().expect("a whole number")).collect();
    let &[seed, cases, seconds] = numbers.as_slice() else { panic!("usage: SEED CASES SECONDS") };
    println!("seed {seed}");
    let (start, drawn) = (Instant::now(), AtomicU64::new(0));
    let tallies = Mutex::new(([Tally::default(), Tally::default()], Instant::now()));
    let search = || {
        while start.elapsed() < Duration::from_secs(seconds) {
            let draw = drawn.fetch_add(1, Ordering::Relaxed);
            if draw >= cases {
                break;
            }
            let case = ToleranceCase::random(seed.wrapping_add(draw));
            let deviations = [case.deviations(), case.deviations_in_f32()];
            let (tallies, told) = &mut *tallies.lock().expect("no draw panics");
            for ((tally, float), deviations) in tallies.iter_mut().zip(FLOATS).zip(&deviations) {
                tally.take(float, &case, deviations);
            }
            if told.elapsed() > PROGRESS {
                *told = Instant::now();
                eprintln!("{draw} cases");
            }
        }
    };
    thread::scope(|scope| {
        for _ in 0..thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(search);
        }
    });
    let drawn = drawn.into_inner().min(cases);
    let (tallies, _) = tallies.into_inner().expect("no draw panics");
    for (float, Tally { images, stated_above, violations }) in FLOATS.iter().zip(&tallies) {
        println!(
            "{float}: {drawn} cases, {images} images, {stated_above} with an error above the tolerance that is stated, {violations} violations"
        );
    }
    ExitCode::from(u8::from(tallies.iter().any(|tally| tally.violations > 0)))
}
