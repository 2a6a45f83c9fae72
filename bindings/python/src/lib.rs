//! The Rust side of the Python package `softrast`: functions of arrays with derivatives of both orders, called by Python and by XLA. It has no
//! kernel of its own.
//!
//! The Python side (`python/softrast`) checks shapes in the user's terms; here only what would be wrong or unsafe to run is refused. Every
//! error and panic arrives there as a `ValueError` of one line.

mod arrays;
mod checks;
mod colour;
#[cfg(feature = "cuda")]
mod cuda;
mod device;
mod dlpack;
mod function;
mod guard;
mod kind;
mod knots;
mod learn;
mod losses;
mod meshes;
mod op;
mod passes;
mod pose;
mod renderer;
mod shape;
mod softness;
mod store;
mod taped;
mod views;
mod watched;
mod xla;

use pyo3::prelude::*;

/// The compiled half of the package.
#[pymodule(gil_used = false)]
mod _native {
    use super::*;

    #[pymodule_export]
    use crate::{
        colour::ColourRenderer,
        function::{Function, has_cuda, iou_loss, mse_loss, orbit_matrix, perspective},
        guard::threads,
        learn::learn_softness,
        meshes::{fox, icosphere, load_mesh, save_mesh},
        pose::{find_pose, load_mask},
        renderer::{Renderer, hard_silhouette},
        shape::{fit_mesh, paint},
        softness::{Softness, families, learned_names},
        views::{load_views, view_iou, view_psnr},
        xla::xla_handler,
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // A panic becomes an error with the same message; the hook belongs to this library alone.
        std::panic::set_hook(Box::new(|_| {}));
        guard::remember_process();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
