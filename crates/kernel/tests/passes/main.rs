//! The passes, called with slices.

mod colours;
mod pairs;
mod silhouettes;

use std::sync::Mutex;

use softrast_kernel::{Kernels, use_vectors};

/// Only one test at a time turns vectors off.
static VECTORS: Mutex<()> = Mutex::new(());

/// Asserts that numbers are finite, and the same bits with the vectors of this machine and with plain arrays.
fn assert_same_with_and_without_vectors<F: Kernels>(name: &str, numbers: impl Fn() -> Vec<F>) {
    let _alone = VECTORS.lock().expect("no test failed with vectors turned off");
    let fast = numbers();
    use_vectors(false);
    let portable = numbers();
    use_vectors(true);
    assert!(fast.iter().all(|x| x.to_f64().is_finite()), "{name}");
    assert!(format!("{fast:?}") == format!("{portable:?}"), "{name}");
}
