//! The Rust side of the Python package `softrast`: ops over NumPy arrays, each with the two passes back. It has no kernel of its own.
//!
//! The Python side (`python/softrast`) checks shapes in the user's terms; here only what would be wrong or unsafe to run is refused. Every
//! error and panic arrives there as a `ValueError` of one line.

mod checks;
mod colour;
mod guard;
mod learn;
mod meshes;
mod op;
mod pose;
mod renderer;
mod shape;
mod softness;
mod taped;
mod views;
mod watched;

use pyo3::prelude::*;

/// The compiled half of the package.
#[pymodule(gil_used = false)]
mod _native {
    use super::*;

    #[pymodule_export]
    use crate::{
        colour::{ColourRenderer, PreparedColour},
        guard::threads,
        learn::learn_softness,
        meshes::{fox, icosphere, load_mesh, save_mesh},
        op::{Op, iou_loss, mse_loss, orbit_matrix, perspective},
        pose::{find_pose, load_mask},
        renderer::{Prepared, Renderer, hard_silhouette},
        shape::{fit_mesh, paint},
        softness::{Softness, families, learned_names},
        views::{load_views, view_iou, view_psnr},
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // A panic becomes an error with the same message; the hook belongs to this library alone.
        std::panic::set_hook(Box::new(|_| {}));
        guard::remember_process();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
