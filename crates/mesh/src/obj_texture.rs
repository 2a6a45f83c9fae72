//! The texture of an OBJ file: its coordinates, and the picture that its materials name.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use crate::{
    Fault, Texture,
    beside::{beside, picture, read},
    corner::absolute,
    error::{FARTHEST, Trouble, shown},
    statements::{Statement, count, statements},
    texture::is_near,
};

/// Libraries of materials that a file may name, and words of their names.
const MOST_LIBRARIES: usize = 100;

/// The texture of a file, as the statements read so far have it.
#[derive(Default)]
pub(crate) struct Found {
    coordinates: Vec<[f64; 2]>,
    /// Of each corner of each face, in the order of the file.
    corners: Vec<u32>,
    /// The texts after `mtllib`, each once.
    libraries: Vec<String>,
    /// The materials of faces; that of faces without one is "".
    materials: BTreeSet<String>,
    /// The material of the next faces, until one has it.
    material: Option<String>,
    /// Lines of the first corner that has a coordinate, and of the first that has none.
    with: Option<usize>,
    without: Option<usize>,
}

/// The texture in `bytes`, a file in `folder` whose vertices and faces are sound; `warnings` gets why it, its picture or a library was left
/// out. `found` is what its statements have unless one is wrong, `cut` the corners of the triangles, all corners of the file being numbered
/// in order.
pub(crate) fn parse(
    found: Option<Found>,
    bytes: &[u8],
    folder: &Path,
    cut: &[[u32; 3]],
    warnings: &mut Vec<Trouble>,
) -> Option<Texture> {
    let of = || {
        let found = found.filter(Found::is_in_range).map_or_else(|| Found::of(bytes), Ok)?;
        if !found.is_on_faces()? {
            return Ok(None);
        }
        let corners = cut.iter().map(|triangle| triangle.map(|k| found.corners[k as usize]));
        let corners = corners.collect();
        let shown = of_materials(&found, folder, warnings);
        let texture = Texture::new(found.coordinates, corners).map_err(Trouble::OtherFile)?;
        Ok(Some(texture.pictured(shown, warnings)))
    };
    of().unwrap_or_else(|trouble| {
        warnings.push(trouble);
        None
    })
}

impl Found {
    pub(crate) fn new() -> Self {
        Self { material: Some(String::new()), ..Self::default() }
    }

    /// Everything that `bytes` holds, or the first statement that is wrong.
    fn of(bytes: &[u8]) -> Result<Self, Trouble> {
        let (mut found, all) = (Self::new(), count(bytes, "vt"));
        statements(bytes).try_for_each(|statement| found.add(&statement, all))?;
        Ok(found)
    }

    /// Adds what `statement` has, in a file of at most `all` coordinates.
    pub(crate) fn add(&mut self, statement: &Statement, all: usize) -> Result<(), Trouble> {
        let line = statement.line;
        let at = |reason| Trouble::Line(line, reason);
        let mut words = statement.words();
        match words.next() {
            Some("vt") => self.coordinates.push(coordinate(words).map_err(at)?),
            Some("f") => {
                self.materials.extend(self.material.take());
                for corner in words {
                    let field = corner.split('/').nth(1).filter(|field| !field.is_empty());
                    let first = if field.is_some() { &mut self.with } else { &mut self.without };
                    first.get_or_insert(line);
                    if let Some(field) = field {
                        let number = index(field, self.coordinates.len(), all).map_err(at)?;
                        self.corners.push(number);
                    }
                }
            }
            Some("mtllib") if self.libraries.len() <= MOST_LIBRARIES => {
                add(&mut self.libraries, rest(statement));
            }
            Some("usemtl") => self.material = Some(rest(statement)),
            _ => {}
        }
        Ok(())
    }

    /// Whether there is each coordinate that a corner has: it may come after the face.
    fn is_in_range(&self) -> bool {
        self.corners.iter().all(|&number| (number as usize) < self.coordinates.len())
    }

    /// Whether corners have coordinates; an error if only some have.
    fn is_on_faces(&self) -> Result<bool, Trouble> {
        if let (Some(with), Some(line)) = (self.with, self.without) {
            let reason = format!(
                "a corner has no texture coordinate, but one of line {with} has: all need one"
            );
            return Err(Trouble::Line(line, Fault::format(reason)));
        }
        Ok(self.with.is_some())
    }
}

/// The text after the keyword: names of files and materials may hold spaces.
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

/// Adds what is not there yet.
fn add<T: PartialEq>(list: &mut Vec<T>, entry: T) {
    if !list.contains(&entry) {
        list.push(entry);
    }
}

/// The names of the libraries in the text after `mtllib`: one name, or several that end in `.mtl`, all of which may hold spaces.
fn names(folder: &Path, text: &str) -> Vec<String> {
    let exists = |name: &str| beside(folder, name).is_file();
    let words: Vec<&str> = text.split(' ').take(MOST_LIBRARIES + 1).collect();
    if words.len() == 1 || exists(text) {
        return vec![text.to_owned()];
    }
    let is_last = |word: &&str| word.to_ascii_lowercase().ends_with(".mtl");
    let mut names = Vec::new();
    for group in words.split_inclusive(is_last) {
        let name = group.join(" ");
        if !exists(&name) && group.iter().any(|word| exists(word)) {
            names.extend(group.iter().map(|&word| word.to_owned()));
        } else {
            names.push(name);
        }
    }
    names
}

/// The picture that all faces show by their materials, if they show one; `warnings` gets the libraries that cannot be read.
fn of_materials(
    found: &Found,
    folder: &Path,
    warnings: &mut Vec<Trouble>,
) -> Result<Option<Vec<u8>>, Trouble> {
    let mut paths = Vec::new();
    for name in found.libraries.iter().flat_map(|text| names(folder, text)) {
        if paths.len() <= MOST_LIBRARIES {
            add(&mut paths, beside(folder, &name));
        }
    }
    if paths.len() > MOST_LIBRARIES {
        let reason = format!("more than {MOST_LIBRARIES} libraries: the others are not read");
        warnings.push(Trouble::part("materials", reason));
    }
    // Folder and name of the picture of each material that has one; the first library that has a material counts.
    let mut pictures = BTreeMap::new();
    for path in paths.iter().take(MOST_LIBRARIES) {
        let content = match read(path) {
            Ok(content) => content,
            Err(error) => {
                warnings.push(Trouble::OtherFile(error));
                continue;
            }
        };
        let folder = path.parent().unwrap_or(folder);
        let mut keep = |material: &mut String, picture: &mut Option<String>| {
            let material = std::mem::take(material);
            if let Some(picture) = picture.take() {
                pictures.entry(material).or_insert((folder, picture));
            }
        };
        let (mut material, mut picture) = (String::new(), None);
        for statement in statements(&content) {
            match statement.words().next() {
                Some("newmtl") => {
                    keep(&mut material, &mut picture);
                    material = rest(&statement);
                }
                Some(word) if word.eq_ignore_ascii_case("map_Kd") => {
                    picture = Some(rest(&statement));
                }
                _ => {}
            }
        }
        keep(&mut material, &mut picture);
    }
    let mut of_faces = BTreeMap::new();
    for material in &found.materials {
        of_faces.entry(pictures.get(material)).or_insert(material);
    }
    let wrong = |reason: String| Err(Trouble::part("materials", reason));
    match of_faces.iter().collect::<Vec<_>>()[..] {
        [] | [(None, _)] => Ok(None),
        [(Some((_, name)), material)] if name.starts_with('-') => {
            let (name, material) = (shown(name), shown(material));
            wrong(format!("map_Kd of {material:?} has options, which are not read: {name}"))
        }
        [(Some((folder, name)), _)] => picture(folder, name).map(Some).map_err(Trouble::OtherFile),
        [(a, one), (b, other), ..] => {
            let [a, b] = [a, b].map(|picture| match picture {
                Some((_, name)) => shown(name),
                None => "no picture".to_owned(),
            });
            let [one, other] = [one, other].map(|material| shown(material));
            wrong(format!(
                "faces of {other:?} show {b}, but those of {one:?} {a}: a mesh has one picture, so join them into one"
            ))
        }
    }
}
