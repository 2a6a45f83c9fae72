//! The texture of a GLB file: coordinates of its parts, and the picture of their materials.

use std::{
    collections::{HashMap, hash_map::Entry},
    path::Path,
};

use serde_json::Value;

use crate::{
    Texture,
    beside::{beside_uri, picture_at},
    error::{FARTHEST, Trouble, shown},
    gltf::{Gltf, Primitive, entry, number},
    gltf_buffers::data,
    texture::{is_near, media_type},
};

/// Coordinates of a file that is not longer, in bytes. Many small accessors may lie over the same bytes.
const MOST_COORDINATES: usize = 10_000_000;

/// The texture of the parts placed so far.
pub(crate) struct Unwrapped {
    most: usize,
    coordinates: Vec<[f64; 2]>,
    corners: Vec<[u32; 3]>,
    /// Where the coordinates of an accessor begin.
    firsts: HashMap<usize, usize>,
    /// Whether the first part has coordinates, and the image that it shows: all have the same.
    of_all: Option<(bool, Option<usize>)>,
}

impl Unwrapped {
    /// None yet, for a file of `length` bytes.
    pub(crate) fn new(length: usize) -> Self {
        Self {
            most: MOST_COORDINATES.max(length).min(u32::MAX as usize),
            coordinates: Vec::new(),
            corners: Vec::new(),
            firsts: HashMap::new(),
            of_all: None,
        }
    }

    /// Adds the coordinates of the `triangles` of a part of `vertices` vertices, one of `faces` faces in all.
    pub(crate) fn add(
        &mut self,
        gltf: &Gltf,
        primitive: &Primitive,
        triangles: &[[u32; 3]],
        vertices: usize,
        faces: usize,
    ) -> Result<(), Trouble> {
        fn wrong(reason: impl AsRef<str>) -> Result<(), Trouble> {
            Err(Trouble::part("", reason))
        }
        if triangles.is_empty() {
            return Ok(());
        }
        let (image, set) = base_colour(gltf, primitive).map_err(|why| Trouble::part("", why))?;
        let attributes = &primitive.attributes;
        let accessor = match set {
            0 => number(&attributes.coordinates),
            1 => number(&attributes.more_coordinates),
            _ => return wrong(format!("its texture needs TEXCOORD_{set}: 0 and 1 are read")),
        };
        let own = (accessor.is_some(), image);
        let (some, shown) = *self.of_all.get_or_insert(own);
        if some != own.0 {
            return wrong(match some {
                true => "it has no texture coordinates, but parts before it have",
                false => "it has texture coordinates, but parts before it have none",
            });
        }
        if shown != image {
            let name = |image: Option<usize>| match image {
                Some(number) => format!("image {number}"),
                None => "no image".to_owned(),
            };
            return wrong(format!(
                "it shows {}, parts before it {}: a mesh has one picture, so join them into one",
                name(image),
                name(shown)
            ));
        }
        let Some(accessor) = accessor else { return Ok(()) };
        let first = match self.firsts.entry(accessor) {
            Entry::Occupied(first) => *first.get(),
            Entry::Vacant(entry) => {
                let first = self.coordinates.len();
                let count = gltf.count(accessor)?;
                if count != vertices {
                    return wrong(format!("{count} texture coordinates for {vertices} vertices"));
                }
                let most = self.most;
                if count > most - first {
                    return wrong(format!("with it there are more than {most} coordinates"));
                }
                for (vertex, [u, v]) in gltf.coordinates(accessor)?.into_iter().enumerate() {
                    let upward = [u, 1.0 - v];
                    if !upward.iter().all(is_near) {
                        let reason = format!(
                            "texture coordinate ({u}, {v}) is not from -{FARTHEST} to {FARTHEST}"
                        );
                        return Err(Trouble::part(format!("vertex {vertex}"), reason));
                    }
                    self.coordinates.push(upward);
                }
                *entry.insert(first)
            }
        };
        self.corners.reserve_exact(faces.saturating_sub(self.corners.len()));
        let placed = triangles.iter().map(|triangle| triangle.map(|k| first as u32 + k));
        self.corners.extend(placed);
        Ok(())
    }

    /// The texture, if there are coordinates; `warnings` gets why its picture was left out.
    pub(crate) fn texture(
        self,
        gltf: &Gltf,
        folder: &Path,
        warnings: &mut Vec<Trouble>,
    ) -> Option<Texture> {
        let Some((true, image)) = self.of_all else { return None };
        let picture = image.map(|image| content(gltf, folder, image)).transpose();
        match Texture::new(self.coordinates, self.corners) {
            Ok(texture) => Some(texture.pictured(picture, warnings)),
            Err(error) => {
                warnings.push(Trouble::OtherFile(error));
                None
            }
        }
    }
}

/// The image that a part shows, and the set of coordinates that places it.
///
/// Read leniently: what is wrong with materials does not keep a mesh from being read.
fn base_colour(gltf: &Gltf, primitive: &Primitive) -> Result<(Option<usize>, u64), String> {
    let material = entry(&gltf.materials, &primitive.material);
    // Programs that know the extension show its picture, whatever stands beside it for others.
    let glossy = &material["extensions"]["KHR_materials_pbrSpecularGlossiness"]["diffuseTexture"];
    let rough = &material["pbrMetallicRoughness"]["baseColorTexture"];
    let Some(shown) = [glossy, rough].into_iter().find(|shown| !shown.is_null()) else {
        return Ok((None, 0));
    };
    if !shown["extensions"]["KHR_texture_transform"].is_null() {
        return Err("KHR_texture_transform is not read: apply it to the coordinates".to_owned());
    }
    let texture = entry(&gltf.textures, &shown["index"]);
    let image = number(&texture["source"]).ok_or("its texture has no image of PNG or JPEG")?;
    Ok((Some(image), shown["texCoord"].as_u64().unwrap_or(0)))
}

/// The content of the file that an image is.
fn content(gltf: &Gltf, folder: &Path, image: usize) -> Result<Vec<u8>, Trouble> {
    let wrong = |reason: &str| Err(Trouble::part(format!("image {image}"), reason));
    let found = &gltf.images[image];
    let content = match (&found["uri"], number(&found["bufferView"])) {
        (Value::String(uri), _) => match data(uri) {
            Some(Some(content)) => content,
            Some(None) => return wrong(&format!("its data URI is not base64: {}", shown(uri))),
            None => return picture_at(beside_uri(folder, uri)).map_err(Trouble::OtherFile),
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
