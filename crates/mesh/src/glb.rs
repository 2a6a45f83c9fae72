//! A GLB file: binary glTF 2.0, of which the geometry, colours and a texture are read.

use std::{collections::HashMap, path::Path};

use crate::{
    Fault,
    error::{Trouble, shown},
    glb_texture::Unwrapped,
    gltf::{Gltf, Node, Primitive},
    placement::Placement,
    ply::finite,
    read::Parts,
};

pub(crate) const MAGIC: &[u8] = b"glTF";
pub(crate) const JSON: &[u8] = b"JSON";
pub(crate) const BIN: &[u8] = b"BIN\0";

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

/// The mesh in `bytes`; see [`crate::Mesh::parse`]. With the `folder` of the file also its texture, or why it was left out.
pub(crate) fn parse(bytes: &[u8], folder: Option<&Path>) -> Result<Parts, Trouble> {
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
    let unwrapped = folder.map(|_| Ok(Unwrapped::default()));
    let mut surface = Surface { gltf: &gltf, bin, most, parts, unwrapped };
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
    let Surface { mut parts, unwrapped, .. } = surface;
    if parts.faces.is_empty() {
        return Err(NO_FACES);
    }
    if let Some(colours) = &mut parts.colours {
        colours.resize(parts.positions.len(), WHITE);
    }
    if let (Some(folder), Some(unwrapped)) = (folder, unwrapped) {
        (parts.texture, parts.left_out) = match unwrapped {
            Ok(unwrapped) => unwrapped.texture(&gltf, bin, folder),
            Err(trouble) => (None, Some(trouble)),
        };
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
    /// If it is to be read: what there is of the texture, or what is wrong with it.
    unwrapped: Option<Result<Unwrapped, Trouble>>,
}

impl Surface<'_> {
    /// Adds the triangles of a mesh.
    fn add(&mut self, mesh: usize, placement: &Placement) -> Result<(), Trouble> {
        let missing = || Trouble::part(format!("mesh {mesh}"), "there is none");
        let primitives = &self.gltf.meshes.get(mesh).ok_or_else(missing)?.primitives;
        // Parts of other materials often use the same vertices.
        let mut firsts = HashMap::new();
        for (number, primitive) in primitives.iter().enumerate() {
            let at = |trouble: Trouble| {
                let here = format!("mesh {mesh}, primitive {number}");
                match trouble {
                    Trouble::Part(part, why) if part.is_empty() => Trouble::Part(here, why),
                    Trouble::Part(part, why) => Trouble::Part(format!("{here}, {part}"), why),
                    other => other,
                }
            };
            let triangles = self.add_primitive(primitive, placement, &mut firsts).map_err(at)?;
            if let Some(Ok(unwrapped)) = &mut self.unwrapped
                && let Err(trouble) =
                    unwrapped.add(self.gltf, self.bin, primitive, &triangles, self.most)
            {
                self.unwrapped = Some(Err(at(trouble)));
            }
        }
        Ok(())
    }

    /// Adds the triangles of a part, and returns them as its indices say, wound as they are placed.
    fn add_primitive(
        &mut self,
        primitive: &Primitive,
        placement: &Placement,
        firsts: &mut HashMap<(usize, Option<usize>), usize>,
    ) -> Result<Vec<[u32; 3]>, Trouble> {
        let wrong = |reason: String| Trouble::part("", reason);
        let accessor = match (primitive.mode, primitive.attributes.position) {
            (0..4, _) | (4..7, None) => return Ok(vec![]),
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
        let mut triangles = triangles(primitive.mode, &indices);
        if placement.mirrors() {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let first = first as u32;
        self.parts.faces.extend(triangles.iter().map(|triangle| triangle.map(|v| first + v)));
        Ok(triangles)
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
