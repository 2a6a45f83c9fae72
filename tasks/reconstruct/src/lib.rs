//! Single-view 3D reconstruction: a network that learns shapes from their silhouettes.
//!
//! An encoder sees one picture of 64×64 pixels, a decoder says how the 642 vertices of a sphere move.
//! Nothing tells them the shape: the loss compares soft silhouettes of what they made with those of
//! two pictures, from both cameras. Source: Wu et al. 2024, Sec. 5.2; docs/notes.md, Reconstruction.
//!
//! **Loss.** `1 - IoU` of the silhouettes, mean over the four of each pair of pictures, plus what keeps
//! surfaces smooth ([`Smoothness`]).
//!
//! **Softness.** Its parameters learn beside the network, by an optimiser of their own. In the released
//! script they do not: its optimiser is made before they are.
//!
//! **Metric.** `IoU` of [`Voxels`], mean over the shapes of a class, then over the classes.
//!
//! **Data.** [`Procedural`] makes shapes up; [`NpzFolder`] reads the public files of earlier papers.

#[cfg(not(any(feature = "ndarray", feature = "flex", feature = "wgpu")))]
compile_error!("reconstruct needs a backend: turn on one of the features flex, ndarray and wgpu");

mod args;
mod checkpoint;
mod compare;
mod convolution;
mod data;
mod epoch;
mod kinds;
mod learner;
mod network;
mod npy;
mod npz;
mod npz_folder;
mod objective;
mod pairs;
mod picture;
mod procedural;
mod program;
mod report;
mod score;
mod settings;
mod shapes;
mod sheet;
mod smoothness;
mod solid;
mod template;
mod train;
mod view;
mod voxels;

pub use checkpoint::{Checkpoint, Header};
pub use convolution::{convolution, convolved};
pub use epoch::{Epoch, Time};
pub use network::{Network, Width};
pub use npz_folder::NpzFolder;
pub use procedural::Procedural;
pub use program::execute;
pub use score::{Score, score};
pub use settings::{Data, Settings};
pub use shapes::{Shapes, Split};
pub use smoothness::Smoothness;
pub use template::Template;
pub use train::Training;
pub use view::{SIZE, VIEWS, orbit};
pub use voxels::Voxels;
