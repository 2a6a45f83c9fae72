use std::sync::Arc;

use softrast_kernel::blend::TEXEL_CHANNELS;
use softrast_tensor::{Backend, Tensor};

/// Vertex or face attributes: numbers at the corners of faces, with any number of channels, interpolated in perspective.
///
/// Colours are one use. Others are normals, the depth of the vertices, or texture coordinates, for which the texture is drawn instead
/// ([`with_texture`](Self::with_texture)); with a separate entry for each corner of each face, also barycentric coordinates.
///
/// ```
/// use softrast_tensor::{NdArray, Tensor};
/// use softrast_raster::Attributes;
///
/// let faces = [[0, 1, 2], [2, 1, 3]];
/// let colours = Tensor::<NdArray, 3>::zeros([1, 4, 3], &Default::default()); // red, green and blue of four vertices
/// assert_eq!(Attributes::of_vertices(colours, &faces).channels(), 3);
/// // One entry for each of two faces, and one for each of their six corners.
/// let entries = |count| Tensor::<NdArray, 3>::zeros([1, count, 2], &Default::default());
/// assert_eq!(Attributes::of_faces(entries(2)).values().dims(), [1, 2, 2]);
/// assert_eq!(Attributes::of_corners(entries(6)).channels(), 2);
/// ```
#[derive(Clone, Debug)]
pub struct Attributes<B: Backend> {
    pub(crate) values: Tensor<B, 3>,
    pub(crate) entries: Arc<[[u32; 3]]>,
    pub(crate) texture: Option<Tensor<B, 3>>,
}

impl<B: Backend> Attributes<B> {
    /// `values` `[1 or views, entries, channels]`, and the entry at each corner of each face.
    ///
    /// # Panics
    ///
    /// If there is no channel, or an entry of a face is out of range.
    pub fn new(values: Tensor<B, 3>, entries: Arc<[[u32; 3]]>) -> Self {
        let [_, count, channels] = values.dims();
        assert!(channels > 0, "attributes need a channel, found {:?}", values.dims());
        let largest = entries.iter().flatten().max().map_or(0, |&entry| entry as usize + 1);
        assert!(largest <= count, "a corner has entry {}, but there are {count}", largest - 1);
        Self { values, entries, texture: None }
    }

    /// One entry for each vertex: `[1 or views, vertices, channels]`.
    ///
    /// # Panics
    ///
    /// If there is no channel, or a vertex of a face has no entry.
    pub fn of_vertices(values: Tensor<B, 3>, faces: &[[u32; 3]]) -> Self {
        Self::new(values, faces.into())
    }

    /// One entry per face, constant over the face: `[1 or views, faces, channels]`.
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
    /// If there is no channel, or the number of entries is not a multiple of three.
    pub fn of_corners(values: Tensor<B, 3>) -> Self {
        let [_, corners, _] = values.dims();
        assert!(corners.is_multiple_of(3), "{corners} entries are not three for each face");
        let entries = (0..corners as u32 / 3).map(|face| [0, 1, 2].map(|k| 3 * face + k)).collect();
        Self::new(values, entries)
    }

    /// Textures the faces with a picture `[height, width, channels]`, the top row first; the two numbers of each entry are coordinates on
    /// it.
    ///
    /// The first, u, goes from 0 at the left end to 1 at the right one, the second, v, from 0 at the bottom to 1 at the top, as in an OBJ
    /// file; beyond them the picture repeats. Colours are interpolated bilinearly between the centres of texels, without mip-mapping where
    /// a texel is much smaller than a pixel. Gradients reach the picture and the coordinates. Coordinates must be finite, and small enough
    /// for the float type to resolve texels.
    ///
    /// # Panics
    ///
    /// If entries do not have two numbers, or the picture has no texel, more than 2^26 of them, or not 1 to 4 channels.
    #[must_use]
    pub fn with_texture(self, texture: Tensor<B, 3>) -> Self {
        let [.., numbers] = self.values.dims();
        assert_eq!(numbers, 2, "places on a texture are two numbers");
        let [height, width, channels] = texture.dims();
        let texels = height * width;
        assert!((1..=1 << 26).contains(&texels), "a texture of {height} x {width} texels");
        assert!(
            (1..=TEXEL_CHANNELS).contains(&channels),
            "a texture has 1 to 4 channels, not {channels}"
        );
        Self { texture: Some(texture), ..self }
    }

    /// The numbers, `[1 or views, entries, channels]`; texture coordinates if there is a texture.
    pub fn values(&self) -> &Tensor<B, 3> {
        &self.values
    }

    /// The texture, `[height, width, channels]`, if there is one.
    pub fn texture(&self) -> Option<&Tensor<B, 3>> {
        self.texture.as_ref()
    }

    /// Channels of the image.
    pub fn channels(&self) -> usize {
        let values = match &self.texture {
            Some(texture) => texture,
            None => &self.values,
        };
        values.dims()[2]
    }
}
