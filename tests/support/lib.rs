//! Shared code of tests that span crates: workloads with known results, small problems, tensors; and doctests of the pages.

mod arctan;
mod colours;
mod known_row;
mod lopsided_mesh;
mod outputs;
mod paper_mesh;
mod shape2d;
mod tensors;
mod threads;
mod tolerance;
mod waves;
mod workload;

pub use arctan::Arctan;
pub use colours::colours;
pub use known_row::KnownRow;
pub use lopsided_mesh::lopsided_mesh;
pub use outputs::{Outputs, outputs};
pub use paper_mesh::paper_mesh;
pub use shape2d::{Shape2d, shape2d_start};
pub use softrast_tensor::{numbers, vector};
pub use tensors::tensor;
pub use threads::assert_same_on_threads;
pub use tolerance::{Deviation, ToleranceCase};
pub use waves::{WAVES, Waves};
pub use workload::{Row, Workload};

/// Compiles and runs the examples of the project's README.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;

/// Compiles and runs the guide's example.
#[cfg(doctest)]
#[doc = include_str!("../../docs/guide/adding-a-softness.md")]
pub struct AddingASoftness;

/// Compiles and runs the examples of the page for users of other rasterizers.
#[cfg(doctest)]
#[doc = include_str!("../../docs/guide/coming-from-pytorch3d.md")]
pub struct ComingFromPyTorch3d;
