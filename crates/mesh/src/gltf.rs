//! The geometry of a glTF or GLB file: the JSON of glTF 2.0, and the numbers it refers to.
//!
//! Not read by the `gltf` crate, which panics on some lengths and strides that the format forbids, and refuses whole files for unknown
//! materials.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use crate::{
    error::Trouble,
    gltf_buffers::{Content, Files, data},
    gltf_component::{can_index, checked_component, component, value_of},
    number::Number,
};

/// The supported part of the JSON; everything else is skipped.
#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(crate) struct Gltf<'a> {
    /// The content of each buffer, or the reason for its absence.
    #[serde(skip)]
    contents: Vec<Result<Content<'a>, String>>,
    /// Bytes in all buffers, where shared content counts once.
    #[serde(skip)]
    length: usize,
    /// Bytes in buffers in other files.
    #[serde(skip)]
    pub(crate) length_beside: usize,
    pub(crate) scene: Option<usize>,
    pub(crate) scenes: Vec<Scene>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) meshes: Vec<Mesh>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Buffer>,
    pub(crate) extensions_required: Vec<String>,
    /// Optional data, interpreted only on use.
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
    // Boxed, since the shortest text of a node is `{}`.
    /// In column-major order.
    pub(crate) matrix: Option<Box<[f64; 16]>>,
    pub(crate) translation: Option<Box<[f64; 3]>>,
    /// x, y, z, w.
    pub(crate) rotation: Option<Box<[f64; 4]>>,
    pub(crate) scale: Option<Box<[f64; 3]>>,
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
    #[serde(rename = "COLOR_0", default)]
    pub(crate) colour: Value,
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
    uri: Option<String>,
}

/// The index of an entry in a list.
pub(crate) fn number(value: &Value) -> Option<usize> {
    value.as_u64().and_then(|number| usize::try_from(number).ok())
}

/// The entry of a list with this index; `Null` if there is none.
pub(crate) fn entry<'a>(list: &'a Value, of: &Value) -> &'a Value {
    number(of).and_then(|number| list.get(number)).unwrap_or(&Value::Null)
}

impl<'a> Gltf<'a> {
    /// The content of the JSON; `bin` is the binary chunk. With the `folder` of the file also buffers in other files.
    pub(crate) fn read(
        json: &[u8],
        bin: Option<&'a [u8]>,
        folder: Option<&Path>,
    ) -> Result<Self, Trouble> {
        let mut gltf: Self = serde_json::from_slice(json)
            .map_err(|reason| Trouble::part("JSON", reason.to_string()))?;
        let mut files = Files::default();
        let content = |(number, buffer): (usize, Buffer)| match (buffer.uri, bin) {
            (Some(uri), _) => match data(&uri) {
                Some(Some(bytes)) => Ok(Content::Own(bytes.into())),
                Some(None) => Err("is a data URI that is not base64".to_owned()),
                None => files.read(folder, &uri).map(Content::Own),
            },
            (None, Some(bin)) if number == 0 => Ok(Content::Chunk(bin)),
            (None, _) => Err("has no binary chunk: export it without compression".to_owned()),
        };
        let buffers = std::mem::take(&mut gltf.buffers);
        gltf.contents = buffers.into_iter().enumerate().map(content).collect();
        gltf.length_beside = files.length;
        gltf.length = bin.map_or(0, <[u8]>::len) + json.len() + files.length;
        Ok(gltf)
    }

    /// The result of `read` for the accessor with this number; errors include the number.
    fn of_accessor<T>(
        &self,
        number: usize,
        read: impl FnOnce(&Accessor) -> Result<T, String>,
    ) -> Result<T, Trouble> {
        let accessor = self.accessors.get(number).ok_or_else(|| "there is none".to_owned());
        accessor.and_then(read).map_err(|why| Trouble::part(format!("accessor {number}"), why))
    }

    /// The number of entries according to the accessor.
    pub(crate) fn count(&self, accessor: usize) -> Result<usize, Trouble> {
        self.of_accessor(accessor, |it| Ok(it.count))
    }

    /// The entries of an accessor of 3-vectors.
    pub(crate) fn positions(&self, accessor: usize) -> Result<Vec<[f64; 3]>, Trouble> {
        self.of_accessor(accessor, |it| {
            Self::are_positions(it)?;
            self.values(it, it.normalized)
        })
    }

    fn are_positions(accessor: &Accessor) -> Result<(), String> {
        match accessor.shape.as_str() {
            "VEC3" => Ok(()),
            shape => Err(format!("positions are of type VEC3, not {shape:?}")),
        }
    }

    /// The entries of an accessor of linear colours, without alpha; the value that stands for 1; and whether the accessor declares it.
    pub(crate) fn colours(&self, accessor: usize) -> Result<(Vec<[f64; 3]>, f64, bool), Trouble> {
        self.of_accessor(accessor, |it| {
            let (full, said) = match component(it.component_type) {
                Some(Number::U8) => (f64::from(u8::MAX), it.normalized),
                Some(Number::U16) => (f64::from(u16::MAX), it.normalized),
                Some(Number::F32) => (1.0, true),
                _ => return Err("colours are floats, or bytes or shorts without a sign".to_owned()),
            };
            let values = match it.shape.as_str() {
                "VEC3" => self.values(it, false)?,
                "VEC4" => {
                    self.values(it, false)?.into_iter().map(|[r, g, b, _]| [r, g, b]).collect()
                }
                shape => return Err(format!("colours are of type VEC3 or VEC4, not {shape:?}")),
            };
            Ok((values, full, said))
        })
    }

    /// The entries of an accessor of texture coordinates, v down.
    pub(crate) fn coordinates(&self, accessor: usize) -> Result<Vec<[f64; 2]>, Trouble> {
        self.of_accessor(accessor, |it| match it.shape.as_str() {
            "VEC2" => self.values(it, it.normalized),
            shape => Err(format!("texture coordinates are of type VEC2, not {shape:?}")),
        })
    }

    /// A buffer view, and its bytes if they are there.
    pub(crate) fn view(&self, number: usize) -> Result<(&View, Option<&[u8]>), String> {
        let view = self.buffer_views.get(number);
        let view = view.ok_or_else(|| format!("there is no buffer view {number}"))?;
        let content = self.contents.get(view.buffer);
        let content = content.ok_or_else(|| format!("there is no buffer {}", view.buffer))?;
        let content =
            content.as_ref().map_err(|reason| format!("buffer {} {reason}", view.buffer))?;
        let content = content.bytes();
        let end = view.byte_offset.checked_add(view.byte_length);
        Ok((view, end.and_then(|end| content.get(view.byte_offset..end))))
    }

    /// The number of positions of an accessor, after checking that their bytes exist.
    pub(crate) fn sure_positions(&self, accessor: usize) -> Result<usize, Trouble> {
        self.sure::<3>(accessor, Self::are_positions)
    }

    /// The number of vertex indices of an accessor, after checking that their bytes exist.
    pub(crate) fn sure_indices(&self, accessor: usize) -> Result<usize, Trouble> {
        self.sure::<1>(accessor, Self::are_indices)
    }

    fn sure<const N: usize>(
        &self,
        accessor: usize,
        check: impl Fn(&Accessor) -> Result<(), String>,
    ) -> Result<usize, Trouble> {
        self.of_accessor(accessor, |it| {
            check(it)?;
            match self.source(it)? {
                Some(source) => source.entries::<N>(self, it.count).map(|_| it.count),
                None => Ok(it.count),
            }
        })
    }

    /// Location of the entries of an accessor; `None` if they are zero, except sparse ones.
    fn source(&self, accessor: &Accessor) -> Result<Option<Source>, String> {
        let (component, count) = (checked_component(accessor.component_type)?, accessor.count);
        match accessor.buffer_view {
            Some(view) => Ok(Some(Source { view, offset: accessor.byte_offset, component })),
            // Such entries take no bytes, so their number must be bounded.
            None if accessor.sparse.is_some() && count <= self.length => Ok(None),
            None => {
                let reason = "no bytes for them: export it without compression";
                Err(format!("{count} entries, but {reason}"))
            }
        }
    }

    /// The entries of an accessor of vertex indices.
    pub(crate) fn indices(&self, accessor: usize) -> Result<Vec<u32>, Trouble> {
        self.of_accessor(accessor, |it| {
            Self::are_indices(it)?;
            Ok(self.values(it, false)?.into_iter().map(|[index]| index as u32).collect())
        })
    }

    fn are_indices(accessor: &Accessor) -> Result<(), String> {
        let whole = component(accessor.component_type).is_some_and(can_index);
        if accessor.shape == "SCALAR" && whole && !accessor.normalized {
            return Ok(());
        }
        Err("indices are single whole numbers of 8, 16 or 32 bits without a sign".to_owned())
    }

    fn values<const N: usize>(
        &self,
        accessor: &Accessor,
        normalized: bool,
    ) -> Result<Vec<[f64; N]>, String> {
        let count = accessor.count;
        let component = checked_component(accessor.component_type)?;
        if normalized && matches!(component, Number::F32 | Number::U32) {
            return Err("floats and 32-bit integers cannot be normalized".to_owned());
        }
        let read = |bytes: [&[u8]; N]| bytes.map(|b| value_of(component, b, normalized));
        let mut values = match self.source(accessor)? {
            Some(source) => source.entries(self, count)?.map(read).collect(),
            None => vec![[0.0; N]; count],
        };
        if let Some(Sparse { count: changed, indices, values: new }) = &accessor.sparse {
            if *changed > count {
                return Err(format!("{changed} sparse entries of {count}"));
            }
            let code = indices.component_type.unwrap_or_default();
            let whole = checked_component(code)?;
            if !can_index(whole) {
                return Err(format!("component type {code} cannot be an index"));
            }
            let part = |part: &Part, component| Source {
                view: part.buffer_view,
                offset: part.byte_offset,
                component,
            };
            let (places, entries) = (part(indices, whole), part(new, component));
            let places = places.entries::<1>(self, *changed)?;
            for ([place], entry) in places.zip(entries.entries(self, *changed)?) {
                let place = value_of(whole, place, false) as usize;
                let value = values.get_mut(place);
                *value.ok_or(format!("sparse index {place} is out of range: {count} entries"))? =
                    read(entry);
            }
        }
        Ok(values)
    }
}

/// Location of contiguous or strided entries of equal size.
struct Source {
    view: usize,
    offset: usize,
    component: Number,
}

impl Source {
    /// The bytes of `count` entries of `N` components each, after checking that they exist.
    fn entries<'a, const N: usize>(
        &self,
        gltf: &'a Gltf,
        count: usize,
    ) -> Result<impl Iterator<Item = [&'a [u8]; N]> + use<'a, N>, String> {
        let Self { view: number, offset, component } = *self;
        let (view, bytes) = gltf.view(number)?;
        let size = component.size();
        let stride = view.byte_stride.unwrap_or(N * size);
        if stride < N * size {
            return Err(format!("a stride of {stride} bytes for entries of {} bytes", N * size));
        }

        let length =
            count.checked_sub(1).map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(N * size));
        let bytes = bytes.and_then(|bytes| bytes.get(offset..)?.get(..length?));
        let bytes = bytes.ok_or_else(|| {
            format!("{count} entries reach beyond buffer {} or buffer view {number}", view.buffer)
        })?;
        Ok(bytes
            .chunks(stride)
            .map(move |entry| std::array::from_fn(|k| &entry[k * size..(k + 1) * size])))
    }
}
