//! The parts of the meshes of a glTF file: surfaces, shared vertices, and size limits.

use std::collections::{HashMap, HashSet};

use serde_json::Value;

use crate::{
    error::Trouble,
    gltf::{Attributes, Gltf, Primitive, entry},
};

/// Limit of placed vertices, and of faces, since a small file can place a mesh many times; or twice the bytes of the file, which is enough
/// for every file that places each of its meshes once. Vertices with colours count twice, and so do faces with a texture.
const MOST_PLACED: u64 = 20_000_000;
/// Limit of placed parts of meshes, including empty ones.
const MOST_PARTS: u64 = 1_000_000;

/// The parts of a mesh.
pub(crate) fn primitives<'a>(gltf: &'a Gltf, mesh: usize) -> Result<&'a [Primitive], Trouble> {
    let missing = || Trouble::part(format!("mesh {mesh}"), "there is none");
    Ok(&gltf.meshes.get(mesh).ok_or_else(missing)?.primitives)
}

/// Prepends a part of a mesh to the place of an error.
pub(crate) fn at(mesh: usize, primitive: usize) -> impl Fn(Trouble) -> Trouble {
    move |trouble| {
        let here = format!("mesh {mesh}, primitive {primitive}");
        match trouble {
            Trouble::Part(part, why) if part.is_empty() => Trouble::Part(here, why),
            Trouble::Part(part, why) => Trouble::Part(format!("{here}, {part}"), why),
            other => other,
        }
    }
}

/// The accessor of the positions of a part; `None` if it is not a surface.
pub(crate) fn surface_of(primitive: &Primitive) -> Result<Option<usize>, Trouble> {
    match (primitive.mode, primitive.attributes.position) {
        (0..4, _) | (4..7, None) => Ok(None),
        (4..7, Some(accessor)) => Ok(Some(accessor)),
        (mode, _) => Err(Trouble::part("", format!("{mode} is not a mode of glTF"))),
    }
}

/// Key of parts that share vertices, often with different materials: those with one accessor of positions and one of colours.
pub(crate) type Shared = (usize, Option<u64>);

pub(crate) fn shared(accessor: usize, primitive: &Primitive) -> Shared {
    (accessor, primitive.attributes.colour.as_u64())
}

/// Factors that multiply the linear colours of each part of a mesh: 1 if parts with other factors use the same vertices, since vertices
/// have one colour each.
pub(crate) fn factors(gltf: &Gltf, primitives: &[Primitive]) -> Vec<[f64; 3]> {
    let mut of_vertices = HashMap::new();
    let key = |primitive: &Primitive| Some(shared(primitive.attributes.position?, primitive));
    for primitive in primitives {
        let Some(key) = key(primitive) else { continue };
        let own = factor(gltf, primitive);
        let known = of_vertices.entry(key).or_insert(own);
        if *known != own {
            *known = [1.0; 3];
        }
    }
    let known = |primitive| key(primitive).and_then(|key| of_vertices.get(&key).copied());
    primitives.iter().map(|primitive| known(primitive).unwrap_or([1.0; 3])).collect()
}

/// The factor of a part's material for the colours of its vertices: 1 if it has a picture, which the factor multiplies instead.
fn factor(gltf: &Gltf, primitive: &Primitive) -> [f64; 3] {
    let material = entry(&gltf.materials, &primitive.material);
    match picture_of(material).is_null() {
        true => factor_of(material),
        false => [1.0; 3],
    }
}

/// The factor of a material: 1 if it has no readable one.
///
/// Source: glTF 2.0 specification, Sec. 3.9.2; `KHR_materials_pbrSpecularGlossiness`, which takes precedence.
pub(crate) fn factor_of(material: &Value) -> [f64; 3] {
    let glossy = &material["extensions"]["KHR_materials_pbrSpecularGlossiness"];
    let factor = match glossy.is_null() {
        true => &material["pbrMetallicRoughness"]["baseColorFactor"],
        false => &glossy["diffuseFactor"],
    };
    let channel = |k: usize| factor[k].as_f64().filter(|x| (0.0..=1.0).contains(x));
    match [0, 1, 2].map(channel) {
        [Some(red), Some(green), Some(blue)] => [red, green, blue],
        _ => [1.0; 3],
    }
}

/// The texture of the colours of a material.
pub(crate) fn picture_of(material: &Value) -> &Value {
    // Programs that support the extension show its picture, regardless of the fallback for others.
    let glossy = &material["extensions"]["KHR_materials_pbrSpecularGlossiness"]["diffuseTexture"];
    let rough = &material["pbrMetallicRoughness"]["baseColorTexture"];
    if glossy.is_null() { rough } else { glossy }
}

/// Numbers of placed parts, vertices and faces.
#[derive(Clone, Copy, Default)]
pub(crate) struct Room {
    parts: u64,
    vertices: u64,
    faces: u64,
    has_colours: bool,
    has_coordinates: bool,
}

impl Room {
    /// Adds another placement of a mesh.
    pub(crate) fn take(
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

    /// A mesh, after checking that all of its bytes exist.
    fn of(gltf: &Gltf, mesh: usize) -> Result<Self, Trouble> {
        let primitives = primitives(gltf, mesh)?;
        let mut room = Self { parts: primitives.len() as u64, ..Self::default() };
        let (mut seen, factors) = (HashSet::new(), factors(gltf, primitives));
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
            room.has_colours |= !colour.is_null() || factors[number] != [1.0; 3];
            room.has_coordinates |= !coordinates.is_null() || !more_coordinates.is_null();
        }
        Ok(room)
    }

    /// The numbers of vertices and faces, unless they are too large for a file of this length.
    pub(crate) fn checked(self, length: usize, textured: bool) -> Result<(usize, usize), Trouble> {
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
        // At most 2³² of either have passed the check.
        Ok((vertices as usize, faces as usize))
    }
}
