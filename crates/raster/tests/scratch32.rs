#![allow(missing_docs, unused)]
extern crate self as softrast_tests;
pub use softrast_softness::{numbers, vector};
#[path = "../../../tests/support/tensors.rs"]
mod tensors;
pub use tensors::tensor;
mod outputs {
    pub type Outputs = Vec<(&'static str, Vec<f64>)>;
}
pub use outputs::Outputs;
#[path = "../../../tests/support/colours.rs"]
mod colours_of;
pub use colours_of::colours;
pub fn outputs<B: softrast_raster::RasterBackend>() -> Outputs {
    Vec::new()
}
#[path = "../../../tests/f32/raster/soft_blend.rs"]
mod soft_blend;
#[path = "../../../tests/f32/raster/threads.rs"]
mod threads;
