//! Errors of meshes and their files, each as one line of text.

use std::{
    io,
    path::{Path, PathBuf},
};

/// Largest absolute texture coordinate. Much farther out, 32-bit floats could not distinguish the texels of a picture.
pub(crate) const FARTHEST: f64 = 1e4;

/// Errors when a mesh is created, read or written.
///
/// Each message is complete in itself: the cause is part of the text, not a separate source.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file is missing, is not a regular file, or could not be read.
    #[error("{}: cannot be read: {reason}", file(path))]
    Read {
        /// The requested file.
        path: PathBuf,
        /// The error of the operating system.
        reason: io::Error,
    },
    /// The file could not be written; its previous content is unchanged.
    #[error("{}: cannot be written: {reason}", file(path))]
    Write {
        /// The requested file.
        path: PathBuf,
        /// The error of the operating system.
        reason: io::Error,
    },
    /// The file's name does not have the extension of a readable format.
    #[error(
        "{}: meshes are read from files that end in .obj, .ply, .stl, .off, .glb or .gltf",
        file(name)
    )]
    UnknownFormat {
        /// Name of the file.
        name: String,
    },
    /// The path does not have the extension of a writable format; its previous content is unchanged.
    #[error("{}: meshes are written to files that end in .obj, .ply or .glb", file(path))]
    NotWritten {
        /// The requested file.
        path: PathBuf,
    },
    /// A line of a text file, or of the header of a PLY file, cannot be used.
    #[error("{}:{line}: {reason}", file(name))]
    Line {
        /// Name of the file.
        name: String,
        /// Physical line on which the statement starts, counted from 1.
        line: usize,
        /// The reason.
        reason: Fault,
    },
    /// A part of a file without lines cannot be used.
    #[error("{}: {part}: {reason}", file(name))]
    Part {
        /// Name of the file.
        name: String,
        /// The part, such as `vertex 3`, `triangle 0` or `accessor 2`; all count from 0.
        part: String,
        /// The reason.
        reason: Fault,
    },
    /// A file without faces: empty, a point cloud, or not of its format at all.
    #[error("{}: no faces: {expected}", file(name))]
    NoFaces {
        /// Name of the file.
        name: String,
        /// Description of the faces in a file of this format.
        expected: &'static str,
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
    /// An edge does not have two faces in opposite directions.
    #[error(
        "the mesh is not closed: the edge of vertices {} and {} has not two faces that go through it in opposite directions",
        vertices[0],
        vertices[1]
    )]
    NotClosed {
        /// Indices of both ends, from 0.
        vertices: [usize; 2],
    },
    /// Faces at a vertex do not form a single fan.
    #[error("the mesh branches: the faces at vertex {vertex} do not make one fan")]
    Branches {
        /// Index of the vertex, from 0.
        vertex: usize,
    },
    /// The number of colours differs from that of the vertices.
    #[error("{found} colours for the {vertices} vertices of the mesh")]
    Colours {
        /// Number of colours.
        found: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A channel of a colour is not from 0 to 1.
    #[error("the colour of vertex {vertex} of the mesh is not from 0 to 1")]
    Colour {
        /// Index of the vertex, from 0.
        vertex: usize,
    },
    /// A texture coordinate is NaN, or too large for 32-bit floats to distinguish texels.
    #[error("texture coordinate {coordinate} is not from -{FARTHEST} to {FARTHEST}")]
    Coordinate {
        /// Index of the coordinate, from 0.
        coordinate: usize,
    },
    /// A corner of a face refers to a coordinate that the texture does not have.
    #[error(
        "a corner of face {face} has texture coordinate {coordinate}, but there are {coordinates}"
    )]
    Corner {
        /// Index of the face, from 0.
        face: usize,
        /// Its coordinate, from 0.
        coordinate: u32,
        /// Number of coordinates.
        coordinates: usize,
    },
    /// The number of faces of a texture differs from that of the mesh.
    #[error("a texture on {found} faces for the {faces} faces of the mesh")]
    TextureFaces {
        /// Number of faces of the texture.
        found: usize,
        /// Number of faces of the mesh.
        faces: usize,
    },
    /// The number of materials of faces differs from that of the faces.
    #[error("materials of {found} faces for the {faces} faces of a texture")]
    MaterialFaces {
        /// Number of faces with a material.
        found: usize,
        /// Number of faces.
        faces: usize,
    },
    /// A face refers to a material that the texture does not have.
    #[error("face {face} has material {material}, but there are {materials}")]
    Material {
        /// Index of the face, from 0.
        face: usize,
        /// Its material, from 0.
        material: u32,
        /// Number of materials.
        materials: usize,
    },
    /// A factor of a material is not from 0 to 1.
    #[error("a factor of a material is not from 0 to 1")]
    Factor,
    /// The first bytes of a picture are not those of a readable format.
    #[error("the picture of a texture is neither PNG nor JPEG")]
    Picture,
    /// A face refers to a vertex that the mesh does not have.
    #[error("face {face} of the mesh uses vertex {vertex}, but there are {vertices}")]
    Vertex {
        /// Index of the face, from 0.
        face: usize,
        /// Its vertex, from 0.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
}

/// Errors at a place of a file.
///
/// ```
/// use softrast_mesh::{Fault, Mesh, MeshError};
///
/// let error = Mesh::parse(b"v 0 0\nf 1 1 1", "a.obj").unwrap_err();
/// assert!(matches!(error, MeshError::Line { line: 1, reason: Fault::Coordinates(2), .. }));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// A vertex with fewer than three coordinates.
    #[error("fewer than three coordinates: found {0}")]
    Coordinates(usize),
    /// A coordinate that does not parse as a number.
    #[error("{0:?} is not a number")]
    Number(String),
    /// A coordinate that is NaN, infinite, or infinite once rounded to 32 bits.
    #[error("coordinate {0:?} is not finite in 32-bit floats")]
    NotFinite(String),
    /// A face with fewer than three corners.
    #[error("fewer than three corners: found {0}")]
    Corners(usize),
    /// A corner whose first field is not a whole number.
    #[error("bad index: {0:?} does not start with a vertex number")]
    Index(String),
    /// A vertex index that the file, or this part of it, does not have.
    #[error("index {index} is out of range: the file has {vertices} vertices")]
    OutOfRange {
        /// The index in the file: counted from 1 in OBJ files, from 0 in all others.
        index: String,
        /// Number of vertices.
        vertices: usize,
    },
    /// A negative index that reaches back past the first vertex.
    #[error("index {index} is out of range: {before} vertices come before it")]
    TooFarBack {
        /// The index in the file: -1 is the latest vertex.
        index: String,
        /// Number of vertices read before it.
        before: usize,
    },
    /// The file ends before this part of it is complete.
    #[error("the file ends before it is complete")]
    Truncated,
    /// A violation of the format, or an unsupported feature, in plain words.
    #[error("{0}")]
    Format(String),
}

impl Fault {
    /// Words from a file or a library may contain line breaks or be long; the message stays on one readable line.
    pub(crate) fn format(reason: impl AsRef<str>) -> Self {
        Self::Format(on_one_line(reason.as_ref(), " "))
    }
}

/// A place in a file whose name the reader does not have.
pub(crate) enum Place {
    /// Counted from 1.
    Line(usize),
    Part(String),
}

impl Place {
    pub(crate) fn trouble(self, fault: Fault) -> Trouble {
        match self {
            Self::Line(line) => Trouble::Line(line, fault),
            Self::Part(part) => Trouble::Part(part, fault),
        }
    }
}

/// An error in the content of a file whose name the reader does not have.
pub(crate) enum Trouble {
    Line(usize, Fault),
    Part(String, Fault),
    NoFaces(&'static str),
    /// An error of another file, which this one refers to.
    OtherFile(MeshError),
}

impl Trouble {
    /// A part and its error, in plain words.
    pub(crate) fn part(part: impl Into<String>, reason: impl AsRef<str>) -> Self {
        Self::Part(part.into(), Fault::format(reason))
    }

    pub(crate) fn of_file(self, name: &str) -> MeshError {
        let name = name.to_owned();
        match self {
            Self::Line(line, reason) => MeshError::Line { name, line, reason },
            Self::Part(part, reason) => MeshError::Part { name, part, reason },
            Self::NoFaces(expected) => MeshError::NoFaces { name, expected },
            Self::OtherFile(error) => error,
        }
    }
}

/// The name of a file in an error message: control characters in it must not break the line, colour it, or move the cursor.
fn file(name: impl AsRef<Path>) -> String {
    on_one_line(&name.as_ref().display().to_string(), "\u{fffd}")
}

fn on_one_line(text: &str, for_signs: &str) -> String {
    const LONGEST: usize = 500;
    let mut line = text.chars().take(LONGEST).collect::<String>();
    if text.chars().nth(LONGEST).is_some() {
        line += "...";
    }
    line.replace(char::is_control, for_signs)
}

/// A word of a file in an error message: shortened, and without characters that would break or colour the line.
pub(crate) fn shown(word: &str) -> String {
    const LONGEST: usize = 40;
    let sign = |c: char| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c };
    let mut shown: String = word.chars().take(LONGEST).map(sign).collect();
    if word.chars().nth(LONGEST).is_some() {
        shown += "...";
    }
    shown
}
