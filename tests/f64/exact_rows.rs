//! The reference and the fused op, compared with exact results of every pixel-face pair in f64.
//!
//! The reference visits up to 190 million pairs per row. Its full runs are those of
//! `cargo bench -p softrast-tests --bench exact_row -- fox reference`; the tests compare it with the fused op on a small image; several
//! views are in the exact rows.

use softrast_tensor::NdArray;
use softrast_tests::{KnownRow, Workload};

type B = NdArray<f64>;

/// So small that the remaining difference to the reference is interpolation of the slope.
const TOLERANCE: f64 = 1e-9;
/// Bounds for loss, mean coverage and gradient norm.
const BOUNDS: [f64; 3] = [1e-9, 1e-9, 1e-8];
/// Rows of the paper's meshes are known to seven decimals.
const SEVEN_DECIMALS: [f64; 3] = [5e-7, 5e-7, 2e-6];

#[test]
fn fused_op_has_the_exact_rows() {
    for KnownRow { name, workload, row } in KnownRow::ours() {
        workload.by_fused_op::<B>(TOLERANCE).assert_agrees(name, &row, BOUNDS);
    }
}

#[test]
fn reference_has_the_rows_of_the_fused_op_on_small_images() {
    for KnownRow { name, workload, .. } in KnownRow::ours() {
        let azimuths_deg = workload.azimuths_deg.into_iter().take(1).collect();
        let small = Workload { azimuths_deg, size: 24, ..workload };
        let exact = small.by_reference::<B>();
        small.by_fused_op::<B>(TOLERANCE).assert_agrees(name, &exact, BOUNDS);
    }
}

#[test]
#[ignore = "needs the paper's meshes"]
fn fused_op_has_the_exact_rows_of_the_papers_meshes() {
    for KnownRow { name, workload, row } in [KnownRow::w1(), KnownRow::w2()] {
        workload.by_fused_op::<B>(TOLERANCE).assert_agrees(name, &row, SEVEN_DECIMALS);
    }
}
