//! The same bits on any number of threads, in f64.

use burn::backend::NdArray;
use softrast_tests::{Outputs, colours, outputs};

fn on_threads(count: usize) -> Outputs {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
    pool.install(|| [outputs::<NdArray<f64>>(), colours::<NdArray<f64>>()].concat())
}

#[test]
fn the_number_of_threads_changes_no_bit_of_any_output() {
    let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let alone = on_threads(1);
    assert!(alone.iter().all(|(_, values)| values.iter().any(|&x| x != 0.0)));
    // Twice on many threads: which of them is done first differs from run to run.
    for count in [2, 7, 7] {
        for ((name, found), (_, expected)) in on_threads(count).iter().zip(&alone) {
            assert!(bits(found) == bits(expected), "{name} differs on {count} threads");
        }
    }
}
