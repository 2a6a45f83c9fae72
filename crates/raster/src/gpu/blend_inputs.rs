//! Inputs of the colour kernels: faces and their weighting, for some of the views.

use cubecl::prelude::*;

use super::{
    dual::{Dual, load},
    frame::Frame,
    pair::{Cubic, Lookup},
    parts::Part,
};

/// Parameters of the weighting, and the layout of the numbers shared by all pixels: tables, then attributes, background and texture.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
pub(super) struct BlendParams {
    /// Layout of the table of the edge softness, mirrored: the inner side is outside a face.
    pub(super) edge: Lookup,
    pub(super) depth: Lookup,
    /// First row of the depth table.
    pub(super) depth_row: u32,
    /// Start of attributes, background and texture.
    pub(super) attributes: u32,
    pub(super) background: u32,
    pub(super) texture: u32,
    /// Rows and columns of the texture.
    pub(super) rows: u32,
    pub(super) columns: u32,
    /// Numbers of the attributes of a view, 0 if all views share them.
    pub(super) per_view: u32,
    /// Start of the derivatives of all these numbers in the direction.
    pub(super) along: u32,
    /// Depth of nearness 1, and one over the distance of the planes.
    pub(super) near: f32,
    pub(super) per_range: f32,
    /// The floor subtracted from the edge softness, and the logarithm above which it counts.
    pub(super) floor: f32,
    pub(super) counts_from: f32,
    /// Least depth weight, for a line; its logarithm, for an exponential.
    pub(super) least: f32,
}

/// Properties of the weighting known at compile time of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct BlendSpec {
    /// Whether the tables have cells counted from their far ends.
    pub(super) far_edge: bool,
    pub(super) far_depth: bool,
    /// Whether depth weights come from a line or an exponential instead of a table.
    pub(super) is_line: bool,
    pub(super) is_exponential: bool,
    /// Whether attributes are texture coordinates.
    pub(super) is_textured: bool,
    /// Channels of the image, except the faces' share.
    pub(super) channels: usize,
    /// Whether the pass is of second order.
    pub(super) second: bool,
}

impl BlendSpec {
    /// Numbers per entry of the attributes.
    pub(super) fn numbers(self) -> usize {
        if self.is_textured { 2 } else { self.channels }
    }
}

/// All inputs of a colour kernel.
#[derive(CubeType, CubeLaunch)]
pub(super) struct BlendInputs {
    pub(super) corners: Array<f32>,
    pub(super) reaches: Array<u32>,
    pub(super) slots: Array<u32>,
    /// Numbers shared by all pixels, and their derivatives, which follow those of the vertices.
    numbers: Array<f32>,
    direction: Array<f32>,
    /// `[faces, 3]`: the entries of the attributes at the corners.
    pub(super) entries: Array<u32>,
    pub(super) weights: BlendParams,
    pub(super) frame: Frame,
    pub(super) face_count: u32,
    /// The views of the launch.
    pub(super) first_view: u32,
    pub(super) views: u32,
}

#[cube]
impl BlendInputs {
    /// One of the numbers shared by all pixels.
    pub(super) fn number(&self, at: usize, #[comptime] kind: BlendSpec) -> Dual {
        let along = self.weights.along as usize + at;
        load(&self.numbers, at, &self.direction, along, kind.second)
    }

    /// A row of the tables.
    pub(super) fn cubic(&self, row: u32, #[comptime] kind: BlendSpec) -> Cubic {
        Cubic::new(&self.numbers, row, &self.direction, self.weights.along, kind.second)
    }

    /// The part of a face that belongs to a group of units.
    pub(super) fn part(&self, group: u32) -> Part {
        Part::of(group, &self.reaches, &self.slots, self.views, self.views * self.face_count)
    }

    /// Index of the first channel of a pixel of a view of the launch, in an image of all views.
    pub(super) fn in_image(
        &self,
        view: u32,
        row: u32,
        column: u32,
        #[comptime] kind: BlendSpec,
    ) -> usize {
        let plane = self.frame.height * self.frame.width;
        let planes = comptime!(kind.channels as u32 + 1);
        ((self.first_view + view) * planes * plane + row * self.frame.width + column) as usize
    }

    /// Distance between channels of an image.
    pub(super) fn plane(&self) -> usize {
        (self.frame.height * self.frame.width) as usize
    }
}
