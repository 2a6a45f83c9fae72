//! The texture of a GLB file: coordinates of its parts, and the pictures and factors of their materials.

use std::{
    collections::{HashMap, hash_map::Entry},
    path::Path,
};

use serde_json::Value;

use crate::{
    Material, Texture,
    error::{FARTHEST, Trouble, shown},
    glb_parts::{factor_of, picture_of},
    gltf::{Gltf, Primitive, entry, number},
    gltf_buffers::data,
    material::media_type,
    pictures::Pictures,
    referenced::{picture_at, referenced_uri},
    texture::is_near,
};

/// Limit of the coordinates of a file of at most this many bytes. Many small accessors may share the same bytes.
const MOST_COORDINATES: usize = 10_000_000;

/// A placed part of a mesh.
pub(crate) struct Part<'a> {
    pub(crate) primitive: &'a Primitive,
    /// Triangles between the part's own vertices.
    pub(crate) triangles: &'a [[u32; 3]],
    /// Number of its vertices.
    pub(crate) vertices: usize,
    /// The factor already included in the colours of its vertices.
    pub(crate) lit: [f64; 3],
}

/// The texture of the parts placed so far.
#[derive(Default)]
pub(crate) struct Unwrapped {
    most: usize,
    coordinates: Vec<[f64; 2]>,
    corners: Vec<[u32; 3]>,
    /// First coordinate of each accessor.
    firsts: HashMap<usize, usize>,
    /// Image and factor of each material, and its faces.
    materials: Vec<(Option<usize>, [f64; 3])>,
    /// Number of each material, by image and bits of the factor.
    numbers: HashMap<(Option<usize>, [u64; 3]), u32>,
    of_faces: Vec<u32>,
    /// The coordinate of corners without one.
    nowhere: Option<u32>,
    multiplies_colours: bool,
}

impl Unwrapped {
    /// An empty texture, for a file of `length` bytes.
    pub(crate) fn new(length: usize) -> Self {
        let most = MOST_COORDINATES.max(length).min(u32::MAX as usize);
        Self { most, ..Self::default() }
    }

    /// Adds the coordinates and the material of a part; `faces` is the total number of faces.
    pub(crate) fn add(&mut self, gltf: &Gltf, part: &Part, faces: usize) -> Result<(), Trouble> {
        let Part { primitive, triangles, .. } = part;
        if triangles.is_empty() {
            return Ok(());
        }
        let wrong = |reason: String| Err(Trouble::part("", reason));
        let material = entry(&gltf.materials, &primitive.material);
        let (image, set) = base_colour(gltf, material).map_err(|why| Trouble::part("", why))?;
        let attributes = &primitive.attributes;
        let accessor = match set {
            0 => number(&attributes.coordinates),
            1 => number(&attributes.more_coordinates),
            _ => return wrong(format!("its texture needs TEXCOORD_{set}: 0 and 1 are read")),
        };
        let first = match (accessor, image) {
            (Some(accessor), _) => self.first(gltf, accessor, part.vertices)?,
            (None, Some(image)) => {
                return wrong(format!("it shows image {image}, but has no texture coordinates"));
            }
            (None, None) => {
                let next = self.coordinates.len() as u32;
                let nowhere = *self.nowhere.get_or_insert(next);
                if nowhere == next {
                    self.coordinates.push([0.0; 2]);
                }
                nowhere
            }
        };
        let place = |k: u32| if accessor.is_some() { first + k } else { first };
        self.corners.reserve_exact(faces.saturating_sub(self.corners.len()));
        self.corners.extend(triangles.iter().map(|triangle| triangle.map(place)));

        let factor = factor_of(material);
        // Vertices shared by parts with several factors have no factor in their colours.
        let factor = if part.lit == factor { [1.0; 3] } else { factor };
        let next = self.materials.len() as u32;
        let number = *self.numbers.entry((image, factor.map(f64::to_bits))).or_insert(next);
        if number == next {
            self.materials.push((image, factor));
        }
        self.multiplies_colours |= image.is_some() && !attributes.colour.is_null();
        self.of_faces.reserve_exact(faces.saturating_sub(self.of_faces.len()));
        self.of_faces.resize(self.corners.len(), number);
        Ok(())
    }

    /// First coordinate of an accessor, for `vertices` vertices.
    fn first(&mut self, gltf: &Gltf, accessor: usize, vertices: usize) -> Result<u32, Trouble> {
        let wrong = |reason: String| Err(Trouble::part("", reason));
        let entry = match self.firsts.entry(accessor) {
            Entry::Occupied(first) => return Ok(*first.get() as u32),
            Entry::Vacant(entry) => entry,
        };
        let first = self.coordinates.len();
        let count = gltf.count(accessor)?;
        if count != vertices {
            return wrong(format!("{count} texture coordinates for {vertices} vertices"));
        }
        let most = self.most;
        if count > most - first.min(most) {
            return wrong(format!("with it there are more than {most} coordinates"));
        }
        for (vertex, [u, v]) in gltf.coordinates(accessor)?.into_iter().enumerate() {
            let upward = [u, 1.0 - v];
            if !upward.iter().all(is_near) {
                let reason =
                    format!("texture coordinate ({u}, {v}) is not from -{FARTHEST} to {FARTHEST}");
                return Err(Trouble::part(format!("vertex {vertex}"), reason));
            }
            self.coordinates.push(upward);
        }
        Ok(*entry.insert(first) as u32)
    }

    /// The texture, if there are coordinates or several materials; reasons to omit pictures are added to `warnings`.
    pub(crate) fn texture(
        self,
        gltf: &Gltf,
        folder: &Path,
        warnings: &mut Vec<Trouble>,
    ) -> Option<Texture> {
        let is_plain = self.materials.iter().all(|material| *material == (None, [1.0; 3]));
        if self.firsts.is_empty() && is_plain {
            return None;
        }
        let mut pictures = Pictures::default();
        let materials = self.materials.into_iter().map(|(image, factor)| {
            let picture = image.and_then(|number| {
                pictures.get(number, || content(gltf, folder, number), warnings)
            });
            Material::of(picture, factor)
        });
        let materials = materials.collect();
        let texture = Texture::new(self.coordinates, self.corners)
            .and_then(|texture| texture.with_materials(materials, self.of_faces));
        match texture {
            Ok(texture) if self.multiplies_colours => Some(texture.multiplying_colours()),
            Ok(texture) => Some(texture),
            Err(error) => {
                warnings.push(Trouble::OtherFile(error));
                None
            }
        }
    }
}

/// The image of a material, and the number of its set of coordinates.
///
/// Read leniently: errors in materials do not prevent reading the mesh.
fn base_colour(gltf: &Gltf, material: &Value) -> Result<(Option<usize>, u64), String> {
    let shown = picture_of(material);
    if shown.is_null() {
        return Ok((None, 0));
    }
    if !shown["extensions"]["KHR_texture_transform"].is_null() {
        return Err("KHR_texture_transform is not read: apply it to the coordinates".to_owned());
    }
    let texture = entry(&gltf.textures, &shown["index"]);
    let image = number(&texture["source"]).ok_or("its texture has no image of PNG or JPEG")?;
    Ok((Some(image), shown["texCoord"].as_u64().unwrap_or(0)))
}

/// The content of the file of an image.
fn content(gltf: &Gltf, folder: &Path, image: usize) -> Result<Vec<u8>, Trouble> {
    let wrong = |reason: &str| Err(Trouble::part(format!("image {image}"), reason));
    let found = &gltf.images[image];
    let content = match (&found["uri"], number(&found["bufferView"])) {
        (Value::String(uri), _) => match data(uri) {
            Some(Some(content)) => content,
            Some(None) => return wrong(&format!("its data URI is not base64: {}", shown(uri))),
            None => return picture_at(referenced_uri(folder, uri)).map_err(Trouble::OtherFile),
        },
        (_, Some(view)) => match gltf.view(view) {
            Ok((_, Some(bytes))) => bytes.to_vec(),
            Ok((_, None)) => return wrong("it reaches beyond its buffer"),
            Err(reason) => return wrong(&reason),
        },
        _ => return wrong("it has no content"),
    };
    if media_type(&content).is_none() {
        return wrong("it is neither PNG nor JPEG");
    }
    Ok(content)
}
