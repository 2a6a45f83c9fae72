//! A GLB file: binary glTF 2.0, of which the geometry, colours and a texture are read.

use std::{
    collections::{HashMap, HashSet, hash_map::Entry},
    path::Path,
};

use serde_json::Value;

use crate::{
    Fault,
    colours::{Beyond, Colours},
    error::{Place, Trouble, shown},
    glb_texture::Unwrapped,
    gltf::{Attributes, Gltf, Node, Primitive, number},
    mesh::finite,
    parts::Parts,
    placement::Placement,
};

pub(crate) const MAGIC: &[u8] = b"glTF";
pub(crate) const JSON: &[u8] = b"JSON";
pub(crate) const BIN: &[u8] = b"BIN\0";

/// A small file can place a mesh many times over. It may have this many vertices and as many faces in the end, or twice its bytes, which is more
/// than any file needs that places each of its meshes once. Vertices with colours count twice, and so do faces with a texture.
const MOST_PLACED: u64 = 20_000_000;
/// Placed parts of meshes, also empty ones.
const MOST_PARTS: u64 = 1_000_000;

/// These extensions are read as far as this reader goes.
const READ: [&str; 3] =
    ["KHR_mesh_quantization", "KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit"];

/// Extensions that start like this do not change where the triangles are.
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

/// The colour of what has none beside what has one.
const WHITE: [f64; 3] = [1.0; 3];

const NO_FACES: Trouble =
    Trouble::NoFaces("a GLB file has them in meshes of triangles at the nodes of its scene");

/// The mesh in `bytes`; see [`crate::Mesh::parse`]. With the `folder` of the file also its texture.
pub(crate) fn parse(bytes: &[u8], folder: Option<&Path>) -> Result<Parts, Trouble> {
    let (json, bin) = chunks(bytes)?;
    let gltf = Gltf::read(json, bin)?;
    let mut warnings = Vec::from_iter(required(&gltf.extensions_required)?);

    let mut room = Room::default();
    let mut prices = vec![None; gltf.meshes.len()];
    walk(&gltf, |mesh, _| room.take(&gltf, mesh, &mut prices))?;
    let (positions, faces) = room.checked(bytes.len(), folder.is_some())?;
    let mut parts = Parts::default();
    parts.positions.reserve_exact(positions);
    parts.faces.reserve_exact(faces);

    let unwrapped = folder.map(|_| Ok(Unwrapped::new(bytes.len())));
    let most = [positions, faces];
    let mut surface = Surface { gltf: &gltf, parts, most, colours: Ok(()), unwrapped };
    walk(&gltf, |mesh, placement| surface.add(mesh, placement))?;
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
        (Some(folder), Some(Ok(unwrapped))) => unwrapped.texture(&gltf, folder, &mut warnings),
        (_, Some(Err(trouble))) => {
            warnings.push(trouble);
            None
        }
        _ => None,
    };
    Ok(Parts { warnings, ..parts })
}

/// An error if an extension is required that may change where the triangles are; a warning if another one that is not read is.
fn required(extensions: &[String]) -> Result<Option<Trouble>, Trouble> {
    let wrong = |reason| Trouble::part("JSON chunk", reason);
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
            BIN if bin.is_none() => bin = Some(content),
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

/// Calls `place` with each mesh in the tree of nodes, and with where it is.
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

/// The parts of a mesh.
fn primitives<'a>(gltf: &'a Gltf, mesh: usize) -> Result<&'a [Primitive], Trouble> {
    let missing = || Trouble::part(format!("mesh {mesh}"), "there is none");
    Ok(&gltf.meshes.get(mesh).ok_or_else(missing)?.primitives)
}

/// Puts a part of a mesh before the place of a trouble.
fn at(mesh: usize, primitive: usize) -> impl Fn(Trouble) -> Trouble {
    move |trouble| {
        let here = format!("mesh {mesh}, primitive {primitive}");
        match trouble {
            Trouble::Part(part, why) if part.is_empty() => Trouble::Part(here, why),
            Trouble::Part(part, why) => Trouble::Part(format!("{here}, {part}"), why),
            other => other,
        }
    }
}

/// The accessor of the positions of a part, if it is a surface.
fn surface_of(primitive: &Primitive) -> Result<Option<usize>, Trouble> {
    match (primitive.mode, primitive.attributes.position) {
        (0..4, _) | (4..7, None) => Ok(None),
        (4..7, Some(accessor)) => Ok(Some(accessor)),
        (mode, _) => Err(Trouble::part("", format!("{mode} is not a mode of glTF"))),
    }
}

/// Parts of other materials often use the same vertices: those with one accessor of positions and one of colours do.
type Shared = (usize, Option<u64>);

fn shared(accessor: usize, primitive: &Primitive) -> Shared {
    (accessor, primitive.attributes.colour.as_u64())
}

/// The numbers of parts, vertices and faces that are placed.
#[derive(Clone, Copy, Default)]
struct Room {
    parts: u64,
    vertices: u64,
    faces: u64,
    has_colours: bool,
    has_coordinates: bool,
}

impl Room {
    /// Adds a mesh once more.
    fn take(
        &mut self,
        gltf: &Gltf,
        mesh: usize,
        prices: &mut [Option<Self>],
    ) -> Result<(), Trouble> {
        let price = match prices.get(mesh) {
            Some(&Some(price)) => price,
            _ => Self::of(gltf, mesh)?,
        };
        prices[mesh] = Some(price);
        self.parts = self.parts.saturating_add(price.parts);
        self.vertices = self.vertices.saturating_add(price.vertices);
        self.faces = self.faces.saturating_add(price.faces);
        self.has_colours |= price.has_colours;
        self.has_coordinates |= price.has_coordinates;
        Ok(())
    }

    /// A mesh whose bytes are all there.
    fn of(gltf: &Gltf, mesh: usize) -> Result<Self, Trouble> {
        let primitives = primitives(gltf, mesh)?;
        let mut room = Self { parts: primitives.len() as u64, ..Self::default() };
        let mut seen = HashSet::new();
        for (number, primitive) in primitives.iter().enumerate() {
            let mut count = || {
                let Some(accessor) = surface_of(primitive)? else { return Ok((0, 0)) };
                let vertices = gltf.sure_positions(accessor)?;
                let corners = primitive.indices.map_or(Ok(vertices), |it| gltf.sure_indices(it))?;
                let is_new = seen.insert(shared(accessor, primitive));
                let faces =
                    if primitive.mode == 4 { corners / 3 } else { corners.saturating_sub(2) };
                Ok((if is_new { vertices } else { 0 }, faces))
            };
            let (vertices, faces) = count().map_err(at(mesh, number))?;
            room.vertices = room.vertices.saturating_add(vertices as u64);
            room.faces = room.faces.saturating_add(faces as u64);
            let Attributes { colour, coordinates, more_coordinates, .. } = &primitive.attributes;
            room.has_colours |= !colour.is_null();
            room.has_coordinates |= !coordinates.is_null() || !more_coordinates.is_null();
        }
        Ok(room)
    }

    /// The numbers of vertices and faces, unless they are too many for a file of this length.
    fn checked(self, length: usize, textured: bool) -> Result<(usize, usize), Trouble> {
        let Self { parts, vertices, faces, .. } = self;
        let wrong = |reason| Err(Trouble::part("scene", reason));
        if parts > MOST_PARTS {
            return wrong(format!(
                "its nodes place {parts} parts of meshes, more than {MOST_PARTS}"
            ));
        }
        let most = MOST_PLACED.max(2 * length as u64).min(u64::from(u32::MAX));
        let of_vertex = 1 + u64::from(self.has_colours);
        let of_face = 1 + u64::from(self.has_coordinates && textured);
        if vertices > most / of_vertex || faces > most / of_face {
            return wrong(format!(
                "its nodes place {vertices} vertices and {faces} faces, more than {MOST_PLACED} with those of colours and textures counted \
                 twice: export fewer copies"
            ));
        }
        // No more than 2³² of either have been let in.
        Ok((vertices as usize, faces as usize))
    }
}

/// The parts placed so far.
struct Surface<'a> {
    gltf: &'a Gltf<'a>,
    /// Colours may be fewer than positions: those at the end are white.
    parts: Parts,
    /// Numbers of vertices and faces in the end.
    most: [usize; 2],
    /// Why the colours of all are left out, if they are.
    colours: Result<(), Trouble>,
    /// If it is to be read: the texture so far, or what is wrong with it.
    unwrapped: Option<Result<Unwrapped, Trouble>>,
}

impl Surface<'_> {
    /// Adds a mesh.
    fn add(&mut self, mesh: usize, placement: &Placement) -> Result<(), Trouble> {
        let mut firsts = HashMap::new();
        for (number, primitive) in primitives(self.gltf, mesh)?.iter().enumerate() {
            let at = at(mesh, number);
            let Some(accessor) = surface_of(primitive).map_err(&at)? else { continue };
            let vertices = self.gltf.count(accessor).map_err(&at)?;
            let first = match firsts.entry(shared(accessor, primitive)) {
                Entry::Occupied(first) => *first.get(),
                Entry::Vacant(entry) => {
                    let first = *entry.insert(self.parts.positions.len());
                    self.add_vertices(accessor, placement).map_err(&at)?;
                    self.add_colours(&primitive.attributes.colour, first, &at);
                    first
                }
            };
            let triangles =
                self.add_triangles(primitive, first, vertices, placement).map_err(&at)?;
            let [_, faces] = self.most;
            if let Some(Ok(unwrapped)) = &mut self.unwrapped
                && let Err(trouble) =
                    unwrapped.add(self.gltf, primitive, &triangles, vertices, faces)
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

    /// Adds the triangles of a part after the `first` vertices, and returns them as its indices say, wound as they are placed.
    fn add_triangles(
        &mut self,
        primitive: &Primitive,
        first: usize,
        vertices: usize,
        placement: &Placement,
    ) -> Result<Vec<[u32; 3]>, Trouble> {
        let indices = match primitive.indices {
            Some(indices) => self.gltf.indices(indices)?,
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

    /// Adds the colours of all vertices after the `first`, or gives up those of the whole file.
    fn add_colours(&mut self, accessor: &Value, first: usize, at: impl Fn(Trouble) -> Trouble) {
        if accessor.is_null() || self.colours.is_err() {
            return;
        }
        match self.settled_colours(accessor, self.parts.positions.len() - first) {
            Ok((linear, warning)) => {
                let [vertices, _] = self.most;
                let colours =
                    self.parts.colours.get_or_insert_with(|| Vec::with_capacity(vertices));
                colours.resize(first, WHITE);
                colours.extend(linear.into_iter().map(|colour| colour.map(from_linear)));
                if self.parts.warnings.is_empty() {
                    self.parts.warnings.extend(warning.map(at));
                }
            }
            Err(trouble) => self.colours = Err(at(trouble)),
        }
    }

    /// The linear colours of as many vertices, from 0 to 1, and a warning; or why colours are left out.
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
