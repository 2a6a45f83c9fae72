//! Softnesses in JSON files: reading, checking, writing, and those bundled with the crate.

mod depth_softness_file;
mod name_or_file;
mod named_softness;
pub(crate) mod stored;

pub use depth_softness_file::DepthSoftnessFile;
pub use name_or_file::NameOrFile;
pub use named_softness::NamedSoftness;
pub use stored::SoftnessFileError;
