//! Reads OBJ files with `tobj`, and writes them.
//!
//! `tobj` pulls the file through [`Lines`], one statement at a time, so each number is parsed once and the text is never copied as a whole.
//! A line for `tobj` contains only the coordinates or the vertices of a statement: it refuses or misreads much that programs write after
//! them. The same pass collects colours and the texture, whose errors are warnings with a line number.
//!
//! An error of `tobj` names neither line nor word, and a face may come before its vertices. A refused file is therefore scanned again, by
//! [`fault`], for the first wrong statement.

use std::{
    collections::VecDeque,
    fmt,
    io::{self, BufReader, Read},
    path::Path,
};

use crate::{
    Fault, Mesh, Texture,
    colours::{Beyond, Colours},
    corner::{absolute, first_field},
    error::{Place, Trouble, shown},
    mesh::fits_f32,
    obj_texture::{self, Found},
    parts::Parts,
    polygon::Polygons,
    statements::{count, number, statements},
};

/// The mesh in `bytes`; see [`Mesh::parse`]. With the `folder` of the file also its texture.
///
/// The mesh is read from `v` and `f` only, in lower case: the first three numbers of a vertex and, if there are six, the other three as a
/// colour; the field of a corner before the first slash.
pub(crate) fn parse(bytes: &[u8], folder: Option<&Path>) -> Result<Parts, Trouble> {
    let (mut vertices, mut colours) = (0, Colours::new([1.0; 3], Beyond::LeftOut));
    let mut texture = folder.map(|_| Found::new());
    let lines = statements(bytes).map(Some).chain([None]).map(|statement| {
        // tobj numbers vertices by first use in faces. A final polygon of all vertices reveals the mapping, and keeps unused ones.
        let Some(statement) = statement else {
            return line("f", (1..=vertices).map(|vertex| vertex.to_string()));
        };
        if texture.as_mut().is_some_and(|found| found.add(&statement, usize::MAX).is_err()) {
            texture = None;
        }
        let mut words = statement.words();
        match words.next() {
            Some("v") => {
                vertices += 1;
                let line = line("v", words.by_ref().take(3));
                if let Some(channels) = colour(words) {
                    colours.push(channels, || Place::Line(statement.line));
                }
                line
            }
            Some("f") => line("f", words.map(first_field)),
            _ => String::new(),
        }
    });
    let (positions, polygons) = parsed(lines).ok_or_else(|| {
        let too_long = || Trouble::part("faces", "more corners than 32 bits can number");
        fault(bytes).unwrap_or_else(too_long)
    })?;
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
    let is_coloured = colours.is_some();
    let texture = folder.and_then(|folder| {
        obj_texture::parse(texture, bytes, folder, &cut, is_coloured, &mut warnings)
    });
    Ok(Parts { positions, faces, colours, texture, warnings })
}

/// A line for `tobj`, which splits words at any white space and not only at spaces and tabs: a word that is not plain ASCII is not a
/// number, and is replaced by another word that is not.
fn line(keyword: &str, words: impl Iterator<Item = impl AsRef<str>>) -> String {
    let mut line = keyword.to_owned();
    for word in words {
        let word = word.as_ref();
        let is_plain = !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_graphic());
        line.extend([" ", if is_plain { word } else { "?" }]);
    }
    line.push('\n');
    line
}

/// Lines as the content of a file, each created when it is read.
struct Lines<I> {
    lines: I,
    unread: VecDeque<u8>,
}

impl<I: Iterator<Item = String>> Read for Lines<I> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.unread.is_empty()
            && let Some(line) = self.lines.next()
        {
            self.unread = line.into_bytes().into();
        }
        self.unread.read(buffer)
    }
}

/// Vertices and polygons of lines, the last of which is a polygon of all vertices; `None` if a line is wrong or there are too many.
fn parsed(lines: impl Iterator<Item = String>) -> Option<(Vec<[f64; 3]>, Polygons)> {
    let mut file = BufReader::new(Lines { lines, unread: VecDeque::new() });
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let options = tobj::LoadOptions::default();
    let (models, _) = tobj::load_obj_buf(&mut file, &options, no_materials).ok()?;
    let tobj::Mesh { positions, indices: mut corners, face_arities: mut arities, .. } =
        models.into_iter().next()?.mesh;
    u32::try_from(corners.len()).ok()?;
    if arities.is_empty() {
        // All are triangles.
        arities = vec![3; corners.len() / 3];
    }
    let vertices = arities.pop()? as usize;
    let order = corners.split_off(corners.len() - vertices);
    let mut numbers = vec![0; vertices];
    for (number, &index) in (0..).zip(&order) {
        numbers[index as usize] = number;
    }
    corners.iter_mut().for_each(|corner| *corner = numbers[*corner as usize]);
    let is_sound = positions.iter().all(|&x| fits_f32(x)) && arities.iter().all(|&n| n >= 3);
    let position = |&index: &u32| positions.as_chunks().0[index as usize];
    is_sound.then(|| (order.iter().map(position).collect(), Polygons { corners, arities }))
}

/// The first statement that prevents `bytes` from being a mesh.
fn fault(bytes: &[u8]) -> Option<Trouble> {
    let (vertices, mut before) = (count(bytes, "v"), 0);
    statements(bytes).find_map(|statement| {
        let mut words = statement.words();
        let checked = match words.next() {
            Some("v") => {
                before += 1;
                three(words.take(3).map(coordinate), Fault::Coordinates)
            }
            Some("f") => three(words.map(|word| absolute(word, before, vertices)), Fault::Corners),
            _ => Ok(()),
        };
        checked.err().map(|reason| Trouble::Line(statement.line, reason))
    })
}

/// Checks that there are three entries or more; else the first error, or `fewer`.
fn three<T>(
    found: impl Iterator<Item = Result<T, Fault>>,
    fewer: fn(usize) -> Fault,
) -> Result<(), Fault> {
    let found = found.collect::<Result<Vec<T>, Fault>>()?.len();
    if found >= 3 { Ok(()) } else { Err(fewer(found)) }
}

fn coordinate(word: &str) -> Result<f64, Fault> {
    let x = number(word)?;
    if fits_f32(x) { Ok(x) } else { Err(Fault::NotFinite(shown(word))) }
}

/// The colour after the coordinates of a vertex. A single further number is a weight, and lists of other lengths are not in the format.
fn colour<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<[f64; 3]> {
    let mut channel = || words.next().map(|word| word.parse().unwrap_or(f64::NAN));
    let channels = [channel()?, channel()?, channel()?];
    words.next().is_none().then_some(channels)
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
