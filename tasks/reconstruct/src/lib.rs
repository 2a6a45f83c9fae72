//! Single-view 3D reconstruction: a network that learns shapes from their silhouettes.
//!
//! An encoder takes one picture of 64×64 pixels, and a decoder returns the displacements of the 642 vertices of a
//! sphere. There is no 3D supervision: the loss compares soft silhouettes of the predictions with those of two
//! pictures, from both cameras. Source: Wu et al. 2024, Sec. 5.2; docs/notes.md, Reconstruction.
//!
//! **Loss.** `1 - IoU` of the silhouettes, mean over the four of each pair of pictures, plus a
//! smoothness term ([`Smoothness`]).
//!
//! **Softness.** Its parameters are learned together with the network, by a separate optimiser. In
//! the released script they are not: its optimiser is made before they are.
//!
//! **Metric.** `IoU` of [`Voxels`], mean over the shapes of a class, then over the classes.
//!
//! **Data.** [`Procedural`] generates shapes; [`NpzFolder`] reads the public files of earlier papers.

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu", feature = "cuda")))]
compile_error!(
    "reconstruct needs a backend: turn on one of the features flex, ndarray, wgpu and cuda"
);

mod args;
mod checkpoint;
mod compare;
mod data_set;
mod history;
mod kinds;
mod learner;
mod network;
mod npz;
mod npz_folder;
mod objective;
mod pairs;
mod parts;
mod procedural;
mod program;
mod report;
mod score;
mod shapes;
mod sheet;
mod solid;
mod template;
mod train;
mod view;
mod voxels;

pub use checkpoint::{Checkpoint, sealed};
pub use history::{Data, Epoch, Header, Settings, Time};
pub use network::{Network, Width, convolution, convolved};
pub use npz_folder::NpzFolder;
pub use objective::Smoothness;
pub use procedural::Procedural;
pub use program::execute;
pub use score::{Score, score};
pub use shapes::{Shapes, Split};
pub use template::Template;
pub use train::Training;
pub use view::{SIZE, VIEWS, orbit};
pub use voxels::Voxels;
