use std::{env, str::FromStr};

use proptest::test_runner::{Config, FileFailurePersistence, RngSeed};

/// Seed of the ordinary test command.
const SEED: u64 = 0x50f7;

/// The configuration of every property test: `count` cases from a fixed seed, so that the test command gives one answer.
///
/// A random search sets `SOFTRAST_SOAK_SEED` to another seed and `SOFTRAST_SOAK_CASES` to a factor on `count`. A case that fails is written
/// to `NAME.proptest-regressions` beside the test `NAME.rs`; from then on every run replays it first.
///
/// # Panics
///
/// If one of these variables is not a whole number.
pub fn cases(count: u32) -> Config {
    Config {
        cases: count.saturating_mul(whole("SOFTRAST_SOAK_CASES", 1)),
        rng_seed: RngSeed::Fixed(whole("SOFTRAST_SOAK_SEED", SEED)),
        failure_persistence: Some(Box::new(FileFailurePersistence::WithSource(
            "proptest-regressions",
        ))),
        ..Config::default()
    }
}

/// The number in an environment variable.
fn whole<T: FromStr>(name: &str, default: T) -> T {
    match env::var(name) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{name}={text}: not a whole number")),
        Err(_) => default,
    }
}
