use std::borrow::Borrow;

use softrast_raster::Pinhole;

/// A pose that fits a mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundPose {
    /// The camera of the whole picture.
    pub camera: Pinhole,
    /// Intersection over union of its hard silhouette and the mask, over all pixels of the picture,
    /// with the mask thresholded at one half.
    pub iou: f64,
    /// PSNR of its colours in decibels, for a search by colour; see [`PaintedView::psnr`](softrast_views::PaintedView::psnr).
    pub psnr: Option<f64>,
}

impl FoundPose {
    /// Angle between the rotations of this pose and another, in degrees.
    pub fn angle_deg(&self, other: &Self) -> f64 {
        angle_deg(&self.camera, &other.camera)
    }
}

impl Borrow<Pinhole> for FoundPose {
    fn borrow(&self) -> &Pinhole {
        &self.camera
    }
}

/// Angle between the rotations of two cameras.
pub(super) fn angle_deg(a: &Pinhole, b: &Pinhole) -> f64 {
    let trace: f64 =
        a.rotation.as_flattened().iter().zip(b.rotation.as_flattened()).map(|(x, y)| x * y).sum();
    ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
}
