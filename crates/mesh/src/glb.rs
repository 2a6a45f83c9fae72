//! GLB and glTF files: the geometry, colours and a texture of glTF 2.0 are read.

use std::{
    collections::{HashMap, hash_map::Entry},
    path::Path,
};

use serde_json::Value;

use crate::{
    Fault,
    colours::{Beyond, Colours},
    error::{Place, Trouble, shown},
    glb_parts::{Room, at, factors, primitives, shared, surface_of},
    glb_texture::{Part, Unwrapped},
    gltf::{Gltf, Node, Primitive, number},
    material::from_linear,
    mesh::finite,
    parts::Parts,
    placement::Placement,
};

pub(crate) const MAGIC: &[u8] = b"glTF";
pub(crate) const JSON: &[u8] = b"JSON";
pub(crate) const BIN: &[u8] = b"BIN\0";

/// Extensions that are supported within the limits of this reader.
const READ: [&str; 3] =
    ["KHR_mesh_quantization", "KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit"];

/// Prefixes of extensions that do not change the position of triangles.
const HARMLESS: [&str; 8] = [
    "KHR_materials_",
    "KHR_texture_",
    "KHR_lights_",
    "KHR_animation_",
    "KHR_xmp",
    "EXT_texture_",
    "EXT_lights_",
    "MSFT_texture_",
];

/// The colour of parts without colours in a mesh that has some.
const WHITE: [f64; 3] = [1.0; 3];

const NO_FACES: Trouble = Trouble::NoFaces(
    "a GLB or glTF file has them in meshes of triangles at the nodes of its scene",
);

/// The mesh in `bytes` of a GLB file; see [`crate::Mesh::parse`]. With the `folder` of the file also buffers in other files, and its
/// texture if it is wanted.
pub(crate) fn parse(bytes: &[u8], folder: Option<&Path>, textured: bool) -> Result<Parts, Trouble> {
    let (json, bin) = chunks(bytes)?;
    let gltf = Gltf::read(json, bin, folder)?;
    scene(&gltf, bytes.len(), folder.filter(|_| textured))
}

/// The mesh in `bytes` of a glTF file, which is plain JSON; otherwise like [`parse`].
pub(crate) fn parse_text(
    bytes: &[u8],
    folder: Option<&Path>,
    textured: bool,
) -> Result<Parts, Trouble> {
    let json = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if json.starts_with(MAGIC) {
        return Err(Trouble::part("header", "it is a GLB file: let its name end in .glb"));
    }
    let gltf = Gltf::read(json, None, folder)?;
    scene(&gltf, bytes.len(), folder.filter(|_| textured))
}

/// The mesh of a file of `length` bytes. With the `folder` of the file also its texture.
fn scene(gltf: &Gltf, length: usize, folder: Option<&Path>) -> Result<Parts, Trouble> {
    let length = length + gltf.length_beside;
    let mut warnings = Vec::from_iter(required(&gltf.extensions_required)?);

    let mut room = Room::default();
    let mut prices = vec![None; gltf.meshes.len()];
    walk(gltf, |mesh, _| room.take(gltf, mesh, &mut prices))?;
    let (positions, faces) = room.checked(length, folder.is_some())?;
    let mut parts = Parts::default();
    parts.positions.reserve_exact(positions);
    parts.faces.reserve_exact(faces);

    let unwrapped = folder.map(|_| Ok(Unwrapped::new(length)));
    let most = [positions, faces];
    let mut surface = Surface { gltf, parts, most, colours: Ok(()), unwrapped };
    walk(gltf, |mesh, placement| surface.add(mesh, placement))?;
    let Surface { mut parts, colours, unwrapped, .. } = surface;
    if parts.faces.is_empty() {
        return Err(NO_FACES);
    }
    if let Some(colours) = &mut parts.colours {
        colours.resize(parts.positions.len(), WHITE);
    }
    if let Err(trouble) = colours {
        parts.colours = None;
        parts.warnings = vec![trouble];
    }
    warnings.append(&mut parts.warnings);
    parts.texture = match (folder, unwrapped) {
        (Some(folder), Some(Ok(unwrapped))) => unwrapped.texture(gltf, folder, &mut warnings),
        (_, Some(Err(trouble))) => {
            warnings.push(trouble);
            None
        }
        _ => None,
    };
    Ok(Parts { warnings, ..parts })
}

/// An error if a required extension may change the position of triangles; a warning if another unsupported one is required.
fn required(extensions: &[String]) -> Result<Option<Trouble>, Trouble> {
    let wrong = |reason| Trouble::part("JSON", reason);
    let is_read = |name: &&String| READ.contains(&name.as_str());
    for extension in extensions {
        let name = shown(extension);
        if ["draco", "meshopt"].iter().any(|method| extension.contains(method)) {
            return Err(wrong(format!("compressed by {name}: export it without compression")));
        }
        if !is_read(&extension) && !HARMLESS.iter().any(|start| extension.starts_with(start)) {
            return Err(wrong(format!("needs the extension {name}, which is not read")));
        }
    }
    let first = extensions.iter().find(|extension| !is_read(extension));
    Ok(first.map(|name| {
        let name = shown(name);
        wrong(format!("needs the extension {name}, which is not read: the mesh may look different"))
    }))
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
        // Zero padding of a file is shorter than the header of a chunk.
        let Some(length) = word(&mut rest) else { break };
        let kind = word(&mut rest).map(u32::to_le_bytes);
        let content = rest.split_at_checked(length as usize);
        let (Some(kind), Some((content, after))) = (kind, content) else {
            return Err(Trouble::Part(format!("chunk {chunk}"), Fault::Truncated));
        };
        rest = after;
        match kind.as_slice() {
            JSON if chunk == 0 => json = Some(content),
            BIN if bin.is_none() => bin = Some(content),
            _ => {}
        }
    }
    let missing = || Trouble::part("chunk 0", "it should hold JSON");
    Ok((json.ok_or_else(missing)?, bin))
}

/// Removes a 32-bit number from `rest`.
fn word(rest: &mut &[u8]) -> Option<u32> {
    let (word, after) = rest.split_first_chunk()?;
    *rest = after;
    Some(u32::from_le_bytes(*word))
}

/// The nodes of the scene; without a scene, those that are no node's children.
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

/// Pushes `nodes` on the stack, the first on top.
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

/// Calls `place` with each mesh in the tree of nodes and its placement.
fn walk(
    gltf: &Gltf,
    mut place: impl FnMut(usize, &Placement) -> Result<(), Trouble>,
) -> Result<(), Trouble> {
    let mut seen = vec![false; gltf.nodes.len()];
    let mut waiting = vec![];
    enter(&roots(gltf)?, &Placement::IDENTITY, &mut seen, &mut waiting)?;
    // Not by recursion: the tree may be as deep as the file is long.
    while let Some((number, parent)) = waiting.pop() {
        let node: &Node = &gltf.nodes[number];
        let placement = parent.then_local(&Placement::of(node));
        if let Some(mesh) = node.mesh {
            place(mesh, &placement).map_err(|trouble| match trouble {
                Trouble::Part(part, why) => Trouble::Part(format!("node {number}, {part}"), why),
                other => other,
            })?;
        }
        enter(&node.children, &placement, &mut seen, &mut waiting)?;
    }
    Ok(())
}

/// The parts placed so far.
struct Surface<'a> {
    gltf: &'a Gltf<'a>,
    /// There may be fewer colours than positions: the rest are white.
    parts: Parts,
    /// Final numbers of vertices and faces.
    most: [usize; 2],
    /// The reason to omit all colours, if there is one.
    colours: Result<(), Trouble>,
    /// If a texture is wanted: the texture so far, or its error.
    unwrapped: Option<Result<Unwrapped, Trouble>>,
}

impl Surface<'_> {
    /// Adds a mesh.
    fn add(&mut self, mesh: usize, placement: &Placement) -> Result<(), Trouble> {
        let mut firsts = HashMap::new();
        let primitives = primitives(self.gltf, mesh)?;
        let factors = factors(self.gltf, primitives);
        for (number, primitive) in primitives.iter().enumerate() {
            let at = at(mesh, number);
            let Some(accessor) = surface_of(primitive).map_err(&at)? else { continue };
            let vertices = self.gltf.count(accessor).map_err(&at)?;
            let first = match firsts.entry(shared(accessor, primitive)) {
                Entry::Occupied(first) => *first.get(),
                Entry::Vacant(entry) => {
                    let first = *entry.insert(self.parts.positions.len());
                    self.add_vertices(accessor, placement).map_err(&at)?;
                    self.add_colours(&primitive.attributes.colour, factors[number], first, &at);
                    first
                }
            };
            let triangles =
                self.add_triangles(primitive, first, vertices, placement).map_err(&at)?;
            let [_, faces] = self.most;
            let part = Part { primitive, triangles: &triangles, vertices, lit: factors[number] };
            if let Some(Ok(unwrapped)) = &mut self.unwrapped
                && let Err(trouble) = unwrapped.add(self.gltf, &part, faces)
            {
                self.unwrapped = Some(Err(at(trouble)));
            }
        }
        Ok(())
    }

    fn add_vertices(&mut self, accessor: usize, placement: &Placement) -> Result<(), Trouble> {
        for (vertex, p) in self.gltf.positions(accessor)?.iter().enumerate() {
            let position = placement.apply(*p);
            finite(position).map_err(|why| Trouble::Part(format!("vertex {vertex}"), why))?;
            self.parts.positions.push(position);
        }
        Ok(())
    }

    /// Adds the triangles of a part after the `first` vertices; returns those of its indices, with the winding of the placement.
    fn add_triangles(
        &mut self,
        primitive: &Primitive,
        first: usize,
        vertices: usize,
        placement: &Placement,
    ) -> Result<Vec<[u32; 3]>, Trouble> {
        let indices = match primitive.indices {
            Some(indices) => self.gltf.indices(indices)?,
            // At most 2³² vertices have passed the check.
            None => (0..vertices as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|&&index| index as usize >= vertices) {
            return Err(Trouble::Part(
                String::new(),
                Fault::OutOfRange { index: index.to_string(), vertices },
            ));
        }
        if primitive.mode == 4 && indices.len() % 3 != 0 {
            let reason = format!("{} corners do not make whole triangles", indices.len());
            return Err(Trouble::part("", reason));
        }
        let mut triangles = triangles(primitive.mode, &indices);
        if placement.mirrors() {
            triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let first = first as u32;
        self.parts.faces.extend(triangles.iter().map(|triangle| triangle.map(|v| first + v)));
        Ok(triangles)
    }

    /// Adds the colours of all vertices after the `first`, or drops those of the whole file.
    fn add_colours(
        &mut self,
        accessor: &Value,
        factor: [f64; 3],
        first: usize,
        at: impl Fn(Trouble) -> Trouble,
    ) {
        if self.colours.is_err() || accessor.is_null() && factor == WHITE {
            return;
        }
        let vertices = self.parts.positions.len() - first;
        let own = match accessor.is_null() {
            true => Ok((vec![WHITE; vertices], None)),
            false => self.settled_colours(accessor, vertices),
        };
        match own {
            Ok((linear, warning)) => {
                let [vertices, _] = self.most;
                let colours =
                    self.parts.colours.get_or_insert_with(|| Vec::with_capacity(vertices));
                colours.resize(first, WHITE);
                // Linear: glTF 2.0 specification, Sec. 3.7.2.1.
                let shown =
                    |colour: [f64; 3]| [0, 1, 2].map(|k| from_linear(colour[k] * factor[k]));
                colours.extend(linear.into_iter().map(shown));
                if self.parts.warnings.is_empty() {
                    self.parts.warnings.extend(warning.map(at));
                }
            }
            Err(trouble) => self.colours = Err(at(trouble)),
        }
    }

    /// The linear colours of `vertices` vertices, from 0 to 1, and a warning; or the reason to omit colours.
    fn settled_colours(
        &self,
        accessor: &Value,
        vertices: usize,
    ) -> Result<(Vec<[f64; 3]>, Option<Trouble>), Trouble> {
        let left_out = |trouble| match trouble {
            Trouble::Part(part, why) => {
                Trouble::part(part, format!("{why}: the colours are left out"))
            }
            other => other,
        };
        let wrong = |reason: String| Err(left_out(Trouble::part("", reason)));
        let Some(accessor) = number(accessor) else {
            return wrong(format!("COLOR_0 is no accessor: {}", shown(&accessor.to_string())));
        };
        let (linear, full, is_said) = self.gltf.colours(accessor).map_err(left_out)?;
        if linear.len() != vertices {
            return wrong(format!("{} colours for {vertices} vertices", linear.len()));
        }
        // Source: glTF 2.0 specification, Sec. 3.7.2.1: components must be clamped.
        let mut colours = Colours::new([full; 3], Beyond::Clamped);
        for (vertex, channels) in linear.into_iter().enumerate() {
            colours.push(channels, || Place::Part(format!("vertex {vertex}")));
        }
        match colours.settled() {
            (Some(linear), warning) => {
                let unsaid = || {
                    let reason =
                        format!("colours are not normalized: they are taken as 0 to {full}");
                    Trouble::part(format!("accessor {accessor}"), reason)
                };
                Ok((linear, warning.or_else(|| (!is_said).then(unsaid))))
            }
            (None, Some(warning)) => Err(warning),
            (None, None) => wrong("no colours".to_owned()),
        }
    }
}

/// The triangles of a list (mode 4), a strip (5) or a fan (6).
fn triangles(mode: u64, indices: &[u32]) -> Vec<[u32; 3]> {
    let windows = indices.windows(3).enumerate();
    match mode {
        4 => indices.as_chunks().0.to_vec(),
        // Every other triangle of a strip has the reverse order of corners.
        5 => windows
            .map(|(i, w)| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] })
            .collect(),
        _ => indices.windows(2).skip(1).map(|w| [indices[0], w[0], w[1]]).collect(),
    }
}
