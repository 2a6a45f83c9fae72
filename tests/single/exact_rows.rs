//! The fused op as binaries use it, in f32 with the default tolerance, against exact results.

use burn::backend::NdArray;
use softrast_raster::Rasterizer;
use softrast_tests::{Row, w1, w2};

type B = NdArray<f32>;

#[test]
fn fused_op_has_the_exact_row_of_the_sphere() {
    if let Some(w1) = w1() {
        w1.by_fused_op::<B>(Rasterizer::TOLERANCE).assert_agrees(&Row::W1);
    }
}

#[test]
fn fused_op_has_the_exact_row_of_spot() {
    if let Some(w2) = w2() {
        w2.by_fused_op::<B>(Rasterizer::TOLERANCE).assert_agrees(&Row::W2);
    }
}
