//! An OBJ file: its statements checked, then parsed by `tobj`; and the text of one.

use std::{
    fmt::{self, Write as _},
    path::Path,
};

use crate::{
    Fault, Mesh, Texture,
    colours::{Beyond, Colours},
    corner::absolute,
    error::{Place, Trouble, shown},
    mesh::fits_f32,
    obj_texture,
    parts::Parts,
    polygon::Polygons,
    statements::statements,
};

/// The mesh in `bytes`; see [`Mesh::parse`]. With the `folder` of the file also its texture.
///
/// Only `v` and `f` matter to the mesh, in lower case; of a vertex the first three numbers and, where there are six, the other three as a
/// colour; of a corner the field before the first slash.
pub(crate) fn parse(bytes: &[u8], folder: Option<&Path>) -> Result<Parts, Trouble> {
    // A face may come before its vertices, so their number must be known first.
    let vertices = statements(bytes).filter(|s| s.words().next() == Some("v")).count();
    let mut colours = Colours::new([1.0; 3], Beyond::LeftOut);
    // The parser numbers vertices as faces first use them. A first polygon that lists them all keeps the order of the file, and those which
    // no face uses.
    let all: String = (1..=vertices).map(|vertex| format!(" {vertex}")).collect();
    let (mut text, mut vertices_read) = (format!("f{all}\n"), 0);
    for statement in statements(bytes) {
        let line = statement.line;
        let mut words = statement.words();
        let read = match words.next() {
            Some("v") => {
                vertices_read += 1;
                position(&mut words, &mut text).map(|()| {
                    if let Some(channels) = colour(words) {
                        colours.push(channels, || Place::Line(line));
                    }
                })
            }
            Some("f") => face(words, vertices_read, vertices, &mut text),
            _ => Ok(()),
        };
        read.map_err(|reason| Trouble::Line(line, reason))?;
    }
    let (positions, polygons) = parsed(&text)?;
    let cut = polygons.cut(&positions)?;
    if cut.is_empty() {
        return Err(Trouble::NoFaces("an OBJ file lists them on lines that start with f"));
    }
    let faces = polygons.faces(&cut);
    let (colours, warning) = match colours.len() == vertices {
        true => colours.settled(),
        false => (None, None),
    };
    let mut warnings = Vec::from_iter(warning);
    let texture = folder.and_then(|folder| obj_texture::parse(bytes, folder, &cut, &mut warnings));
    Ok(Parts { positions, faces, colours, texture, warnings })
}

/// Vertices and polygons of checked statements, less the first polygon.
fn parsed(text: &str) -> Result<(Vec<[f64; 3]>, Polygons), Trouble> {
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let fault = |reason| Trouble::part("statements", reason);
    let (models, _) =
        tobj::load_obj_buf(&mut text.as_bytes(), &tobj::LoadOptions::default(), no_materials)
            .map_err(|reason| fault(reason.to_string()))?;
    let (mut positions, mut polygons) = (Vec::new(), Polygons::default());
    for tobj::Model { mesh, .. } in models {
        positions.extend(mesh.positions.as_chunks().0);
        for polygon in split(&mesh.indices, &mesh.face_arities).skip(1) {
            polygons.add(polygon).map_err(|reason| fault(reason.to_string()))?;
        }
    }
    Ok((positions, polygons))
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

/// Copies three coordinates to `text`.
fn position<'a>(words: impl Iterator<Item = &'a str>, text: &mut String) -> Result<(), Fault> {
    text.push('v');
    let mut found = 0;
    for word in words.take(3) {
        let x: f64 = word.parse().map_err(|_| Fault::Number(shown(word)))?;
        if !fits_f32(x) {
            return Err(Fault::NotFinite(shown(word)));
        }
        text.extend([" ", word]);
        found += 1;
    }
    text.push('\n');
    if found < 3 { Err(Fault::Coordinates(found)) } else { Ok(()) }
}

/// The colour after the coordinates of a vertex. One further number is a weight, and other lists are not of the format.
fn colour<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<[f64; 3]> {
    let mut channel = || words.next().map(|word| word.parse().unwrap_or(f64::NAN));
    let channels = [channel()?, channel()?, channel()?];
    words.next().is_none().then_some(channels)
}

/// Writes the absolute indices of one polygon, from 1, to `text`.
fn face<'a>(
    words: impl Iterator<Item = &'a str>,
    vertices_read: usize,
    vertices: usize,
    text: &mut String,
) -> Result<(), Fault> {
    text.push('f');
    let mut found = 0;
    for word in words {
        let number = absolute(word, vertices_read, vertices)?;
        u32::try_from(number - 1)
            .map_err(|_| Fault::format("more vertices than 32 bits can number"))?;
        write!(text, " {number}").expect("a string can be written to");
        found += 1;
    }
    text.push('\n');
    if found >= 3 { Ok(()) } else { Err(Fault::Corners(found)) }
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

    #[test]
    fn only_positions_colours_and_the_first_field_of_corners_count() {
        let file = "o a\nv 1e0 .5 -2 .1 0.2 0.3\nf 2/9/9 +3// -1\nv 0 0 0 1\nmtllib /dev/zero\n\
            v 1 1 1\nl 1 2\nf -3 -2 -1";
        let mesh = Mesh::parse(file.as_bytes(), "a.obj").unwrap();
        assert_eq!(mesh.positions(), [[1.0, 0.5, -2.0], [0.0; 3], [1.0; 3]]);
        assert_eq!(mesh.faces(), [[1, 2, 0], [0, 1, 2]]);
        assert_eq!(mesh.colours(), None, "not every vertex has one");
        let mesh = Mesh::parse(b"v 0 0 0 0 .5 1\nf 1 1 1", "a.obj").unwrap();
        assert_eq!(mesh.colours(), Some([[0.0, 0.5, 1.0]].as_slice()));
    }

    #[test]
    fn faults_name_file_line_and_reason() {
        for (file, message) in [
            ("v 0 0 0\n\nf 1 1 7", "a.obj:3: index 7 is out of range: the file has 1 vertices"),
            ("v 0 0 0\nf 1 1 0", "a.obj:2: index 0 is out of range: the file has 1 vertices"),
            ("f -1 1 1\nv 0 0 0", "a.obj:1: index -1 is out of range: 0 vertices come before it"),
            (
                "v 0 0 0\nf 1 1.5 1",
                "a.obj:2: bad index: \"1.5\" does not start with a vertex number",
            ),
            ("v 0 0 0\nf 1 1/2", "a.obj:2: fewer than three corners: found 2"),
            ("v 0 \\\n0", "a.obj:1: fewer than three coordinates: found 2"),
            ("v 0 1,5 0", "a.obj:1: \"1,5\" is not a number"),
            ("v 0 0 -inf", "a.obj:1: coordinate \"-inf\" is not finite in 32-bit floats"),
            ("v 0 0 0", "a.obj: no faces: an OBJ file lists them on lines that start with f"),
        ] {
            let error = Mesh::parse(file.as_bytes(), "a.obj").unwrap_err();
            assert_eq!(error.to_string(), message);
        }
    }
}
