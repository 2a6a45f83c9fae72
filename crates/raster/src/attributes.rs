use std::sync::Arc;

use burn::tensor::{Tensor, backend::Backend};

/// What faces show: numbers at their corners, as many channels as you like, interpolated between them in perspective.
///
/// Colours are one case. Normals, coordinates on a texture, or the depth of the vertices are others; where each corner of each face has an
/// entry of its own, so are barycentric coordinates.
///
/// ```
/// use burn::{backend::NdArray, tensor::Tensor};
/// use softrast_raster::Attributes;
///
/// let faces = [[0, 1, 2], [2, 1, 3]];
/// let colours = Tensor::<NdArray, 3>::zeros([1, 4, 3], &Default::default()); // red, green and blue of four vertices
/// assert_eq!(Attributes::of_vertices(colours, &faces).channels(), 3);
/// ```
#[derive(Clone, Debug)]
pub struct Attributes<B: Backend> {
    pub(crate) values: Tensor<B, 3>,
    pub(crate) entries: Arc<[[u32; 3]]>,
}

impl<B: Backend> Attributes<B> {
    /// `values` `[1 or views, entries, channels]`, and the entry at each corner of each face.
    ///
    /// # Panics
    ///
    /// If there is no channel, or a face has an entry that is not there.
    pub fn new(values: Tensor<B, 3>, entries: Arc<[[u32; 3]]>) -> Self {
        let [_, count, channels] = values.dims();
        assert!(channels > 0, "attributes need a channel, found {:?}", values.dims());
        let largest = entries.iter().flatten().max().map_or(0, |&entry| entry as usize + 1);
        assert!(largest <= count, "a corner has entry {}, but there are {count}", largest - 1);
        Self { values, entries }
    }

    /// One entry for each vertex: `[1 or views, vertices, channels]`.
    ///
    /// # Panics
    ///
    /// If there is no channel, or a face uses a vertex that has none.
    pub fn of_vertices(values: Tensor<B, 3>, faces: &[[u32; 3]]) -> Self {
        Self::new(values, faces.into())
    }

    /// One entry for each face, the same all over it: `[1 or views, faces, channels]`.
    ///
    /// # Panics
    ///
    /// If there is no channel.
    pub fn of_faces(values: Tensor<B, 3>) -> Self {
        let entries = (0..values.dims()[1] as u32).map(|face| [face; 3]).collect();
        Self::new(values, entries)
    }

    /// One entry for each corner of each face: `[1 or views, 3 faces, channels]`, those of the first face first.
    ///
    /// # Panics
    ///
    /// If there is no channel, or the entries are not three for each face.
    pub fn of_corners(values: Tensor<B, 3>) -> Self {
        let [_, corners, _] = values.dims();
        assert!(corners.is_multiple_of(3), "{corners} entries are not three for each face");
        let entries = (0..corners as u32 / 3).map(|face| [0, 1, 2].map(|k| 3 * face + k)).collect();
        Self::new(values, entries)
    }

    /// Other numbers at the same places, of the same shape or not.
    ///
    /// # Panics
    ///
    /// If there is no channel, or a face has an entry that is not there.
    #[must_use]
    pub fn with_values(&self, values: Tensor<B, 3>) -> Self {
        Self::new(values, self.entries.clone())
    }

    /// The numbers, `[1 or views, entries, channels]`.
    pub fn values(&self) -> &Tensor<B, 3> {
        &self.values
    }

    /// Numbers of an entry.
    pub fn channels(&self) -> usize {
        self.values.dims()[2]
    }
}
