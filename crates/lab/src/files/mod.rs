//! Result files: they appear complete or not at all, and replace only files of their own command.
//!
//! A run replaces and removes only files that an earlier run of the same command has listed as its own and that are unchanged since (see
//! `manifest.rs`); never a file that it reads ([`Inputs`]), never by a pattern. Anything else is refused in one line, by
//! [`OutputFolder::claim`] before the work and again when files are written. A file named by a flag, as by `render --out FILE`, is the
//! user's choice: an [`OutputFile`] replaces one of its own kind, but no other and no input.

mod atomic;
mod before;
mod output_file;
mod output_folder;
#[cfg(test)]
mod tests;

pub use atomic::write_atomically;
pub use output_file::OutputFile;
pub use output_folder::OutputFolder;
