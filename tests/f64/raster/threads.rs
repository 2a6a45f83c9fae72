//! Results are bitwise equal for any number of threads, in f64.

use softrast_tensor::NdArray;
use softrast_tests::assert_same_on_threads;

#[test]
fn the_number_of_threads_changes_no_bit_of_any_output() {
    assert_same_on_threads::<NdArray<f64>>();
}
