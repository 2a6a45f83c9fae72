//! Inputs of a walk in colour, in one number type.

use super::{
    depth::{DepthGrid, DepthLookup},
    point::AREA,
    texture::{TexelSums, Texture},
};
use crate::{
    ImageSize,
    bands::View,
    float,
    lanes::Lanes,
    real::{Float, Real, Table, everywhere},
    scene::Scene,
    table::Grid,
};

/// An edge softness that exceeds its floor by at most this fraction of it is 0: rounding errors are as large.
pub const NOTHING: f64 = 1e-4;

/// The logarithm of an edge softness above which it exceeds its floor by more than rounding errors; minus infinity without a floor.
///
/// ```
/// use softrast_kernel::blend::counts_from;
///
/// assert_eq!(counts_from(0.0), f64::NEG_INFINITY);
/// assert!(counts_from(1e-7) > 1e-7_f64.ln());
/// ```
pub fn counts_from(floor: f64) -> f64 {
    (floor / (1.0 - NOTHING)).ln()
}

/// Relative weights below these (f32, f64) are flushed to 0; they are far below the rounding error of the sum.
const VANISHING: [f64; 2] = [1e-36, 1e-300];

/// The inputs of means of colours, in one float type.
#[derive(Clone, Copy)]
pub struct Inputs<'a, F> {
    /// `[views, 3, vertices]`: x and y in NDC, depth.
    pub vertices: &'a [F],
    /// `[1 or views, entries, channels]`; with a texture, coordinates on it, `[1 or views, entries, 2]`.
    pub attributes: &'a [F],
    /// `[rows, 4]`: minus the logarithms of the edge weights, then of the depth weights.
    pub tables: &'a [F],
    /// `[channels + 1]`: the colour, then the logarithm of the weight.
    pub background: &'a [F],
    /// `[rows, columns, 4]`, or empty.
    pub texture: &'a [F],
    /// Rows and columns of the texture, if there is one.
    pub texture_size: Option<[usize; 2]>,
    /// Vertices of each face.
    pub faces: &'a [[u32; 3]],
    /// Entries of the attributes at the corners of each face.
    pub entries: &'a [[u32; 3]],
    /// Layout of the table of the edge softness, mirrored: the inner side is outside a face.
    pub edge: Grid,
    /// Source of the depth weights.
    pub depth: DepthGrid,
    /// The floor of the edge softness.
    pub floor: f64,
    /// Depths of nearness 1 and 0.
    pub planes: [f64; 2],
    /// Height and width of the image.
    pub size: ImageSize,
    /// Least depth in world units; a face with a corner below it is not drawn.
    pub near: f64,
    /// Greatest depth in world units; a face with a corner beyond it is not drawn.
    pub far: f64,
    /// Bound of the sum of all weights culled at a pixel, relative to the background's weight.
    pub tolerance: f64,
    /// Whether back faces, whose corners appear in clockwise order, are culled.
    pub culls: bool,
    /// Number of views.
    pub views: usize,
    /// Whether all views share the attributes.
    pub shared: bool,
}

impl<'a, F: float::Float> Inputs<'a, F> {
    /// Channels of the image, except the faces' share.
    pub(crate) fn channels(&self) -> usize {
        self.background.len() - 1
    }

    /// Numbers per entry of the attributes.
    fn numbers(&self) -> usize {
        if self.texture_size.is_some() { 2 } else { self.channels() }
    }

    /// Rows of both tables, or of their tangents.
    pub(super) fn split_tables<'b>(&self, tables: &'b [F]) -> (&'b [[F; 4]], &'b [[F; 4]]) {
        let rows: &[[F; 4]] = tables.as_chunks().0;
        rows.split_at(self.edge.rows().min(rows.len()))
    }

    /// The inputs of a walk; `tangents` are those of vertices, attributes, tables, background and texture, or empty.
    pub(super) fn blend<'s, T>(&'s self, tangents: [&'s [F]; 5]) -> Blend<'s, T>
    where
        T: Real,
        T::Lanes: Lanes<Float = F>,
    {
        let values = self.split_tables(self.tables);
        let along = self.split_tables(tangents[2]);
        let edge = Table { values: values.0, tangents: along.0 };
        let depth = Table { values: values.1, tangents: along.1 };
        let vertices = [self.vertices, tangents[0]];
        let half = 0.5 * self.size.shorter() as f64;
        Blend {
            least_area: F::from_f64(AREA * half * half),
            vanishing: F::from_f64(of_type::<F>(VANISHING)),
            scene: Scene::new(vertices, self.faces, edge, self.edge, self.size),
            attributes: [self.attributes, tangents[1]],
            entries: self.entries,
            channels: self.channels(),
            numbers: self.numbers(),
            texture: self.texture_size.map(|size| Texture {
                size,
                texels: Table {
                    values: self.texture.as_chunks().0,
                    tangents: tangents[4].as_chunks().0,
                },
            }),
            per_view: if self.shared { 0 } else { self.attributes.len() / self.views.max(1) },
            depth: DepthLookup::new(self.depth, depth),
            near: F::from_f64(self.planes[0]),
            per_range: F::from_f64((self.planes[1] - self.planes[0]).recip()),
            floor: F::from_f64(self.floor),
            counts_from: F::from_f64(counts_from(self.floor)),
            background: [self.background, tangents[3]],
        }
    }
}

/// The constant for this float type, f32 or f64.
pub(super) fn of_type<F>([single, double]: [f64; 2]) -> f64 {
    if size_of::<F>() == size_of::<f64>() { double } else { single }
}

/// All inputs of a walk, in one number type.
pub(super) struct Blend<'a, T: Real> {
    pub(super) scene: Scene<'a, T>,
    pub(super) attributes: [&'a [Float<T>]; 2],
    pub(super) entries: &'a [[u32; 3]],
    /// Channels of the image, without the faces' share.
    pub(super) channels: usize,
    /// Numbers per entry of the attributes.
    pub(super) numbers: usize,
    pub(super) texture: Option<Texture<'a, T>>,
    /// Length of the attributes of a view, 0 if all views share them.
    pub(super) per_view: usize,
    pub(super) depth: DepthLookup<'a, T>,
    pub(super) near: Float<T>,
    pub(super) per_range: Float<T>,
    pub(super) floor: Float<T>,
    /// [`AREA`] in pixels.
    pub(super) least_area: Float<T>,
    /// [`VANISHING`] of the float type.
    pub(super) vanishing: Float<T>,
    /// Logarithm of an edge softness from which on it counts.
    pub(super) counts_from: Float<T>,
    pub(super) background: [&'a [Float<T>]; 2],
}

impl<T: Real> Blend<'_, T> {
    /// A gradient of the texels of the texture, if it is among the `wanted` ones, else of none.
    pub(super) fn no_texels(&self, wanted: Option<[bool; 5]>) -> TexelSums<Float<T>> {
        let wanted = wanted.is_some_and(|wanted| wanted[4]);
        let texels = self.texture.as_ref().filter(|_| wanted).map(|texture| texture.size);
        TexelSums::new(texels.map_or(0, |[height, width]| height * width))
    }

    /// Index of the first attribute of a view.
    pub(super) fn first_attribute(&self, view: usize) -> usize {
        view * self.per_view
    }

    /// A number of the background: a channel, or after the channels the logarithm of the weight.
    #[inline(always)]
    pub(super) fn behind(&self, channel: usize) -> T {
        everywhere(self.background[0], self.background[1], channel)
    }
}

/// One band of one view.
#[derive(Clone, Copy)]
pub(super) struct Band<'a, 's, T: Real> {
    pub(super) blend: &'a Blend<'s, T>,
    pub(super) of_view: &'a View,
    pub(super) views: usize,
    pub(super) view: usize,
    pub(super) band: usize,
    /// Logarithm of the largest depth weight of each face.
    pub(super) logs: &'a [f32],
    /// Logarithm of the relative weight below which a face is culled at a pixel.
    pub(super) least: f64,
}
