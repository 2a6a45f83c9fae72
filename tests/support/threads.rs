use softrast_raster::RasterBackend;

use crate::{Outputs, colours, outputs};

fn on_threads<B: RasterBackend>(count: usize) -> Outputs {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
    let pool = pool.expect("threads can be started");
    pool.install(|| [outputs::<B>(), colours::<B>()].concat())
}

/// Asserts that every output of the ops is bitwise equal on 1, 2 and 7 threads.
///
/// # Panics
///
/// If one differs, or is zero everywhere.
pub fn assert_same_on_threads<B: RasterBackend>() {
    let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let alone = on_threads::<B>(1);
    assert!(alone.iter().all(|(_, values)| values.iter().any(|&x| x != 0.0)), "an output is zero");
    // Twice on many threads, since their order differs between runs.
    for count in [2, 7, 7] {
        for ((name, found), (_, expected)) in on_threads::<B>(count).iter().zip(&alone) {
            assert!(bits(found) == bits(expected), "{name} differs on {count} threads");
        }
    }
}
