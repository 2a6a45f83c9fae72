//! The texture of a GLB file: coordinates of its parts, and the picture of their materials.

use std::{
    collections::{HashMap, hash_map::Entry},
    path::Path,
};

use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::Value;

use crate::{
    Texture,
    beside::picture,
    error::{Trouble, shown},
    gltf::{Gltf, Primitive},
    texture::{FARTHEST, is_near, media_type},
};

/// What the parts placed so far have of a texture.
#[derive(Default)]
pub(crate) struct Unwrapped {
    coordinates: Vec<[f64; 2]>,
    corners: Vec<[u32; 3]>,
    /// Where the coordinates of an accessor begin.
    firsts: HashMap<usize, usize>,
    /// Whether the first part has coordinates, and the image that it shows: all have the same.
    of_all: Option<(bool, Option<usize>)>,
}

impl Unwrapped {
    /// Adds what belongs to the `triangles` of a part; at most `most` coordinates in all.
    pub(crate) fn add(
        &mut self,
        gltf: &Gltf,
        bin: Option<&[u8]>,
        primitive: &Primitive,
        triangles: &[[u32; 3]],
        most: usize,
    ) -> Result<(), Trouble> {
        fn wrong(reason: impl Into<String>) -> Result<(), Trouble> {
            Err(Trouble::part("", reason))
        }
        if triangles.is_empty() {
            return Ok(());
        }
        let (image, set) = base_colour(gltf, primitive).map_err(|why| Trouble::part("", why))?;
        let attributes = &primitive.attributes;
        let accessor = match set {
            0 => attributes.coordinates.as_u64(),
            1 => attributes.more_coordinates.as_u64(),
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
        let accessor = accessor as usize;
        let first = match self.firsts.entry(accessor) {
            Entry::Occupied(first) => *first.get(),
            Entry::Vacant(entry) => {
                let first = self.coordinates.len();
                let count = gltf.count(accessor)?;
                if count > most.min(u32::MAX as usize) - first {
                    return wrong(format!("with it there are more than {most} coordinates"));
                }
                for (vertex, [u, v]) in gltf.coordinates(accessor, bin)?.into_iter().enumerate() {
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
        let count = gltf.count(accessor)?;
        if let Some(index) = triangles.as_flattened().iter().find(|&&k| k as usize >= count) {
            return wrong(format!("index {index} is beyond its {count} texture coordinates"));
        }
        // No more than 2³² coordinates have been let in.
        let placed = triangles.iter().map(|triangle| triangle.map(|k| first as u32 + k));
        self.corners.extend(placed);
        Ok(())
    }

    /// The texture, if there are coordinates, and why its picture was left out.
    pub(crate) fn texture(
        self,
        gltf: &Gltf,
        bin: Option<&[u8]>,
        folder: &Path,
    ) -> (Option<Texture>, Option<Trouble>) {
        let Some((true, image)) = self.of_all else { return (None, None) };
        let picture = image.map(|image| content(gltf, bin, folder, image)).transpose();
        match Texture::new(self.coordinates, self.corners) {
            Ok(texture) => texture.pictured(picture),
            Err(error) => (None, Some(Trouble::OtherFile(error))),
        }
    }
}

/// The image that a part shows, and the set of coordinates that places it.
///
/// Read leniently: what is wrong with materials does not keep a mesh from being read.
fn base_colour(gltf: &Gltf, primitive: &Primitive) -> Result<(Option<usize>, u64), String> {
    let material = entry(&gltf.materials, &primitive.material);
    let shown = &material["pbrMetallicRoughness"]["baseColorTexture"];
    if shown.is_null() {
        return Ok((None, 0));
    }
    if !shown["extensions"]["KHR_texture_transform"].is_null() {
        return Err("KHR_texture_transform is not read: apply it to the coordinates".to_owned());
    }
    let texture = entry(&gltf.textures, &shown["index"]);
    let image = texture["source"].as_u64();
    let image = image.ok_or("its texture has no image of PNG or JPEG")?;
    Ok((Some(image as usize), shown["texCoord"].as_u64().unwrap_or(0)))
}

fn entry<'a>(list: &'a Value, number: &Value) -> &'a Value {
    let number = number.as_u64().and_then(|number| usize::try_from(number).ok());
    number.and_then(|number| list.get(number)).unwrap_or(&Value::Null)
}

/// The content of the file that an image is.
fn content(
    gltf: &Gltf,
    bin: Option<&[u8]>,
    folder: &Path,
    number: usize,
) -> Result<Vec<u8>, Trouble> {
    let wrong = |reason: &str| Err(Trouble::part(format!("image {number}"), reason));
    let image = &gltf.images[number];
    let content = match (&image["uri"], image["bufferView"].as_u64()) {
        (Value::String(uri), _) => match uri.strip_prefix("data:") {
            None => return picture(folder, uri).map_err(Trouble::OtherFile),
            Some(data) => {
                let coded = data.split_once(";base64,").map(|(_, coded)| coded);
                match coded.map(|coded| STANDARD.decode(coded)) {
                    Some(Ok(content)) => content,
                    _ => return wrong(&format!("its data URI is not base64: {}", shown(uri))),
                }
            }
        },
        (_, Some(view)) => match gltf.view(view as usize, bin) {
            Ok((_, Some(bytes))) => bytes.to_vec(),
            Ok((_, None)) => return wrong("it reaches beyond the binary chunk"),
            Err(reason) => return wrong(&reason),
        },
        _ => return wrong("it has no content"),
    };
    if media_type(&content).is_none() {
        return wrong("it is neither PNG nor JPEG");
    }
    Ok(content)
}
