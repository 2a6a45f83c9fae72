//! What the tests that cross crates share: workloads with known results, small problems, tensors.

mod shape2d;
mod tensors;
mod waves;
mod workload;

pub use shape2d::{Shape2d, shape2d_start};
pub use tensors::{numbers, tensor, vector};
pub use waves::{WAVES, Waves};
pub use workload::{Row, Workload, paper_mesh, w1, w2};
