//! A GLB file: binary glTF 2.0, of which the geometry is read and written.

use std::collections::HashMap;

use serde_json::json;

use crate::{
    Fault, Mesh,
    error::{Trouble, shown},
    gltf::{Gltf, Node, Primitive},
    placement::Placement,
    ply::finite,
    read::Parts,
};

const MAGIC: &[u8] = b"glTF";
const JSON: &[u8] = b"JSON";
const BIN: &[u8] = b"BIN\0";

/// A small file can place a mesh many times over. From here on, it must have as many bytes as
/// vertices and faces.
const MOST_PLACED: usize = 1 << 25;

/// What starts like this does not change where the triangles are.
const HARMLESS: [&str; 9] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_animation_",
    "KHR_mesh_quantization",
    "KHR_xmp",
    "EXT_texture_",
    "EXT_lights_",
    "MSFT_texture_",
];

/// The colour of what has none beside what has one.
const WHITE: [f64; 3] = [1.0; 3];

const NO_FACES: Trouble =
    Trouble::NoFaces("a GLB file has them in meshes of triangles at the nodes of its scene");

/// The mesh in `bytes`; see [`Mesh::parse`].
pub(crate) fn parse(bytes: &[u8]) -> Result<Parts, Trouble> {
    let (json, bin) = chunks(bytes)?;
    let gltf: Gltf = serde_json::from_slice(json)
        .map_err(|reason| Trouble::part("JSON chunk", reason.to_string()))?;
    for extension in &gltf.extensions_required {
        let name = shown(extension);
        if ["draco", "meshopt"].iter().any(|method| extension.contains(method)) {
            let reason = format!("compressed by {name}: export it without compression");
            return Err(Trouble::part("JSON chunk", reason));
        }
        if !HARMLESS.iter().any(|harmless| extension.starts_with(harmless)) {
            let reason = format!("needs the extension {name}, which is not read");
            return Err(Trouble::part("JSON chunk", reason));
        }
    }

    let most = MOST_PLACED.max(bytes.len());
    let parts = Parts::default();
    let mut surface = Surface { gltf: &gltf, bin, most, parts };
    let mut seen = vec![false; gltf.nodes.len()];
    let mut waiting = vec![];
    enter(&roots(&gltf)?, &Placement::IDENTITY, &mut seen, &mut waiting)?;
    // Not by recursion: the tree may be as deep as the file is long.
    while let Some((number, parent)) = waiting.pop() {
        let node: &Node = &gltf.nodes[number];
        let placement = parent.then_local(&Placement::of(node));
        if let Some(mesh) = node.mesh {
            surface.add(mesh, &placement).map_err(|trouble| match trouble {
                Trouble::Part(part, why) => Trouble::Part(format!("node {number}, {part}"), why),
                other => other,
            })?;
        }
        enter(&node.children, &placement, &mut seen, &mut waiting)?;
    }
    let mut parts = surface.parts;
    if parts.faces.is_empty() {
        return Err(NO_FACES);
    }
    if let Some(colours) = &mut parts.colours {
        colours.resize(parts.positions.len(), WHITE);
    }
    Ok(parts)
}

/// The JSON chunk and the binary chunk, if there is one.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Trouble> {
    let header = |reason: String| Trouble::part("header", reason);
    let (magic, mut rest) = bytes.split_at_checked(4).unwrap_or((&[], bytes));
    if magic != MAGIC {
        return Err(header("not a GLB file: it does not start with glTF".to_owned()));
    }
    let truncated = || Trouble::Part("header".to_owned(), Fault::Truncated);
    let version = word(&mut rest).ok_or_else(truncated)?;
    if version != 2 {
        return Err(header(format!("glTF {version} is not read: export it as glTF 2.0")));
    }
    let length = word(&mut rest).ok_or_else(truncated)?;
    let end = (length as usize).checked_sub(12).and_then(|length| rest.get(..length));
    rest = end.ok_or_else(|| {
        header(format!("it claims {length} bytes, but the file has {}", bytes.len()))
    })?;

    let (mut json, mut bin) = (None, None);
    for chunk in 0.. {
        // Zeros that pad a file are shorter than the head of a chunk.
        let Some(length) = word(&mut rest) else { break };
        let kind = word(&mut rest).map(u32::to_le_bytes);
        let content = rest.split_at_checked(length as usize);
        let (Some(kind), Some((content, after))) = (kind, content) else {
            return Err(Trouble::Part(format!("chunk {chunk}"), Fault::Truncated));
        };
        rest = after;
        match kind.as_slice() {
            JSON if chunk == 0 => json = Some(content),
            BIN if chunk == 1 => bin = Some(content),
            _ => {}
        }
    }
    let missing = || Trouble::part("chunk 0", "it should hold JSON");
    Ok((json.ok_or_else(missing)?, bin))
}

/// Takes a number of 32 bits off `rest`.
fn word(rest: &mut &[u8]) -> Option<u32> {
    let (word, after) = rest.split_first_chunk()?;
    *rest = after;
    Some(u32::from_le_bytes(*word))
}

/// The nodes of the scene, or those that are no node's children.
fn roots(gltf: &Gltf) -> Result<Vec<usize>, Trouble> {
    match (gltf.scene, gltf.scenes.first()) {
        (None, Some(scene)) => Ok(scene.nodes.clone()),
        (Some(number), _) => match gltf.scenes.get(number) {
            Some(scene) => Ok(scene.nodes.clone()),
            None => Err(Trouble::part(format!("scene {number}"), "there is none")),
        },
        (None, None) => {
            let mut is_root = vec![true; gltf.nodes.len()];
            for &child in gltf.nodes.iter().flat_map(|node| &node.children) {
                if let Some(root) = is_root.get_mut(child) {
                    *root = false;
                }
            }
            Ok((0..is_root.len()).filter(|&node| is_root[node]).collect())
        }
    }
}

/// Puts `nodes` on the stack, the first on top.
fn enter(
    nodes: &[usize],
    parent: &Placement,
    seen: &mut [bool],
    waiting: &mut Vec<(usize, Placement)>,
) -> Result<(), Trouble> {
    for &node in nodes.iter().rev() {
        let wrong = |reason| Err(Trouble::part(format!("node {node}"), reason));
        match seen.get_mut(node) {
            None => return wrong("there is none"),
            Some(true) => return wrong("it is in the tree of nodes more than once"),
            Some(seen) => *seen = true,
        }
        waiting.push((node, *parent));
    }
    Ok(())
}

/// What has been placed so far.
struct Surface<'a> {
    gltf: &'a Gltf,
    bin: Option<&'a [u8]>,
    most: usize,
    /// Colours may be fewer than positions: those at the end are white.
    parts: Parts,
}

impl Surface<'_> {
    /// Adds the triangles of a mesh.
    fn add(&mut self, mesh: usize, placement: &Placement) -> Result<(), Trouble> {
        let missing = || Trouble::part(format!("mesh {mesh}"), "there is none");
        let primitives = &self.gltf.meshes.get(mesh).ok_or_else(missing)?.primitives;
        // Parts of other materials often use the same vertices.
        let mut firsts = HashMap::new();
        for (number, primitive) in primitives.iter().enumerate() {
            self.add_primitive(primitive, placement, &mut firsts).map_err(|trouble| {
                let here = format!("mesh {mesh}, primitive {number}");
                match trouble {
                    Trouble::Part(part, why) if part.is_empty() => Trouble::Part(here, why),
                    Trouble::Part(part, why) => Trouble::Part(format!("{here}, {part}"), why),
                    other => other,
                }
            })?;
        }
        Ok(())
    }

    fn add_primitive(
        &mut self,
        primitive: &Primitive,
        placement: &Placement,
        firsts: &mut HashMap<(usize, Option<usize>), usize>,
    ) -> Result<(), Trouble> {
        let wrong = |reason: String| Trouble::part("", reason);
        let accessor = match (primitive.mode, primitive.attributes.position) {
            (0..4, _) | (4..7, None) => return Ok(()),
            (4..7, Some(accessor)) => accessor,
            (mode, _) => return Err(wrong(format!("{mode} is not a mode of glTF"))),
        };
        let vertices = self.gltf.count(accessor)?;
        let key = (accessor, primitive.attributes.colour);
        let first = match firsts.get(&key) {
            Some(&first) => first,
            None => {
                let first = self.parts.positions.len();
                self.leave_room(first, vertices, "vertices")?;
                if let Some(colour) = primitive.attributes.colour {
                    self.add_colours(colour, first, vertices)?;
                }
                for (vertex, p) in self.gltf.positions(accessor, self.bin)?.iter().enumerate() {
                    let position = placement.apply(*p);
                    finite(position)
                        .map_err(|why| Trouble::Part(format!("vertex {vertex}"), why))?;
                    self.parts.positions.push(position);
                }
                *firsts.entry(key).or_insert(first)
            }
        };

        let count = primitive.indices.map_or(Ok(vertices), |indices| self.gltf.count(indices))?;
        self.leave_room(self.parts.faces.len(), count, "corners")?;
        let indices = match primitive.indices {
            Some(indices) => self.gltf.indices(indices, self.bin)?,
            // No more than 2³² vertices have been let in.
            None => (0..vertices as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|&&index| index as usize >= vertices) {
            return Err(Trouble::Part(
                String::new(),
                Fault::OutOfRange { index: index.to_string(), vertices },
            ));
        }
        if primitive.mode == 4 && indices.len() % 3 != 0 {
            return Err(wrong(format!("{} corners do not make whole triangles", indices.len())));
        }
        let first = first as u32;
        let placed = |[a, b, c]: [u32; 3]| {
            let [a, b, c] = [first + a, first + b, first + c];
            if placement.mirrors() { [a, c, b] } else { [a, b, c] }
        };
        self.parts.faces.extend(triangles(primitive.mode, &indices).into_iter().map(placed));
        Ok(())
    }

    /// Adds the colours of as many vertices, after `first` others.
    fn add_colours(
        &mut self,
        accessor: usize,
        first: usize,
        vertices: usize,
    ) -> Result<(), Trouble> {
        let linear = self.gltf.colours(accessor, self.bin)?;
        if linear.len() != vertices {
            let reason = format!("{} colours for {vertices} vertices", linear.len());
            return Err(Trouble::part("", reason));
        }
        let colours = self.parts.colours.get_or_insert_default();
        colours.resize(first, WHITE);
        for (vertex, colour) in linear.into_iter().enumerate() {
            if colour.iter().any(|x| x.is_nan()) {
                let reason = Fault::Colour { value: "NaN".to_owned(), full: 1 };
                return Err(Trouble::Part(format!("vertex {vertex}"), reason));
            }
            // Source: glTF 2.0 specification, Sec. 3.7.2.1: components must be clamped.
            colours.push(colour.map(|x| from_linear(x.clamp(0.0, 1.0))));
        }
        Ok(())
    }

    /// An error if `more` of them are too many beside those that there are.
    fn leave_room(&self, there: usize, more: usize, what: &str) -> Result<(), Trouble> {
        let most = self.most.min(u32::MAX as usize);
        if there.checked_add(more).is_some_and(|all| all <= most) {
            return Ok(());
        }
        Err(Trouble::part("", format!("with it there are more than {most} {what}")))
    }
}

/// The triangles of a list (mode 4), a strip (5) or a fan (6).
fn triangles(mode: u64, indices: &[u32]) -> Vec<[u32; 3]> {
    let windows = indices.windows(3).enumerate();
    match mode {
        4 => indices.as_chunks().0.to_vec(),
        // Every other triangle of a strip runs against the order of its corners.
        5 => windows
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect(),
        _ => indices.windows(2).skip(1).map(|w| [indices[0], w[0], w[1]]).collect(),
    }
}

/// A channel as screens have it, of one that is proportional to light; both from 0 to 1.
///
/// Source: IEC 61966-2-1 (sRGB). Vertex colours of glTF are linear: specification, Sec. 3.7.2.1.
fn from_linear(x: f64) -> f64 {
    let root = x.powf(1.0 / 2.4);
    // In this form 1 is exactly 1.
    if x <= 0.003_130_8 { 12.92 * x } else { root + 0.055 * (root - 1.0) }
}

/// The inverse of [`from_linear`].
fn to_linear(x: f64) -> f64 {
    if x <= 0.040_45 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

/// See [`Mesh::to_glb`].
pub(crate) fn bytes(mesh: &Mesh) -> Vec<u8> {
    let positions: Vec<_> = mesh.positions().iter().map(|p| p.map(|x| x as f32)).collect();
    let extreme = |pick: fn(f32, f32) -> f32| {
        positions.iter().copied().reduce(|a, b| [0, 1, 2].map(|k| pick(a[k], b[k])))
    };
    let (vertices, corners) = (positions.len(), 3 * mesh.faces().len());
    let mut length = 12 * vertices + 4 * corners;
    let mut json = json!({
        "asset": {"version": "2.0", "generator": "softrast-mesh"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{
            "doubleSided": true,
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.75, 0.75, 0.75, 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": 0.75,
            },
        }],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": vertices,
                "type": "VEC3",
                "min": extreme(f32::min),
                "max": extreme(f32::max),
            },
            {"bufferView": 1, "componentType": 5125, "count": corners, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 12 * vertices, "target": 34962},
            {"buffer": 0, "byteOffset": 12 * vertices, "byteLength": 4 * corners, "target": 34963},
        ],
    });
    if mesh.colours().is_some() {
        json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(2);
        json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] =
            json!([1.0, 1.0, 1.0, 1.0]);
        let more = [
            (
                "accessors",
                json!({"bufferView": 2, "componentType": 5126, "count": vertices, "type": "VEC3"}),
            ),
            (
                "bufferViews",
                json!({"buffer": 0, "byteOffset": length, "byteLength": 12 * vertices, "target": 34962}),
            ),
        ];
        for (list, entry) in more {
            json[list].as_array_mut().expect("a list").push(entry);
        }
        length += 12 * vertices;
    }
    json["buffers"] = json!([{"byteLength": length}]);
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');

    let all = 12 + 8 + json.len() + 8 + length;
    let of_32_bits = |length: usize| {
        u32::try_from(length).expect("a GLB file has less than 4 GiB").to_le_bytes()
    };
    let mut file = Vec::with_capacity(all);
    file.extend([MAGIC, &2u32.to_le_bytes(), &of_32_bits(all)].concat());
    file.extend([&of_32_bits(json.len()), JSON].concat());
    file.extend(json);
    file.extend([&of_32_bits(length), BIN].concat());
    file.extend(positions.iter().flatten().flat_map(|x| x.to_le_bytes()));
    file.extend(mesh.faces().iter().flatten().flat_map(|v| v.to_le_bytes()));
    let colours = mesh.colours().into_iter().flatten().flatten();
    file.extend(colours.flat_map(|&x| (to_linear(x) as f32).to_le_bytes()));
    file
}
