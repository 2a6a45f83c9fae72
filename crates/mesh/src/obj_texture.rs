//! The texture of an OBJ file: its coordinates, and the pictures and colours of its materials.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
};

use crate::{
    Fault, Material, Texture,
    corner::absolute,
    error::{FARTHEST, Trouble, shown},
    material::to_linear,
    pictures::Pictures,
    referenced::{picture, read, referenced_path},
    statements::{Statement, count, number, statements},
    texture::is_near,
};

/// Limit of material libraries of a file, and of words in their names.
const MOST_LIBRARIES: usize = 100;

/// The texture of a file, from the statements read so far.
#[derive(Default)]
pub(crate) struct Found {
    coordinates: Vec<[f64; 2]>,
    /// A coordinate for each corner of each face, in the order of the file; [`NOWHERE`] for those without one.
    corners: Vec<u32>,
    /// The texts after `mtllib`, without duplicates.
    libraries: Vec<String>,
    /// The materials of faces, in the order of first use; faces before the first `usemtl` have "".
    materials: Vec<Used>,
    /// Number of each material.
    numbers: HashMap<String, u32>,
    /// First corner of each run of faces with one material, and its material.
    runs: Vec<(u32, u32)>,
    /// The material of the next faces, until a face uses it.
    material: Option<String>,
    /// The line of the first corner with a coordinate.
    with: Option<usize>,
}

/// A material used by faces.
struct Used {
    name: String,
    /// The line of its first corner without a coordinate.
    without: Option<usize>,
}

/// Coordinate number of a corner without one.
const NOWHERE: u32 = u32::MAX;

/// The texture in `bytes`, a file in `folder` whose vertices and faces are valid; reasons to omit it, its picture or a library are added to
/// `warnings`. `found` are its statements unless one is wrong, `cut` the corners of the triangles, where all corners of the file are
/// numbered in order. Vertex colours take precedence over those of materials.
pub(crate) fn parse(
    found: Option<Found>,
    bytes: &[u8],
    folder: &Path,
    cut: &[[u32; 3]],
    has_colours: bool,
    warnings: &mut Vec<Trouble>,
) -> Option<Texture> {
    let of = || {
        let found = found.filter(Found::is_in_range).map_or_else(|| Found::of(bytes), Ok)?;
        let (mut looks, of_materials) = looks(&found, folder, warnings);
        if has_colours {
            looks.iter_mut().for_each(|look| look.colour = None);
        }
        if !found.is_on_faces(&looks, &of_materials)? {
            return Ok(None);
        }
        let mut pictures = Pictures::default();
        let materials = looks.into_iter().map(|look| {
            let colour = look.colour.filter(|_| look.picture.is_none()).unwrap_or([1.0; 3]);
            let shown = look.picture.and_then(|(folder, name)| {
                let read = || picture(&folder, &name).map_err(Trouble::OtherFile);
                pictures.get((folder.clone(), name.clone()), read, warnings)
            });
            Material::of(shown, colour)
        });
        let materials = materials.collect();
        found.texture(cut, &of_materials, materials).map(Some)
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

    /// The texture statements in `bytes`, or the first that is wrong.
    fn of(bytes: &[u8]) -> Result<Self, Trouble> {
        let (mut found, all) = (Self::new(), count(bytes, "vt"));
        statements(bytes).try_for_each(|statement| found.add(&statement, all))?;
        Ok(found)
    }

    /// Adds `statement`, in a file of at most `all` coordinates.
    pub(crate) fn add(&mut self, statement: &Statement, all: usize) -> Result<(), Trouble> {
        let line = statement.line;
        let at = |reason| Trouble::Line(line, reason);
        let mut words = statement.words();
        match words.next() {
            Some("vt") => self.coordinates.push(coordinate(words).map_err(at)?),
            Some("f") => {
                if let Some(name) = self.material.take() {
                    let number = self.number(name);
                    self.runs.push((self.corners.len() as u32, number));
                }
                for corner in words {
                    let field = corner.split('/').nth(1).filter(|field| !field.is_empty());
                    let number = match field {
                        Some(field) => {
                            self.with.get_or_insert(line);
                            index(field, self.coordinates.len(), all).map_err(at)?
                        }
                        None => {
                            let (_, material) = self.runs[self.runs.len() - 1];
                            self.materials[material as usize].without.get_or_insert(line);
                            NOWHERE
                        }
                    };
                    self.corners.push(number);
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

    /// The number of a material of a face.
    fn number(&mut self, name: String) -> u32 {
        let next = self.materials.len() as u32;
        let number = *self.numbers.entry(name.clone()).or_insert(next);
        if number == next {
            self.materials.push(Used { name, without: None });
        }
        number
    }

    /// Whether all coordinates of corners exist: they may come after the face.
    fn is_in_range(&self) -> bool {
        let is_there =
            |&number: &u32| number == NOWHERE || (number as usize) < self.coordinates.len();
        self.corners.iter().all(is_there)
    }

    /// Whether there is a texture: corners with coordinates, or materials with colours. An error if corners need a coordinate and have
    /// none.
    fn is_on_faces(&self, looks: &[Look], of_materials: &[u32]) -> Result<bool, Trouble> {
        let are_plain = looks.iter().all(|look| look.picture.is_none() && look.colour.is_none());
        for (Used { without, name }, &look) in self.materials.iter().zip(of_materials) {
            let Some(line) = *without else { continue };
            let reason = match (self.with, &looks[look as usize].picture) {
                (_, Some(_)) => format!(
                    "a corner has no texture coordinate, but its material {:?} shows a picture",
                    shown(name)
                ),
                // Only a picture that comes later uses the coordinates.
                (Some(with), None) if are_plain => format!(
                    "a corner has no texture coordinate, but one of line {with} has: all need one"
                ),
                _ => continue,
            };
            return Err(Trouble::Line(line, Fault::format(reason)));
        }
        Ok(self.with.is_some() || !are_plain)
    }

    /// The texture on triangles, whose corners are numbered as in the file.
    fn texture(
        mut self,
        cut: &[[u32; 3]],
        of_materials: &[u32],
        looks: Vec<Material>,
    ) -> Result<Texture, Trouble> {
        let nowhere = self.coordinates.len() as u32;
        if self.corners.contains(&NOWHERE) {
            self.coordinates.push([0.0; 2]);
        }
        let corners =
            cut.iter().map(|triangle| triangle.map(|k| self.corners[k as usize].min(nowhere)));
        let of_faces = cut.iter().map(|&[first, ..]| {
            let run = self.runs.partition_point(|&(begin, _)| begin <= first);
            of_materials[self.runs[run - 1].1 as usize]
        });
        let of_faces = of_faces.collect();
        let corners = corners.collect();
        Texture::new(self.coordinates, corners)
            .and_then(|texture| texture.with_materials(looks, of_faces))
            .map_err(Trouble::OtherFile)
    }
}

/// The text after the keyword: names of files and materials may contain spaces.
fn rest(statement: &Statement) -> String {
    statement.words().skip(1).collect::<Vec<_>>().join(" ")
}

/// (u, v); v is 0 if omitted, a third number is ignored.
fn coordinate<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<[f64; 2], Fault> {
    let read = |word: &str| {
        let x = number(word)?;
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

/// The coordinate, from 0, of the second field of a corner.
fn index(field: &str, before: usize, all: usize) -> Result<u32, Fault> {
    let number = absolute(field, before, all).ok();
    let number = number.and_then(|number| u32::try_from(number - 1).ok());
    number.filter(|&number| number != NOWHERE).ok_or_else(|| {
        let field = shown(field);
        Fault::format(format!(
            "texture coordinate {field} is out of range: the file has {all}, {before} of them before it"
        ))
    })
}

/// Adds an entry unless the list contains it.
fn add<T: PartialEq>(list: &mut Vec<T>, entry: T) {
    if !list.contains(&entry) {
        list.push(entry);
    }
}

/// The names of the libraries in the text after `mtllib`: one name, or several that end in `.mtl`, all of which may contain spaces.
fn names(folder: &Path, text: &str) -> Vec<String> {
    let exists = |name: &str| referenced_path(folder, name).is_file();
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

/// The appearance of a material.
#[derive(Clone, Default)]
struct Look {
    /// Folder and name of its picture.
    picture: Option<(PathBuf, String)>,
    /// Its colour, used without a picture; linear in light.
    colour: Option<[f64; 3]>,
}

impl Look {
    /// This look without a picture with options, for a material of this name.
    fn without_options(mut self, name: &str, warnings: &mut Vec<Trouble>) -> Self {
        if let Some((_, options)) = self.picture.take_if(|(_, name)| name.starts_with('-')) {
            let (options, name) = (shown(&options), shown(name));
            let reason = format!("map_Kd of {name:?} has options, which are not read: {options}");
            warnings.push(Trouble::part("materials", reason));
        }
        self
    }
}

/// The distinct looks of the materials of faces, as far as they are known, and the look of each material; errors are added to `warnings`.
fn looks(found: &Found, folder: &Path, warnings: &mut Vec<Trouble>) -> (Vec<Look>, Vec<u32>) {
    let mut paths = Vec::new();
    for name in found.libraries.iter().flat_map(|text| names(folder, text)) {
        if paths.len() <= MOST_LIBRARIES {
            add(&mut paths, referenced_path(folder, &name));
        }
    }
    if paths.len() > MOST_LIBRARIES {
        let reason = format!("more than {MOST_LIBRARIES} libraries: the others are not read");
        warnings.push(Trouble::part("materials", reason));
    }
    // The first library with a material takes precedence.
    let mut known = HashMap::new();
    for path in paths.iter().take(MOST_LIBRARIES) {
        match read(path) {
            Ok(content) => {
                for (name, look) in library(&content, path.parent().unwrap_or(folder)) {
                    known.entry(name).or_insert(look);
                }
            }
            Err(error) => warnings.push(Trouble::OtherFile(error)),
        }
    }
    let (mut looks, mut numbers) = (Vec::new(), HashMap::new());
    let mut number = |used: &Used| {
        let look = known.get(&used.name).cloned().unwrap_or_default();
        // Ignored if there is a picture.
        let colour = look.colour.filter(|_| look.picture.is_none());
        let bits = colour.map(|colour| colour.map(f64::to_bits));
        *numbers.entry((look.picture.clone(), bits)).or_insert_with(|| {
            looks.push(look.without_options(&used.name, warnings));
            (looks.len() - 1) as u32
        })
    };
    let of_materials = found.materials.iter().map(&mut number).collect();
    (looks, of_materials)
}

/// The materials of a library in `folder`, in its order.
fn library(content: &[u8], folder: &Path) -> Vec<(String, Look)> {
    let mut materials = vec![(String::new(), Look::default())];
    for statement in statements(content) {
        let (_, look) = materials.last_mut().expect("there is one");
        let mut words = statement.words();
        match words.next() {
            Some("newmtl") => materials.push((rest(&statement), Look::default())),
            Some("Kd") => {
                let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
                let colour = match numbers[..] {
                    [grey] => Some([grey; 3]),
                    [red, green, blue] => Some([red, green, blue]),
                    _ => None,
                };
                let colour = colour.filter(|all| all.iter().all(|x| (0.0..=1.0).contains(x)));
                look.colour = colour.map(|all| all.map(to_linear));
            }
            Some(word) if word.eq_ignore_ascii_case("map_Kd") => {
                look.picture = Some((folder.to_owned(), rest(&statement)));
            }
            _ => {}
        }
    }
    materials
}
