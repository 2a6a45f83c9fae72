//! The pixels that a face may reach.

use cubecl::prelude::*;

/// Pixels that a face may reach: rows and columns as half-open ranges, top row first. A face that
/// is not drawn has `left` above `right`.
#[derive(CubeType, Clone, Copy)]
pub(super) struct Reach {
    pub(super) left: u32,
    pub(super) right: u32,
    pub(super) top: u32,
    pub(super) bottom: u32,
}

#[cube]
impl Reach {
    /// Number `face` of `reaches` `[faces, 4]`.
    pub(super) fn load(reaches: &Array<u32>, face: usize) -> Reach {
        let at = 4 * face;
        Reach {
            left: reaches[at],
            right: reaches[at + 1],
            top: reaches[at + 2],
            bottom: reaches[at + 3],
        }
    }

    /// Number of pixels.
    pub(super) fn pixels(self) -> u32 {
        let across = select(self.left < self.right, self.right - self.left, 0u32);
        across * (self.bottom - self.top)
    }
}
