//! Checks an OBJ file line by line, and keeps what a plain parser needs.

use crate::{
    Fault,
    error::{Trouble, channel, shown},
    mesh::fits_f32,
    statements::statements,
};

/// Text of an OBJ file that holds nothing but sound vertices and faces.
///
/// `text` has one `v x y z` line for each vertex, in the order of the file, and one `f` line for
/// each polygon: three or more absolute indices, counted from 1 and in range.
pub(crate) struct Clean {
    pub(crate) text: String,
    pub(crate) vertices: usize,
    /// In the order of the vertices, if each has one.
    pub(crate) colours: Option<Vec<[f64; 3]>>,
}

/// The clean form of `bytes`, or the first fault in the order of the file.
///
/// Only `v` and `f` matter, in lower case; of a vertex only the first three numbers and, where there are six, the
/// other three as a colour; of a corner only the field before the first slash. Other statements are skipped, so no
/// material is opened.
pub(crate) fn clean(bytes: &[u8]) -> Result<Clean, Trouble> {
    // A face may come before its vertices, so their number must be known first.
    let vertices = statements(bytes).filter(|s| s.words().next() == Some("v")).count();
    let (mut text, mut vertices_read, mut faces) = (String::new(), 0, 0);
    let mut colours = Vec::new();
    for statement in statements(bytes) {
        let mut words = statement.words();
        let checked = match words.next() {
            Some("v") => {
                vertices_read += 1;
                vertex(words, &mut text).map(|colour| colours.extend(colour))
            }
            Some("f") => {
                faces += 1;
                face(words, vertices_read, vertices, &mut text)
            }
            _ => Ok(()),
        };
        let line = statement.line;
        checked.map_err(|reason| Trouble::Line(line, reason))?;
    }
    if faces == 0 {
        return Err(Trouble::NoFaces("an OBJ file lists them on lines that start with f"));
    }
    let colours = (colours.len() == vertices).then_some(colours);
    Ok(Clean { text, vertices, colours })
}

/// Copies three coordinates to `text`; the colour after them, if there is one.
fn vertex<'a>(
    mut words: impl Iterator<Item = &'a str>,
    text: &mut String,
) -> Result<Option<[f64; 3]>, Fault> {
    text.push('v');
    let mut found = 0;
    for word in words.by_ref().take(3) {
        let x: f64 = word.parse().map_err(|_| Fault::Number(shown(word)))?;
        if !fits_f32(x) {
            return Err(Fault::NotFinite(shown(word)));
        }
        text.extend([" ", word]);
        found += 1;
    }
    text.push('\n');
    if found < 3 {
        return Err(Fault::Coordinates(found));
    }
    // One further number is a weight. What else follows is not of the format, and no colour.
    let further: Vec<&str> = words.take(4).collect();
    let &[red, green, blue] = further.as_slice() else { return Ok(None) };
    let read = |word: &str| channel(word.parse().map_err(|_| Fault::Number(shown(word)))?, 1);
    Ok(Some([read(red)?, read(green)?, read(blue)?]))
}

/// Writes the absolute indices of one polygon to `text`.
fn face<'a>(
    words: impl Iterator<Item = &'a str>,
    vertices_read: usize,
    vertices: usize,
    text: &mut String,
) -> Result<(), Fault> {
    text.push('f');
    let mut found = 0;
    for word in words {
        let index = absolute(word, vertices_read, vertices)?;
        text.extend([" ", &index.to_string()]);
        found += 1;
    }
    text.push('\n');
    if found >= 3 { Ok(()) } else { Err(Fault::Corners(found)) }
}

/// The vertex, counted from 1, that a corner such as `7`, `7/1/2`, `7//2` or `-1` means.
pub(crate) fn absolute(
    corner: &str,
    vertices_read: usize,
    vertices: usize,
) -> Result<usize, Fault> {
    let field = corner.split('/').next().unwrap_or(corner);
    let index = || shown(field);
    let (back, digits) = match field.strip_prefix('-') {
        Some(digits) => (true, digits),
        None => (false, field.strip_prefix('+').unwrap_or(field)),
    };
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(Fault::Index(shown(corner)));
    }
    // A number too long for usize is out of range as well.
    let number = digits.parse().unwrap_or(usize::MAX);
    match (back, number) {
        (true, 1..) if number <= vertices_read => Ok(vertices_read - number + 1),
        (true, 1..) => Err(Fault::TooFarBack { index: index(), before: vertices_read }),
        (false, 1..) if number <= vertices => Ok(number),
        _ => Err(Fault::OutOfRange { index: index(), vertices }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_positions_and_absolute_indices_remain() {
        let file = b"o a\nv 1e0 .5 -2 .1 0.2 0.3\nf 2/9/9 +3// -1\nv 0 0 0 1\nmtllib /dev/zero\n\
            v 1 1 1\nl 1 2\nf -3 -2 -1";
        let Ok(found) = clean(file) else { panic!("a sound file") };
        assert_eq!(found.text, "v 1e0 .5 -2\nf 2 3 1\nv 0 0 0\nv 1 1 1\nf 1 2 3\n");
        assert_eq!(found.vertices, 3);
        assert_eq!(found.colours, None, "not every vertex has one");
        let Ok(found) = clean(b"v 0 0 0 0 .5 1\nf 1 1 1") else { panic!("a sound file") };
        assert_eq!(found.colours, Some(vec![[0.0, 0.5, 1.0]]));
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
            ("v 0 0 0 0 0 255", "a.obj:1: colour \"255\" is not from 0 to 1"),
            ("v 0 0 0 0 nan 0", "a.obj:1: colour \"NaN\" is not from 0 to 1"),
            ("v 0 0 0 0 red 0", "a.obj:1: \"red\" is not a number"),
            ("v 0 0 -inf", "a.obj:1: coordinate \"-inf\" is not finite in 32-bit floats"),
            ("v 0 0 0", "a.obj: no faces: an OBJ file lists them on lines that start with f"),
        ] {
            let trouble = clean(file.as_bytes()).err().unwrap();
            assert_eq!(trouble.of_file("a.obj").to_string(), message);
        }
    }
}
