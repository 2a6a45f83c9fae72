use softrast_raster::Pinhole;

use super::masks::MaskPose;
use softrast_views::{PaintedView, Picture, cut_sides};

/// The target of a pose search: a mask, its compared square, and colours if available.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    pub(super) mask: &'a Picture,
    pub(super) square: [f64; 3],
    /// Whether the object may extend beyond the picture.
    pub(super) cut: bool,
    pub(super) painted: Option<&'a PaintedView>,
}

impl<'a> Target<'a> {
    pub(super) fn new(mask: &'a Picture, painted: Option<&'a PaintedView>) -> anyhow::Result<Self> {
        let square = mask.view_square()?;
        Ok(Self { mask, square, cut: !cut_sides(mask).is_empty(), painted })
    }

    /// Pose problems from these starts, by silhouettes alone or by colours too.
    pub(super) fn poses(
        &self,
        starts: impl IntoIterator<Item = Pinhole>,
        by_colour: bool,
    ) -> Vec<MaskPose> {
        let painted = self.painted.filter(|_| by_colour);
        let pose = |start| MaskPose {
            mask: self.mask.clone(),
            square: self.square,
            start,
            painted: painted.cloned(),
        };
        starts.into_iter().map(pose).collect()
    }
}
