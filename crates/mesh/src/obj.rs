//! An OBJ file: its content in two steps, cleaned and then parsed, and its text.

use std::{fmt, path::Path};

use crate::{Mesh, MeshError, Texture, clean::clean, obj_texture, polygon::triangles};

/// The mesh in `bytes`; see [`Mesh::parse`]. With the `folder` of the file also its texture, or why it was left out.
pub(crate) fn parse(
    bytes: &[u8],
    name: &str,
    folder: Option<&Path>,
) -> Result<(Mesh, Option<MeshError>), MeshError> {
    let clean = clean(bytes).map_err(|trouble| trouble.of_file(name))?;
    // The parser numbers vertices as faces first use them. A first polygon that lists them
    // all keeps the order of the file, and those which no face uses.
    let all: String = (1..=clean.vertices).map(|vertex| format!(" {vertex}")).collect();
    let text = format!("f{all}\n{}", clean.text);
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let options = tobj::LoadOptions::default();
    let (models, _) =
        tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials).map_err(|reason| {
            MeshError::Parser { name: name.to_owned(), reason: reason.to_string() }
        })?;

    // Of each triangle also which corners it has, all corners of the file being numbered in order.
    let (mut positions, mut faces, mut cut, mut corners) = (vec![], vec![], vec![], 0);
    for tobj::Model { mesh, .. } in models {
        positions.extend(mesh.positions.as_chunks().0);
        for polygon in split(&mesh.indices, &mesh.face_arities).skip(1) {
            for triangle in triangles(&positions, polygon) {
                faces.push(triangle.map(|k| polygon[k]));
                cut.push(triangle.map(|k| corners + k));
            }
            corners += polygon.len();
        }
    }
    let mesh = Mesh::new(positions, faces)?;
    let mesh = match clean.colours {
        Some(colours) => mesh.with_colours(colours)?,
        None => mesh,
    };
    let Some(folder) = folder else { return Ok((mesh, None)) };
    let (texture, left_out) = obj_texture::parse(bytes, folder, &cut);
    let mesh = match texture {
        Some(texture) => mesh.with_texture(texture)?,
        None => mesh,
    };
    Ok((mesh, left_out.map(|trouble| trouble.of_file(name))))
}

/// The polygons of a parsed model; no `arities` means that all are triangles.
fn split<'a>(mut indices: &'a [u32], arities: &'a [u32]) -> impl Iterator<Item = &'a [u32]> {
    let mut arities = arities.iter();
    std::iter::from_fn(move || {
        let corners = arities.next().map_or(3, |&n| n as usize);
        let (polygon, rest) = indices.split_at_checked(corners)?;
        indices = rest;
        Some(polygon)
    })
}

/// A mesh as the text of an OBJ file.
pub(crate) struct Obj<'a>(pub(crate) &'a Mesh);

impl fmt::Display for Obj<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (vertex, [x, y, z]) in self.0.positions().iter().enumerate() {
            write!(f, "v {x} {y} {z}")?;
            if let Some([red, green, blue]) = self.0.colours().map(|colours| colours[vertex]) {
                write!(f, " {red} {green} {blue}")?;
            }
            writeln!(f)?;
        }
        let texture = self.0.texture();
        for [u, v] in texture.into_iter().flat_map(Texture::coordinates) {
            writeln!(f, "vt {u} {v}")?;
        }
        for (number, face) in self.0.faces().iter().enumerate() {
            f.write_str("f")?;
            for (k, &vertex) in face.iter().enumerate() {
                write!(f, " {}", u64::from(vertex) + 1)?;
                if let Some(texture) = texture {
                    write!(f, "/{}", u64::from(texture.corners()[number][k]) + 1)?;
                }
            }
            writeln!(f)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_keep_the_order_of_the_file() {
        for count in 1..6 {
            let lines = (0..count).map(|x| format!("v {x} 0.1 0\n")).collect::<String>();
            let mesh = Mesh::parse(format!("{lines}f -1 1 1").as_bytes(), "a.obj").unwrap();
            let expected = (0..count).map(|x| [f64::from(x), 0.1, 0.0]).collect::<Vec<_>>();
            assert_eq!(mesh.positions(), expected);
            assert_eq!(mesh.faces(), [[count - 1, 0, 0]]);
        }
    }
}
