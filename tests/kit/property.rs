use std::{any::Any, env, fmt::Debug, path::Path, str::FromStr};

use proptest::test_runner::{
    Config, FailurePersistence, FileFailurePersistence, PersistedSeed, RngSeed,
};

/// Default seed.
const SEED: u64 = 0x50f7;

/// The configuration of every property test: `count` cases from a fixed seed, so that results are reproducible.
///
/// A random search sets `SOFTRAST_SOAK_SEED` to another seed and `SOFTRAST_SOAK_CASES` to a factor on `count`. A failing case is written to
/// `NAME.proptest-regressions` next to the test `NAME.rs`; later runs replay it first.
///
/// # Panics
///
/// If one of these variables is not an integer.
pub fn cases(count: u32) -> Config {
    Config {
        cases: count.saturating_mul(whole("SOFTRAST_SOAK_CASES", 1)),
        rng_seed: RngSeed::Fixed(whole("SOFTRAST_SOAK_SEED", SEED)),
        failure_persistence: Some(Box::new(BesideTheTest)),
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

const BESIDE: FileFailurePersistence = FileFailurePersistence::WithSource("proptest-regressions");

/// Stores failing cases next to the source of their test. `FileFailurePersistence` alone resolves the source relative to the working
/// directory of the test when it writes, and relative to the workspace when it reads.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BesideTheTest;

impl FailurePersistence for BesideTheTest {
    fn load_persisted_failures2(&self, source: Option<&'static str>) -> Vec<PersistedSeed> {
        BESIDE.load_persisted_failures2(source.map(absolute))
    }

    fn save_persisted_failure2(
        &mut self,
        source: Option<&'static str>,
        seed: PersistedSeed,
        shrunken_value: &dyn Debug,
    ) {
        let mut beside = BESIDE;
        beside.save_persisted_failure2(source.map(absolute), seed, shrunken_value);
    }

    fn box_clone(&self) -> Box<dyn FailurePersistence> {
        Box::new(*self)
    }

    fn eq(&self, other: &dyn FailurePersistence) -> bool {
        other.as_any().downcast_ref() == Some(self)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

/// A path relative to the workspace folder, as returned by `file!()`. The allocation is leaked, once per property.
fn absolute(source: &'static str) -> &'static str {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap();
    workspace.join(source).to_string_lossy().into_owned().leak()
}
