//! What the tests that cross crates share: workloads with known results, small problems, tensors.

mod known_row;
mod outputs;
mod paper_mesh;
mod shape2d;
mod tensors;
mod waves;
mod workload;

pub use known_row::KnownRow;
pub use outputs::{Outputs, outputs};
pub use paper_mesh::paper_mesh;
pub use shape2d::{Shape2d, shape2d_start};
pub use tensors::{numbers, tensor, vector};
pub use waves::{WAVES, Waves};
pub use workload::{Row, Workload};
