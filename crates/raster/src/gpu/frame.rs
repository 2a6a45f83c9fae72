//! Layout of the image: its pixels and their centres.

use cubecl::prelude::*;

/// An [`ImageSize`](crate::ImageSize) in kernels.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
pub(super) struct Frame {
    pub(super) height: u32,
    pub(super) width: u32,
    /// The lesser of the two.
    pub(super) shorter: u32,
}

#[cube]
impl Frame {
    /// Centre of a column in NDC.
    pub(super) fn column_centre(self, column: u32) -> f32 {
        f32::cast_from(2i32 * i32::cast_from(column) + 1i32 - i32::cast_from(self.width))
            / f32::cast_from(self.shorter)
    }

    /// Centre of a row in NDC; the first is at the top.
    pub(super) fn row_centre(self, row: u32) -> f32 {
        f32::cast_from(i32::cast_from(self.height) - 1i32 - 2i32 * i32::cast_from(row))
            / f32::cast_from(self.shorter)
    }

    /// Index of a pixel of a view in an image of all views.
    pub(super) fn pixel(self, view: u32, row: u32, column: u32) -> u32 {
        (view * self.height + row) * self.width + column
    }
}
