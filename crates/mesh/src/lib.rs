//! Triangle meshes for softrast: a robust reader of OBJ, PLY, STL, OFF, GLB and glTF, a writer of OBJ, PLY and GLB, and small generators.
//!
//! A [`Mesh`] is always valid: its positions are finite, its indices are in range, and it has at least one face; it may have colours and a
//! [`Texture`]. Violations are a [`MeshError`] of one line with the file, the place and the reason. This crate does not depend on burn.
//!
//! ```
//! use softrast_mesh::{Mesh, icosphere};
//!
//! let ball = icosphere(2);
//! assert_eq!(ball.faces().len(), 320);
//! let error = Mesh::parse(b"v 0 0 0\nv 1 0 0\nf 1 2 3", "a.obj").unwrap_err();
//! assert_eq!(error.to_string(), "a.obj:3: index 3 is out of range: the file has 2 vertices");
//! ```

mod airplane;
mod bounded;
mod chair;
mod cluster;
mod colours;
mod corner;
mod crossings;
mod edges;
mod error;
mod format;
mod fox;
mod glb;
mod glb_parts;
mod glb_texture;
mod glb_writer;
mod gltf;
mod gltf_buffers;
mod gltf_component;
mod icosphere;
mod material;
mod mesh;
mod normalized;
mod number;
mod obj;
mod obj_texture;
mod off;
mod parts;
mod pictures;
mod placement;
mod ply;
mod ply_header;
mod polygon;
mod read;
mod referenced;
mod remesh;
mod separated;
mod solid;
mod statements;
mod stl;
mod stroke;
mod subdivision;
mod surface_net;
mod texture;
#[doc(hidden)]
pub mod vectors;
mod write;

pub use airplane::airplane;
pub use bounded::{open_regular, read_bounded};
pub use chair::chair;
pub use edges::Edges;
pub use error::{Fault, MeshError};
pub use fox::{fox, painted_fox};
pub use icosphere::icosphere;
pub use material::{Material, from_linear, to_linear};
pub use mesh::Mesh;
pub use remesh::{Changes, ClosedSurface, SurfaceGeometry};
pub use texture::Texture;

/// Compiles and runs the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
