//! Files of results: they appear whole or not at all, and replace nothing that is not theirs.
//!
//! A run replaces and removes only files that an earlier run of the same command has listed as its own and that nobody has changed since
//! (`manifest.rs` says how); never a file that it reads ([`Inputs`]), never by a pattern. All else is refused in one line, by
//! [`OutputFolder::claim`] before the work and again where files are written. A file that a flag names, as `render --out FILE` does, is
//! the user's choice: an [`OutputFile`] replaces one of its own kind, but no other and no input.

mod atomic;
mod before;
mod output_file;
mod output_folder;
#[cfg(test)]
mod tests;

pub use atomic::write_atomically;
pub use output_file::OutputFile;
pub use output_folder::OutputFolder;
