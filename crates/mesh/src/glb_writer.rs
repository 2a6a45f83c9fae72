//! Writes a GLB file.

use std::collections::HashMap;

use serde_json::{Value, json};

use crate::{
    Material, Mesh, Texture,
    glb::{BIN, JSON, MAGIC},
    material::{media_type, to_linear},
};

const FLOATS: u32 = 5126;
const WHOLE: u32 = 5125;
const OF_VERTICES: u32 = 34962;
const OF_INDICES: u32 = 34963;
/// The linear colour of a material without a picture, on a mesh without colours.
const GREY: f64 = 0.75;
/// Largest rounding error of 32-bit coordinates relative to the longest side of the mesh, up to which they are written relative to the
/// origin.
const COARSEST: f64 = 1e-5;

/// The binary chunk, and its description in the JSON.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Adds bytes and returns the number of their view; the start is aligned to four bytes.
    fn view(&mut self, bytes: impl IntoIterator<Item = u8>) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        let view =
            json!({"buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start});
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Adds entries of `N` numbers of four bytes each, and returns the number of their accessor.
    fn accessor<const N: usize>(
        &mut self,
        entries: impl IntoIterator<Item = [[u8; 4]; N]>,
        [component, target]: [u32; 2],
    ) -> usize {
        let view = self.view(entries.into_iter().flatten().flatten());
        let bytes = self.views[view]["byteLength"].as_u64().unwrap_or(0);
        self.views[view]["target"] = json!(target);
        self.accessors.push(json!({
            "bufferView": view,
            "componentType": component,
            "count": bytes / (4 * N as u64),
            "type": if N == 1 { "SCALAR".to_owned() } else { format!("VEC{N}") },
        }));
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, entries: impl IntoIterator<Item = [f64; N]>) -> usize {
        let entries = entries.into_iter().map(|entry| entry.map(|x| (x as f32).to_le_bytes()));
        self.accessor(entries, [FLOATS, OF_VERTICES])
    }
}

/// See [`Mesh::glb_origin`].
pub(crate) fn origin(mesh: &Mesh) -> [f64; 3] {
    let [low, high] = mesh.bounds();
    let longest = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
    let farthest = low.into_iter().chain(high).map(f64::abs).fold(0.0, f64::max);
    if farthest * f64::from(f32::EPSILON) <= COARSEST * longest {
        return [0.0; 3];
    }
    // Rounded to 32 bits, so that programs that store the node in 32 bits have the same value.
    [0, 1, 2].map(|k| f64::from(f64::midpoint(low[k], high[k]) as f32))
}

/// See [`Mesh::to_glb`].
pub(crate) fn bytes(mesh: &Mesh) -> Vec<u8> {
    let (vertices, faces) = split(mesh);
    let origin = origin(mesh);
    let from_origin = |p: [f64; 3]| [0, 1, 2].map(|k| p[k] - origin[k]);
    let places =
        || vertices.iter().map(|&[vertex, _]| from_origin(mesh.positions()[vertex as usize]));
    let rounded = || places().map(|p| p.map(|x| x as f32));
    let extreme =
        |pick: fn(f32, f32) -> f32| rounded().reduce(|a, b| [0, 1, 2].map(|k| pick(a[k], b[k])));

    let mut buffer = Buffer::default();
    let position = buffer.floats(places());
    buffer.accessors[position]["min"] = json!(extreme(f32::min));
    buffer.accessors[position]["max"] = json!(extreme(f32::max));
    let mut attributes = json!({"POSITION": position});
    if let Some(texture) = mesh.texture() {
        let down = vertices.iter().map(|&[_, k]| texture.coordinates()[k as usize]);
        attributes["TEXCOORD_0"] = json!(buffer.floats(down.map(|[u, v]| [u, 1.0 - v])));
    }
    let white = [Material::default()];
    let materials = mesh.texture().map_or(&white[..], Texture::materials);
    let shows_colours = |material: &Material| {
        material.picture().is_none() || mesh.texture().is_some_and(Texture::multiplies_colours)
    };
    let colours = mesh.colours().filter(|_| materials.iter().any(shows_colours));
    let colours = colours.map(|colours| {
        buffer.floats(vertices.iter().map(|&[vertex, _]| colours[vertex as usize].map(to_linear)))
    });
    let mut json = json!({
        "asset": {"version": "2.0", "generator": "softrast-mesh"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
    });
    if origin != [0.0; 3] {
        json["nodes"][0]["translation"] = json!(origin);
    }
    let [mut all, mut primitives, mut images] = [(); 3].map(|()| Vec::new());
    let mut known = HashMap::new();
    let of_faces = mesh.texture().map(Texture::of_faces);
    let material_of = |&face: &usize| of_faces.map_or(0, |of_faces| of_faces[face] as usize);
    let mut order = Vec::from_iter(0..faces.len());
    order.sort_by_key(material_of);
    for own in order.chunk_by(|a, b| material_of(a) == material_of(b)) {
        let material = &materials[material_of(&own[0])];
        let corners = own.iter().flat_map(|&face| faces[face]).map(|v| [v.to_le_bytes()]);
        let indices = buffer.accessor(corners, [WHOLE, OF_INDICES]);
        let mut attributes = attributes.clone();
        let colours = colours.filter(|_| shows_colours(material));
        if let Some(colours) = colours {
            attributes["COLOR_0"] = json!(colours);
        }
        let [red, green, blue] = match (material.factor(), material.picture(), colours) {
            ([1.0, 1.0, 1.0], None, None) => [GREY; 3],
            (factor, ..) => factor,
        };
        let mut colour = json!({
            "baseColorFactor": [red, green, blue, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.75,
        });
        if let Some(picture) = material.picture() {
            let image = *known.entry(picture.as_ptr()).or_insert_with(|| {
                let view = buffer.view(picture.iter().copied());
                images.push(json!({"bufferView": view, "mimeType": media_type(picture)}));
                images.len() - 1
            });
            colour["baseColorTexture"] = json!({"index": image});
        }
        primitives
            .push(json!({"attributes": attributes, "indices": indices, "material": all.len()}));
        all.push(json!({"doubleSided": true, "pbrMetallicRoughness": colour}));
    }
    if !images.is_empty() {
        let textures = (0..images.len()).map(|image| json!({"source": image}));
        json["textures"] = textures.collect();
        json["images"] = json!(images);
    }
    json["materials"] = json!(all);
    json["meshes"] = json!([{"primitives": primitives}]);
    json["buffers"] = json!([{"byteLength": buffer.bytes.len()}]);
    json["bufferViews"] = json!(buffer.views);
    json["accessors"] = json!(buffer.accessors);
    file(json.to_string().into_bytes(), &buffer.bytes)
}

/// The vertices of the format, each with a single texture coordinate, as numbers of vertex and coordinate; and the faces between them.
/// Without a texture the vertices are unchanged; with one, unused vertices are removed.
fn split(mesh: &Mesh) -> (Vec<[u32; 2]>, Vec<[u32; 3]>) {
    let Some(texture) = mesh.texture() else {
        let all = (0..mesh.positions().len() as u32).map(|vertex| [vertex, 0]).collect();
        return (all, mesh.faces().to_vec());
    };
    let corners = mesh.faces().as_flattened().iter().zip(texture.corners().as_flattened());
    let corners: Vec<[u32; 2]> = corners.map(|(&vertex, &k)| [vertex, k]).collect();
    let mut vertices = corners.clone();
    vertices.sort_unstable();
    vertices.dedup();
    let number = |corner| vertices.binary_search(corner).expect("all corners are there") as u32;
    let numbers: Vec<u32> = corners.iter().map(number).collect();
    let faces = numbers.as_chunks().0.to_vec();
    (vertices, faces)
}

/// Both chunks and their headers.
fn file(mut json: Vec<u8>, bin: &[u8]) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let all = 12 + 8 + json.len() + 8 + bin.len();
    let of_32_bits = |length: usize| {
        u32::try_from(length).expect("a GLB file has less than 4 GiB").to_le_bytes()
    };
    let mut file = Vec::with_capacity(all);
    file.extend([MAGIC, &2u32.to_le_bytes(), &of_32_bits(all)].concat());
    file.extend([&of_32_bits(json.len()), JSON].concat());
    file.extend(json);
    file.extend([&of_32_bits(bin.len()), BIN].concat());
    file.extend(bin);
    file
}
