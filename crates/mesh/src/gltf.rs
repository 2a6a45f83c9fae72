//! What a GLB file says of its geometry: the JSON of glTF 2.0, and the numbers it refers to.
//!
//! Read by code of our own: the crate for it panics on some lengths and strides that the format
//! forbids, and refuses whole files for materials that it does not know.

use serde::Deserialize;
use serde_json::Value;

use crate::error::Trouble;

/// Everything else in the JSON is skipped.
#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Gltf {
    pub(crate) scene: Option<usize>,
    pub(crate) scenes: Vec<Scene>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) meshes: Vec<Mesh>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Buffer>,
    pub(crate) extensions_required: Vec<String>,
    /// What a mesh can do without is looked at only where it is asked for.
    pub(crate) materials: Value,
    pub(crate) textures: Value,
    pub(crate) images: Value,
}

#[derive(Deserialize)]
pub(crate) struct Scene {
    #[serde(default)]
    pub(crate) nodes: Vec<usize>,
}

#[derive(Deserialize)]
pub(crate) struct Node {
    pub(crate) mesh: Option<usize>,
    #[serde(default)]
    pub(crate) children: Vec<usize>,
    /// Column by column.
    pub(crate) matrix: Option<[f64; 16]>,
    pub(crate) translation: Option<[f64; 3]>,
    /// x, y, z, w.
    pub(crate) rotation: Option<[f64; 4]>,
    pub(crate) scale: Option<[f64; 3]>,
}

#[derive(Deserialize)]
pub(crate) struct Mesh {
    pub(crate) primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
pub(crate) struct Primitive {
    pub(crate) attributes: Attributes,
    pub(crate) indices: Option<usize>,
    #[serde(default = "triangles")]
    pub(crate) mode: u64,
    #[serde(default)]
    pub(crate) material: Value,
}

fn triangles() -> u64 {
    4
}

#[derive(Deserialize)]
pub(crate) struct Attributes {
    #[serde(rename = "POSITION")]
    pub(crate) position: Option<usize>,
    #[serde(rename = "COLOR_0")]
    pub(crate) colour: Option<usize>,
    #[serde(rename = "TEXCOORD_0", default)]
    pub(crate) coordinates: Value,
    #[serde(rename = "TEXCOORD_1", default)]
    pub(crate) more_coordinates: Value,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u64,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    shape: String,
    sparse: Option<Sparse>,
}

/// Entries that differ from those of the view.
#[derive(Deserialize)]
struct Sparse {
    count: usize,
    indices: Part,
    values: Part,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Part {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: usize,
    component_type: Option<u64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Deserialize)]
struct Buffer {
    uri: Option<serde::de::IgnoredAny>,
}

/// The types that glTF numbers from 5120.
#[derive(Clone, Copy)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: u64) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    fn can_index(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }

    /// The value of as many bytes as the type takes; every value of every type fits.
    fn value(self, bytes: &[u8], normalized: bool) -> f64 {
        let mut low = [0; 4];
        low[..bytes.len()].copy_from_slice(bytes);
        let [a, b, ..] = low;
        let (value, most): (f64, f64) = match self {
            Self::I8 => (i8::from_le_bytes([a]).into(), i8::MAX.into()),
            Self::U8 => (a.into(), u8::MAX.into()),
            Self::I16 => (i16::from_le_bytes([a, b]).into(), i16::MAX.into()),
            Self::U16 => (u16::from_le_bytes([a, b]).into(), u16::MAX.into()),
            Self::U32 => (u32::from_le_bytes(low).into(), 1.0),
            Self::F32 => (f32::from_le_bytes(low).into(), 1.0),
        };
        if normalized { (value / most).max(-1.0) } else { value }
    }
}

impl Gltf {
    /// How many entries the accessor claims.
    pub(crate) fn count(&self, accessor: usize) -> Result<usize, Trouble> {
        let missing = || Trouble::part(format!("accessor {accessor}"), "there is none");
        Ok(self.accessors.get(accessor).ok_or_else(missing)?.count)
    }

    /// The entries of an accessor of 3-vectors; `bin` is the binary chunk.
    pub(crate) fn positions(
        &self,
        accessor: usize,
        bin: Option<&[u8]>,
    ) -> Result<Vec<[f64; 3]>, Trouble> {
        let count = self.count(accessor)?;
        let it = &self.accessors[accessor];
        let values = if it.shape == "VEC3" {
            self.values(it, count, bin)
        } else {
            Err(format!("positions are of type VEC3, not {:?}", it.shape))
        };
        values.map_err(|reason| Trouble::part(format!("accessor {accessor}"), reason))
    }

    /// The entries of an accessor of linear colours, without transparency; `bin` is the binary chunk.
    pub(crate) fn colours(
        &self,
        accessor: usize,
        bin: Option<&[u8]>,
    ) -> Result<Vec<[f64; 3]>, Trouble> {
        let count = self.count(accessor)?;
        let it = &self.accessors[accessor];
        let share = match Component::of(it.component_type) {
            Some(Component::F32) => true,
            Some(Component::U8 | Component::U16) => it.normalized,
            _ => false,
        };
        let values =
            match (share, it.shape.as_str()) {
                (true, "VEC3") => self.values(it, count, bin),
                (true, "VEC4") => self
                    .values(it, count, bin)
                    .map(|all| all.into_iter().map(|[r, g, b, _]| [r, g, b]).collect()),
                _ => Err("colours are VEC3 or VEC4 of floats or of normalized bytes or shorts"
                    .to_owned()),
            };
        values.map_err(|reason| Trouble::part(format!("accessor {accessor}"), reason))
    }

    /// The entries of an accessor of texture coordinates, v down; `bin` is the binary chunk.
    pub(crate) fn coordinates(
        &self,
        accessor: usize,
        bin: Option<&[u8]>,
    ) -> Result<Vec<[f64; 2]>, Trouble> {
        let count = self.count(accessor)?;
        let it = &self.accessors[accessor];
        let values = if it.shape == "VEC2" {
            self.values(it, count, bin)
        } else {
            Err(format!("texture coordinates are of type VEC2, not {:?}", it.shape))
        };
        values.map_err(|reason| Trouble::part(format!("accessor {accessor}"), reason))
    }

    /// A buffer view, and its bytes if they are there.
    pub(crate) fn view<'a>(
        &self,
        number: usize,
        bin: Option<&'a [u8]>,
    ) -> Result<(&View, Option<&'a [u8]>), String> {
        let view = self.buffer_views.get(number);
        let view = view.ok_or_else(|| format!("there is no buffer view {number}"))?;
        let buffer = self.buffers.get(view.buffer);
        let buffer = buffer.ok_or_else(|| format!("there is no buffer {}", view.buffer))?;
        if buffer.uri.is_some() {
            let reason = "lies outside of the binary chunk: export it as one .glb file";
            return Err(format!("buffer {} {reason}", view.buffer));
        }
        let bin = bin.filter(|_| view.buffer == 0);
        let bin = bin.ok_or_else(|| {
            let reason = "has no binary chunk: export it without compression";
            format!("buffer {} {reason}", view.buffer)
        })?;
        let end = view.byte_offset.checked_add(view.byte_length);
        Ok((view, end.and_then(|end| bin.get(view.byte_offset..end))))
    }

    /// The entries of an accessor of vertex indices; `bin` is the binary chunk.
    pub(crate) fn indices(&self, accessor: usize, bin: Option<&[u8]>) -> Result<Vec<u32>, Trouble> {
        let count = self.count(accessor)?;
        let it = &self.accessors[accessor];
        let whole = Component::of(it.component_type).is_some_and(Component::can_index);
        let values = if it.shape == "SCALAR" && whole && !it.normalized {
            self.values(it, count, bin)
        } else {
            Err("indices are single whole numbers of 8, 16 or 32 bits without a sign".to_owned())
        };
        let values = values.map_err(|why| Trouble::part(format!("accessor {accessor}"), why))?;
        Ok(values.into_iter().map(|[index]| index as u32).collect())
    }

    fn values<const N: usize>(
        &self,
        accessor: &Accessor,
        count: usize,
        bin: Option<&[u8]>,
    ) -> Result<Vec<[f64; N]>, String> {
        let part = |view, offset, component| Source { view, offset, component, bin };
        let component = component(accessor.component_type)?;
        if accessor.normalized && matches!(component, Component::F32 | Component::U32) {
            return Err("floats and 32-bit integers cannot be normalized".to_owned());
        }
        let read = |bytes: [&[u8]; N]| bytes.map(|b| component.value(b, accessor.normalized));
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let source = part(view, accessor.byte_offset, component);
                source.entries(self, count)?.map(read).collect()
            }
            // Such entries are zero. They take no bytes, so their number could be anything.
            None if accessor.sparse.is_some() && count <= bin.map_or(0, <[u8]>::len) => {
                vec![[0.0; N]; count]
            }
            None => {
                let reason = "no bytes for them: export it without compression";
                return Err(format!("{count} entries, but {reason}"));
            }
        };
        if let Some(Sparse { count: changed, indices, values: new }) = &accessor.sparse {
            let code = indices.component_type.unwrap_or_default();
            let whole = self::component(code)?;
            if !whole.can_index() {
                return Err(format!("component type {code} cannot be an index"));
            }
            let places = part(indices.buffer_view, indices.byte_offset, whole);
            let entries = part(new.buffer_view, new.byte_offset, component);
            let places = places.entries::<1>(self, *changed)?;
            for ([place], entry) in places.zip(entries.entries(self, *changed)?) {
                let place = whole.value(place, false) as usize;
                let value = values.get_mut(place);
                *value.ok_or(format!("sparse index {place} is out of range: {count} entries"))? =
                    read(entry);
            }
        }
        Ok(values)
    }
}

fn component(code: u64) -> Result<Component, String> {
    Component::of(code).ok_or_else(|| format!("{code} is not a component type of glTF"))
}

/// Where entries of equal size lie one after the other.
struct Source<'a> {
    view: usize,
    offset: usize,
    component: Component,
    bin: Option<&'a [u8]>,
}

impl<'a> Source<'a> {
    /// The bytes of `count` entries of `N` components each, once it is sure that they are there.
    fn entries<const N: usize>(
        &self,
        gltf: &Gltf,
        count: usize,
    ) -> Result<impl Iterator<Item = [&'a [u8]; N]> + use<'a, N>, String> {
        let Self { view: number, offset, component, bin } = *self;
        let (view, bytes) = gltf.view(number, bin)?;
        let size = component.size();
        let stride = view.byte_stride.unwrap_or(N * size);
        if stride < N * size {
            return Err(format!("a stride of {stride} bytes for entries of {} bytes", N * size));
        }

        let length =
            count.checked_sub(1).map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(N * size));
        let bytes = bytes.and_then(|bytes| bytes.get(offset..)?.get(..length?));
        let bytes = bytes.ok_or_else(|| {
            format!("{count} entries reach beyond the binary chunk or buffer view {number}")
        })?;
        Ok(bytes
            .chunks(stride)
            .map(move |entry| std::array::from_fn(|k| &entry[k * size..(k + 1) * size])))
    }
}
