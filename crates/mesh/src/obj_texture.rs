//! The texture of an OBJ file: its coordinates, and the picture that its materials name.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

use crate::{
    Fault, Texture,
    beside::{beside, picture, read},
    clean::absolute,
    error::{Trouble, shown},
    statements::{Statement, statements},
    texture::{FARTHEST, is_near},
};

/// What the statements of a file say of its texture.
#[derive(Default)]
struct Found {
    coordinates: Vec<[f64; 2]>,
    /// Of each corner of each face, in the order of the file.
    corners: Vec<u32>,
    libraries: Vec<String>,
    /// The materials of faces; that of faces without one is "".
    materials: BTreeSet<String>,
}

/// The texture in `bytes`, a file in `folder` whose vertices and faces are sound, and why it or its picture was left out. `cut` says which
/// corners of the file the triangles have, all numbered in order.
pub(crate) fn parse(
    bytes: &[u8],
    folder: &Path,
    cut: &[[usize; 3]],
) -> (Option<Texture>, Option<Trouble>) {
    let of = || {
        let Some(found) = found(bytes)? else { return Ok((None, None)) };
        let corners = cut.iter().map(|triangle| triangle.map(|k| found.corners[k])).collect();
        let shown = of_materials(&found, folder);
        let texture = Texture::new(found.coordinates, corners).map_err(Trouble::OtherFile)?;
        Ok(texture.pictured(shown))
    };
    of().unwrap_or_else(|trouble| (None, Some(trouble)))
}

/// Coordinates and materials; none if no corner of a face has a coordinate.
fn found(bytes: &[u8]) -> Result<Option<Found>, Trouble> {
    let all = statements(bytes).filter(|s| s.words().next() == Some("vt")).count();
    let mut found = Found::default();
    // Lines of the first corner that has a coordinate, and of the first that has none.
    let (mut with, mut without) = (None, None);
    let mut material = String::new();
    for statement in statements(bytes) {
        let line = statement.line;
        let at = |reason| Trouble::Line(line, reason);
        let mut words = statement.words();
        match words.next() {
            Some("vt") => found.coordinates.push(coordinate(words).map_err(at)?),
            Some("f") => {
                found.materials.insert(material.clone());
                for corner in words {
                    let field = corner.split('/').nth(1).filter(|field| !field.is_empty());
                    let first = if field.is_some() { &mut with } else { &mut without };
                    first.get_or_insert(line);
                    if let Some(field) = field {
                        let number = index(field, found.coordinates.len(), all).map_err(at)?;
                        found.corners.push(number);
                    }
                }
            }
            Some("mtllib") => found.libraries.push(rest(&statement)),
            Some("usemtl") => material = rest(&statement),
            _ => {}
        }
    }
    match (with, without) {
        (None, _) => Ok(None),
        (Some(_), None) => Ok(Some(found)),
        (Some(with), Some(line)) => {
            let reason = format!(
                "a corner has no texture coordinate, but one of line {with} has: all need one"
            );
            Err(Trouble::Line(line, Fault::format(reason)))
        }
    }
}

/// What follows the keyword: names of files and materials may hold spaces.
fn rest(statement: &Statement) -> String {
    statement.words().skip(1).collect::<Vec<_>>().join(" ")
}

/// (u, v); a second number that is left out is 0, a third is of no use to a picture.
fn coordinate<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<[f64; 2], Fault> {
    let read = |word: &str| {
        let x: f64 = word.parse().map_err(|_| Fault::Number(shown(word)))?;
        if is_near(&x) {
            return Ok(x);
        }
        let word = shown(word);
        Err(Fault::format(format!(
            "texture coordinate {word} is not from -{FARTHEST} to {FARTHEST}"
        )))
    };
    let u = words.next().ok_or_else(|| Fault::format("a texture coordinate without a number"))?;
    Ok([read(u)?, words.next().map_or(Ok(0.0), read)?])
}

/// The coordinate, from 0, that the second field of a corner means.
fn index(field: &str, before: usize, all: usize) -> Result<u32, Fault> {
    let number = absolute(field, before, all).ok();
    number.and_then(|number| u32::try_from(number - 1).ok()).ok_or_else(|| {
        let field = shown(field);
        Fault::format(format!(
            "texture coordinate {field} is out of range: the file has {all}, {before} of them before it"
        ))
    })
}

/// The picture that all faces show by their materials, if they show one.
fn of_materials(found: &Found, folder: &Path) -> Result<Option<Vec<u8>>, Trouble> {
    let mut pictures = BTreeMap::new();
    for library in &found.libraries {
        let path = beside(folder, library);
        let content = read(&path).map_err(Trouble::OtherFile)?;
        let mut material = String::new();
        for statement in statements(&content) {
            match statement.words().next() {
                Some("newmtl") => material = rest(&statement),
                Some(word) if word.eq_ignore_ascii_case("map_Kd") => {
                    pictures.insert(material.clone(), (path.clone(), rest(&statement)));
                }
                _ => {}
            }
        }
    }
    let mut shown: BTreeMap<Option<&(PathBuf, String)>, &String> = BTreeMap::new();
    for material in &found.materials {
        shown.entry(pictures.get(material)).or_insert(material);
    }
    let wrong = |reason: String| Err(Trouble::part("materials", reason));
    match shown.iter().collect::<Vec<_>>()[..] {
        [] | [(None, _)] => Ok(None),
        [(Some((_, name)), material)] if name.starts_with('-') => {
            wrong(format!("map_Kd of {material:?} has options, which are not read: {name}"))
        }
        [(Some((library, name)), _)] => {
            let folder = library.parent().unwrap_or(folder);
            picture(folder, name).map(Some).map_err(Trouble::OtherFile)
        }
        [(a, one), (b, other), ..] => {
            let [a, b] = [a, b].map(|picture| match picture {
                Some((_, name)) => name.as_str(),
                None => "no picture",
            });
            wrong(format!(
                "faces of {other:?} show {b}, but those of {one:?} {a}: a mesh has one picture, so join them into one"
            ))
        }
    }
}
