#![allow(missing_docs, unused)]
extern crate self as softrast_tests;
pub use softrast_softness::{numbers, vector};
pub fn tensor<B: burn::tensor::backend::Backend, const D: usize>(
    values: &[f64],
    shape: [usize; D],
) -> burn::tensor::Tensor<B, D> {
    softrast_softness::tensor(values.to_vec(), shape)
}
#[path = "../../../tests/f64/raster/soft_blend.rs"]
mod soft_blend;
mod triangles;
