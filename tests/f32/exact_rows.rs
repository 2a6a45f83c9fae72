//! The fused op in f32 with the default tolerance, as in binaries, compared with exact results.

use softrast_raster::low_level::Rasterizer;
use softrast_tensor::NdArray;
use softrast_tests::KnownRow;

type B = NdArray<f32>;

/// Bounds for loss, mean coverage and gradient norm.
const BOUNDS: [f64; 3] = [5e-6, 1e-5, 5e-5];

fn assert_agrees(KnownRow { name, workload, row }: KnownRow) {
    workload.by_fused_op::<B>(Rasterizer::TOLERANCE).assert_agrees(name, &row, BOUNDS);
}

#[test]
fn fused_op_has_the_exact_rows() {
    KnownRow::ours().into_iter().for_each(assert_agrees);
}

#[test]
#[ignore = "needs the paper's meshes"]
fn fused_op_has_the_exact_rows_of_the_papers_meshes() {
    [KnownRow::w1(), KnownRow::w2()].into_iter().for_each(assert_agrees);
}
