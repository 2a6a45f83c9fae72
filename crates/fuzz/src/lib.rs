//! Mutates files, passes them to readers in this process, and reports panics, hangs and large allocations.
//!
//! A fuzz target is a program with the allocator of this crate and a list of readers:
//!
//! ```no_run
//! use std::process::ExitCode;
//!
//! use softrast_fuzz::{Allocator, Reader, Settings};
//!
//! #[global_allocator]
//! static ALLOCATOR: Allocator = Allocator;
//!
//! fn main() -> ExitCode {
//!     let numbers = Reader::new("numbers", "txt", vec![b"1 2 3\n".to_vec()], |bytes| {
//!         let text = String::from_utf8_lossy(bytes);
//!         let _sum: f64 = text.split_whitespace().filter_map(|word| word.parse::<f64>().ok()).sum();
//!     });
//!     softrast_fuzz::main(vec![numbers])
//! }
//! ```
//!
//! Each input is determined by the seed of the run, the name of the reader and its number, so a run is reproducible whatever else it reads
//! and however fast.

mod allocator;
mod mutator;
mod random;
mod runner;
mod settings;

pub use allocator::Allocator;
pub use mutator::Mutator;
pub use runner::{Reader, Report, main, run};
pub use settings::Settings;
