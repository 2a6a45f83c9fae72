//! What can be wrong with a mesh or its file, each as one line of text.

use std::{io, path::PathBuf};

/// Why a mesh could not be made, read or written.
///
/// Each message is complete in itself: the cause is part of the text, not a separate source.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file is missing, is not a regular file, or could not be read.
    #[error("{}: cannot be read: {reason}", path.display())]
    Read {
        /// The file asked for.
        path: PathBuf,
        /// What the operating system said.
        reason: io::Error,
    },
    /// The file could not be written; what was there before is untouched.
    #[error("{}: cannot be written: {reason}", path.display())]
    Write {
        /// The file asked for.
        path: PathBuf,
        /// What the operating system said.
        reason: io::Error,
    },
    /// A line of an OBJ file cannot be used.
    #[error("{name}:{line}: {reason}")]
    Line {
        /// Name of the file.
        name: String,
        /// Physical line on which the statement starts, counted from 1.
        line: usize,
        /// What is wrong there.
        reason: LineError,
    },
    /// An OBJ file without faces: empty, a point cloud, or not an OBJ file at all.
    #[error("{name}: no faces: an OBJ file lists them on lines that start with f")]
    NoFaces {
        /// Name of the file.
        name: String,
    },
    /// The parser refused text that was cleaned for it.
    #[error("{name}: {reason}")]
    Parser {
        /// Name of the file.
        name: String,
        /// What the parser said.
        reason: String,
    },
    /// A list of faces is empty.
    #[error("a mesh needs at least one face, found none")]
    Empty,
    /// A position is NaN, infinite, or infinite once rounded to 32 bits.
    #[error("position {vertex} of the mesh is not finite in 32-bit floats")]
    Position {
        /// Index of the vertex, from 0.
        vertex: usize,
    },
    /// A face refers to a vertex that the mesh does not have.
    #[error("face {face} of the mesh uses vertex {vertex}, but there are {vertices}")]
    Vertex {
        /// Index of the face, from 0.
        face: usize,
        /// The vertex it asks for, from 0.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
}

/// What is wrong with one line of an OBJ file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// A `v` line with fewer than three coordinates.
    #[error("fewer than three coordinates: found {0}")]
    Coordinates(usize),
    /// A coordinate that does not read as a number.
    #[error("{0:?} is not a number")]
    Number(String),
    /// A coordinate that is NaN, infinite, or infinite once rounded to 32 bits.
    #[error("coordinate {0:?} is not finite in 32-bit floats")]
    NotFinite(String),
    /// An `f` line with fewer than three corners.
    #[error("fewer than three corners: found {0}")]
    Corners(usize),
    /// A corner whose first field is not a whole number.
    #[error("bad index: {0:?} does not start with a vertex number")]
    Index(String),
    /// An index of a vertex that the file does not have.
    #[error("index {index} is out of range: the file has {vertices} vertices")]
    OutOfRange {
        /// The index as written: counted from 1.
        index: String,
        /// How many vertices the whole file has.
        vertices: usize,
    },
    /// A negative index that reaches back past the first vertex.
    #[error("index {index} is out of range: {before} vertices come before it")]
    TooFarBack {
        /// The index as written: -1 is the latest vertex.
        index: String,
        /// How many vertices have been read up to here.
        before: usize,
    },
}
