//! What an OBJ file says, checked line by line.

use crate::{LineError, MeshError, mesh::fits_f32, statements::statements};

/// The vertices and polygons of an OBJ file, sound and in its order.
pub(crate) struct Content {
    pub(crate) positions: Vec<[f64; 3]>,
    /// Three or more indices each, counted from 0 and in range.
    pub(crate) polygons: Vec<Vec<u32>>,
}

/// The content of `bytes`, or the first fault in the order of the file.
///
/// Only `v` and `f` matter, in lower case; of a vertex only the first three numbers, of a corner
/// only the field before the first slash. Other statements are skipped, so no material is opened.
pub(crate) fn content(bytes: &[u8], name: &str) -> Result<Content, MeshError> {
    // A face may come before its vertices, so their number must be known first.
    let vertices = statements(bytes).filter(|s| s.words().next() == Some("v")).count();
    let mut content = Content { positions: Vec::with_capacity(vertices), polygons: Vec::new() };
    let Content { positions, polygons } = &mut content;
    for statement in statements(bytes) {
        let mut words = statement.words();
        let checked = match words.next() {
            Some("v") => vertex(words).map(|position| positions.push(position)),
            Some("f") => {
                polygon(words, positions.len(), vertices).map(|polygon| polygons.push(polygon))
            }
            _ => Ok(()),
        };
        let line = statement.line;
        checked.map_err(|reason| MeshError::Line { name: name.to_owned(), line, reason })?;
    }
    match polygons.is_empty() {
        true => Err(MeshError::NoFaces { name: name.to_owned() }),
        false => Ok(content),
    }
}

/// The three coordinates of a vertex.
fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Result<[f64; 3], LineError> {
    let mut found = Vec::with_capacity(3);
    for word in words.take(3) {
        let x: f64 = word.parse().map_err(|_| LineError::Number(shown(word)))?;
        if !fits_f32(x) {
            return Err(LineError::NotFinite(shown(word)));
        }
        found.push(x);
    }
    found.try_into().map_err(|found: Vec<f64>| LineError::Coordinates(found.len()))
}

/// The vertices of a polygon, counted from 0.
fn polygon<'a>(
    words: impl Iterator<Item = &'a str>,
    vertices_read: usize,
    vertices: usize,
) -> Result<Vec<u32>, LineError> {
    let corners = words.map(|word| corner(word, vertices_read, vertices));
    let corners = corners.collect::<Result<Vec<_>, _>>()?;
    if corners.len() < 3 { Err(LineError::Corners(corners.len())) } else { Ok(corners) }
}

/// The vertex, counted from 0, that a corner such as `7`, `7/1/2`, `7//2` or `-1` means.
fn corner(corner: &str, vertices_read: usize, vertices: usize) -> Result<u32, LineError> {
    let field = corner.split('/').next().unwrap_or(corner);
    let index = || shown(field);
    let (back, digits) = match field.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, field.strip_prefix('+').unwrap_or(field)),
    };
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(LineError::Index(shown(corner)));
    }
    // A number too long for u32 is out of range as well.
    let number = digits.parse::<u32>().unwrap_or(u32::MAX);
    match (back, number) {
        (true, 1..) if number as usize <= vertices_read => Ok(vertices_read as u32 - number),
        (true, 1..) => Err(LineError::TooFarBack { index: index(), before: vertices_read }),
        (false, 1..) if number as usize <= vertices => Ok(number - 1),
        _ => Err(LineError::OutOfRange { index: index(), vertices }),
    }
}

/// A word as an error message shows it: not longer than a line can bear.
fn shown(word: &str) -> String {
    const LONGEST: usize = 40;
    match word.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &word[..end]),
        None => word.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_positions_and_absolute_indices_remain() {
        let file = b"o a\nv 1e0 .5 -2 0.1 0.2 0.3\nf 2/9/9 +3// -1\nv 0 0 0 1\nmtllib /dev/zero\n\
            v 1 1 1\nl 1 2\nf -3 -2 -1";
        let Content { positions, polygons } = content(file, "a.obj").unwrap();
        assert_eq!(positions, [[1.0, 0.5, -2.0], [0.0; 3], [1.0; 3]]);
        assert_eq!(polygons, [[1, 2, 0], [0, 1, 2]]);
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
            let error = content(file.as_bytes(), "a.obj").map(|c| c.polygons).unwrap_err();
            assert_eq!(error.to_string(), message);
        }
    }
}
