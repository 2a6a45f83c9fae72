//! Softnesses in JSON files: how they are read, checked and written, and those that come with the crate.

mod depth_softness_file;
mod name_or_file;
mod named_softness;
pub(crate) mod stored;

pub use depth_softness_file::DepthSoftnessFile;
pub use name_or_file::NameOrFile;
pub use named_softness::NamedSoftness;
pub use stored::SoftnessFileError;
