//! Infrastructure for experiments that are run on seeds.
//!
//! An [`Experiment`] runs on seeds and is measured by [`Metric`]s. A [`Runner`] runs several of them on the same seeds and stores finished
//! runs in a [`Store`]; a [`Summary`] and a [`Comparison`] report the results. [`Halving`](halving::Halving) searches for a setting,
//! [`Runner::select`] takes the cheapest of several answers that is as good as the best. [`plot::Plot`] draws charts, and
//! [`report::Report`] writes pages, on which a [`Viewer`] shows a mesh.
//!
//! This crate does not rasterize or differentiate. Its inputs are seeds, numbers, RGB images, and meshes and cameras as plain numbers, for
//! pages ([`Viewer`], [`overlay`]); its advice names flags of the programs.

mod axis;
mod checksum;
mod comparison;
pub mod curves;
mod error;
mod error_summary;
mod evaluate;
mod files;
pub mod format;
/// Search by successive halving.
pub mod halving;
mod inputs;
mod machine;
mod manifest;
mod metric;
mod outcome;
pub mod parse;
mod picture;
pub mod plot;
pub mod program;
mod progress;
pub mod report;
mod run;
/// The cheapest of several answers that is as good as the best.
pub mod select;
mod shard;
mod sharded;
mod shown;
mod statistics;
mod store;
mod summary;
mod viewer;
mod world;

pub use comparison::{Comparison, paired_among};
pub use error::{Error, Failure, INTERRUPTED, found};
pub use evaluate::{Evaluation, Finished, Runner, seeds, was_interrupted};
pub use files::{OutputFile, OutputFolder, write_atomically};
pub use halving::check_held_out;
pub use inputs::Inputs;
pub use machine::{machine, peak_rss_mib};
pub use metric::{Metric, Role, place};
pub use outcome::Outcome;
pub use picture::{
    Encoded, contact_sheet, difference, for_page, mask_png, overlay, png, rgb_from_gray,
    rgb_from_planes,
};
pub use progress::{Progress, stop_on_ctrl_c};
pub use run::{Batch, Experiment, Pictures, Point, Run, best_point};
pub use shard::Shard;
pub use sharded::Work;
pub use shown::{printable, shown};
pub use statistics::{mean, mean_interval, median, quantile, wilson_interval};
pub use store::{Store, key};
pub use summary::{Partial, Summary, headline};
pub use viewer::{Viewer, ViewerView};
pub use world::World;
