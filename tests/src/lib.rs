//! What the tests that cross crates share: workloads with known results, and a small 2-D problem.

mod shape2d;
mod workload;

pub use shape2d::{Shape2d, shape2d_start};
pub use workload::{Row, Workload, w1, w2};
