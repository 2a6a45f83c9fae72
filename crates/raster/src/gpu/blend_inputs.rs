//! What the kernels of colours read: faces and how they are weighted, in some of the views.

use cubecl::prelude::*;

use super::{
    dual::{Dual, load},
    frame::Frame,
    pair::{Cubic, Lookup},
    parts::Part,
};

/// How faces are weighted, and where the numbers that all pixels share stand: tables, then attributes, background and texture.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
pub(super) struct BlendParams {
    /// Cells of the edge softness, mirrored: the inner side is outside a face.
    pub(super) edge: Lookup,
    pub(super) depth: Lookup,
    /// Row where the table by depth begins.
    pub(super) depth_row: u32,
    /// Where attributes, background and texture begin.
    pub(super) attributes: u32,
    pub(super) background: u32,
    pub(super) texture: u32,
    /// Those of the texture.
    pub(super) rows: u32,
    pub(super) columns: u32,
    /// Attributes of a view that has its own.
    pub(super) per_view: u32,
    /// Where the derivatives of all these numbers begin in the direction.
    pub(super) along: u32,
    /// Depth of nearness 1, and one over the distance of the planes.
    pub(super) near: f32,
    pub(super) per_range: f32,
    /// What is taken off the edge softness, and the logarithm from which on it counts.
    pub(super) floor: f32,
    pub(super) counts_from: f32,
    /// Least weight by depth, of a line; of an exponential its logarithm.
    pub(super) least: f32,
}

/// What of the weighting is known when a kernel is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct BlendSpec {
    /// Whether tables have cells that are counted from their far ends.
    pub(super) far_edge: bool,
    pub(super) far_depth: bool,
    /// Whether weights by depth are a line or an exponential in place of a table.
    pub(super) is_line: bool,
    pub(super) is_exponential: bool,
    /// Whether attributes are places on a texture.
    pub(super) is_textured: bool,
    /// Channels of the image, but for the faces' share.
    pub(super) channels: usize,
    /// Whether the pass is of second order.
    pub(super) second: bool,
}

impl BlendSpec {
    /// Numbers of an attribute.
    pub(super) fn numbers(self) -> usize {
        if self.is_textured { 2 } else { self.channels }
    }
}

/// All of it.
#[derive(CubeType, CubeLaunch)]
pub(super) struct BlendInputs {
    pub(super) corners: Array<f32>,
    pub(super) reaches: Array<u32>,
    pub(super) slots: Array<u32>,
    /// What all pixels share, and its derivatives behind those of the vertices.
    numbers: Array<f32>,
    direction: Array<f32>,
    /// `[faces, 3]`: the attributes at the corners.
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
    /// One of the numbers that all pixels share.
    pub(super) fn number(&self, at: usize, #[comptime] kind: BlendSpec) -> Dual {
        let along = self.weights.along as usize + at;
        load(&self.numbers, at, &self.direction, along, kind.second)
    }

    /// A row of the tables.
    pub(super) fn cubic(&self, row: u32, #[comptime] kind: BlendSpec) -> Cubic {
        Cubic::new(&self.numbers, row, &self.direction, self.weights.along, kind.second)
    }

    /// The part of a face that a group of units takes.
    pub(super) fn part(&self, group: u32) -> Part {
        Part::of(group, &self.reaches, &self.slots, self.views, self.views * self.face_count)
    }

    /// Where the first channel of a pixel of a view of the launch stands in an image of all views.
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

    /// How far a channel of an image is from the next.
    pub(super) fn plane(&self) -> usize {
        (self.frame.height * self.frame.width) as usize
    }
}
