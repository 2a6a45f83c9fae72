//! Draws random scenes, softnesses, T-conorms and tolerances, and looks for a pixel that is off by more than the renderer states.
//!
//! `cargo bench -p softrast-tests --bench soak -- SEED CASES SECONDS`, in f64 and f32 in turn. A case that is found is printed as a line of
//! JSON: once its fault is mended, it goes to `tests/f64/raster/found.json` or `tests/f32/raster/found.json`, which the tests replay.

use std::{
    env,
    process::ExitCode,
    time::{Duration, Instant},
};

use softrast_tests::{Deviation, ToleranceCase};

/// Images that were compared, and what came of it.
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
    // Cargo adds a flag of its own.
    let words = env::args().skip(1).filter(|word| word != "--bench");
    let numbers: Vec<u64> = words.map(|word| word.parse().expect("a whole number")).collect();
    let &[seed, cases, seconds] = numbers.as_slice() else { panic!("usage: SEED CASES SECONDS") };
    let (start, mut double, mut single) = (Instant::now(), Tally::default(), Tally::default());
    println!("seed {seed}");
    let mut drawn = 0;
    while drawn < cases && start.elapsed() < Duration::from_secs(seconds) {
        let case = ToleranceCase::random(seed.wrapping_add(drawn));
        double.take("f64", &case, &case.deviations());
        single.take("f32", &case, &case.deviations_in_f32());
        drawn += 1;
    }
    for (float, Tally { images, stated_above, violations }) in [("f64", &double), ("f32", &single)]
    {
        println!(
            "{float}: {drawn} cases, {images} images, {stated_above} with an error above the tolerance that is stated, {violations} violations"
        );
    }
    ExitCode::from(u8::from(double.violations + single.violations > 0))
}
