use anyhow::Context;
use softrast_raster::Pinhole;
use softrast_views::{PaintedView, Picture, View};

/// Extent of the drawn square of a view, relative to its mask.
const MARGIN: f64 = 1.15;

/// A view of an object whose shape is fitted: its mask and, if present, its normals and colours.
#[derive(Clone, Debug)]
pub struct ViewOfShape {
    camera: Pinhole,
    /// The drawn square: left, top and extent in pixels.
    pub(super) square: [f64; 3],
    pub(super) mask: Picture,
    pub(super) normals: Option<PaintedView>,
    pub(super) colours: Option<PaintedView>,
}

impl ViewOfShape {
    /// The mask of a view.
    ///
    /// # Errors
    ///
    /// If nothing or all of the mask is white, with the name of the view.
    pub fn of_mask(view: &View) -> anyhow::Result<Self> {
        view.square()?;
        let [left, top, extent] = view.mask.square().with_context(|| view.name.clone())?;
        let beyond = (MARGIN - 1.0) / 2.0 * extent;
        let square = [left - beyond, top - beyond, MARGIN * extent];
        let (mask, camera) = (view.mask.clone(), view.camera);
        Ok(Self { camera, square, mask, normals: None, colours: None })
    }

    /// Adds the colours of a picture of the same pixels.
    #[must_use]
    pub fn with_colours(self, painted: &PaintedView) -> Self {
        Self { colours: Some(painted.clone()), ..self }
    }

    /// Adds normals: a picture of the same pixels whose red, green and blue are `(n + 1) / 2` of unit normals n in world axes.
    #[must_use]
    pub fn with_normals(self, painted: &PaintedView) -> Self {
        Self { normals: Some(painted.clone()), ..self }
    }

    /// The camera of its square on `size` × `size` pixels.
    pub(super) fn camera(&self, size: usize) -> Pinhole {
        let [left, top, extent] = self.square;
        self.camera.cropped([left, top], [extent; 2], size)
    }

    /// Side of the square, in pixels of the picture.
    pub(super) fn pixels(&self) -> f64 {
        self.square[2]
    }

    /// Half the extent of the square at the depth of the origin, in world units.
    pub(super) fn reach(&self) -> f64 {
        let camera = self.camera(2);
        camera.translation[2] / camera.focal[0]
    }
}
