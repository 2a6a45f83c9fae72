//! The reference and the fused op against results with every pixel-face pair evaluated, in f64.
//!
//! The reference visits 126 and 384 million pairs here. Its full runs are left to
//! `cargo bench -p softrast-tests --bench exact_row -- w1 reference` (and `w2`); the tests
//! hold it against the fused op on parts of both workloads.

use burn::backend::NdArray;
use softrast_mesh::icosphere;
use softrast_tests::{Row, Workload, w1, w2};

type B = NdArray<f64>;

/// Small enough that what is left against the reference is interpolation of the slope.
const TOLERANCE: f64 = 1e-9;

#[test]
fn fused_op_has_the_exact_row_of_the_sphere() {
    if let Some(w1) = w1() {
        w1.by_fused_op::<B>(TOLERANCE).assert_agrees(&Row::W1);
    }
}

#[test]
fn fused_op_has_the_exact_row_of_spot() {
    if let Some(w2) = w2() {
        w2.by_fused_op::<B>(TOLERANCE).assert_agrees(&Row::W2);
    }
}

/// Asserts that both ways agree far better than either must agree with an exact row.
fn assert_same(part: &Workload) {
    let (fused, exact) = (part.by_fused_op::<B>(TOLERANCE), part.by_reference::<B>());
    let errors = fused.errors(&exact);
    assert!(errors.iter().all(|&error| error < 1e-6), "{errors:?}");
}

#[test]
fn reference_has_the_row_of_the_fused_op_on_two_views_of_a_sphere() {
    assert_same(&Workload { mesh: icosphere(3), azimuths_deg: vec![0.0, 135.0], size: 48 });
}

#[test]
fn reference_has_the_row_of_the_fused_op_on_a_small_image_of_spot() {
    if let Some(w2) = w2() {
        assert_same(&Workload { size: 40, ..w2 });
    }
}
