//! The program as its user sees it, and the parts that cross crates.

#[path = "main/files.rs"]
mod files;
#[path = "main/npz.rs"]
mod npz;
#[path = "main/program.rs"]
mod program;
#[path = "main/shapes.rs"]
mod shapes;
