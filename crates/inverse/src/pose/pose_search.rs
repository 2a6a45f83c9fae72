use anyhow::ensure;
use softrast_mesh::Mesh;
use softrast_raster::{Pinhole, RasterBackend};
use softrast_softness::{EdgeSoftness, Softness};
use softrast_views::{PaintedView, Picture};

use super::{
    found::FoundPose,
    search::{Search, Settings, check, steps_of_starts},
    target::Target,
};
use crate::{Method, ScheduledSoftness};

/// A function that receives the number of each step, the least loss, and the pose that fits best so far.
type Visit<'a> = Box<dyn FnMut(usize, f64, &Pinhole) -> anyhow::Result<()> + 'a>;

/// The search for the camera pose at which a mesh has a given silhouette.
///
/// ```
/// use softrast_inverse::pose::PoseSearch;
/// use softrast_mesh::fox;
/// use softrast_tensor::NdArray;
/// use softrast_views::{Lens, Picture};
///
/// # fn main() -> anyhow::Result<()> {
/// let mask = Picture::load_mask(concat!(env!("CARGO_MANIFEST_DIR"), "/../../data/views/fox/images/03.png"))?;
/// let lens = Lens::of_fov(45.0, mask.size()).pinhole(mask.size())?;
/// let (mesh, mut steps) = (fox(), 0);
/// let search = PoseSearch::new(&mesh, lens).with_fine_steps(5).progress(|step, _| Ok(steps = step));
/// let found = search.run::<NdArray>(&mask)?;
/// println!("stood at {:?}, IoU {}", found[0].camera.eye(), found[0].iou);
/// # assert!(found[0].iou > 0.9, "{}", found[0].iou);
/// # Ok(())
/// # }
/// ```
pub struct PoseSearch<'a, S = EdgeSoftness> {
    mesh: &'a Mesh,
    camera: Pinhole,
    started: bool,
    settings: Settings,
    method: Method<S>,
    visit: Visit<'a>,
}

impl<'a> PoseSearch<'a> {
    /// Default learning rate at low resolution, in radians.
    pub const LEARNING_RATE: f64 = 0.03;

    /// A search for the pose of `mesh`, anywhere and in any unit, under the intrinsics of `lens`:
    /// over all directions and rolls, with the learned softness of POSE.
    #[allow(clippy::missing_panics_doc, reason = "the softness is bundled, and tests read it")]
    pub fn new(mesh: &'a Mesh, lens: Pinhole) -> Self {
        let learned = ScheduledSoftness::learned("pose").expect("it is bundled");
        Self {
            mesh,
            camera: lens,
            started: false,
            settings: Settings {
                fine_steps: None,
                fine_size: 128,
                learning_rate: Self::LEARNING_RATE,
                optimise_fov: false,
            },
            method: Method::new("learned", learned),
            visit: Box::new(|_, _, _| Ok(())),
        }
    }

    /// Number of steps of [`PoseSearch::starts`] for a mask.
    pub fn steps_of_starts(mask: &Picture) -> usize {
        steps_of_starts(mask)
    }
}

impl<'a, S: Softness> PoseSearch<'a, S> {
    /// Starts from the rotation and translation of this pose only.
    #[must_use]
    pub fn starting_at(mut self, pose: &Pinhole) -> Self {
        (self.camera.rotation, self.camera.translation) = (pose.rotation, pose.translation);
        self.started = true;
        self
    }

    /// Sets the number of steps at high resolution: 20 by default, 80 by colour.
    #[must_use]
    pub fn with_fine_steps(mut self, steps: usize) -> Self {
        self.settings.fine_steps = Some(steps);
        self
    }

    /// Sets the pixels a side at high resolution, 128 by default.
    #[must_use]
    pub fn with_fine_size(mut self, size: usize) -> Self {
        self.settings.fine_size = size;
        self
    }

    /// Sets the learning rate at low resolution, in radians; at high resolution it is a third of that.
    #[must_use]
    pub fn with_learning_rate(mut self, learning_rate: f64) -> Self {
        self.settings.learning_rate = learning_rate;
        self
    }

    /// Also optimises the focal length, from the poses found with the given one; the better of both are returned.
    #[must_use]
    pub fn optimising_fov(mut self) -> Self {
        self.settings.optimise_fov = true;
        self
    }

    /// Sets the softness.
    #[must_use]
    pub fn with_method<T: Softness>(self, method: Method<T>) -> PoseSearch<'a, T> {
        let Self { mesh, camera, started, settings, visit, .. } = self;
        PoseSearch { mesh, camera, started, settings, method, visit }
    }

    /// Passes the number of each step and the smallest loss to `visit`. An error of it ends the search.
    #[must_use]
    pub fn progress(self, mut visit: impl FnMut(usize, f64) -> anyhow::Result<()> + 'a) -> Self {
        self.progress_with_pose(move |step, loss, _| visit(step, loss))
    }

    /// Shows `visit` the number of each step, the least loss, and the camera that fits best so far by its hard silhouette. An error of it
    /// ends the search.
    #[must_use]
    pub fn progress_with_pose(
        self,
        visit: impl FnMut(usize, f64, &Pinhole) -> anyhow::Result<()> + 'a,
    ) -> Self {
        Self { visit: Box::new(visit), ..self }
    }

    /// Number of steps of [`run`](Self::run) for a mask.
    pub fn steps(&self, mask: &Picture) -> usize {
        self.settings.steps(mask, false, self.started)
    }

    /// Number of steps of [`run_by_colour`](Self::run_by_colour) for a view.
    pub fn steps_by_colour(&self, view: &PaintedView) -> usize {
        self.settings.steps(&view.view.mask, true, self.started)
    }

    /// Checks the inputs of [`run`](Self::run).
    ///
    /// # Errors
    ///
    /// If nothing or all of the mask is white, the mesh has no extent, or the mesh is not in front of the start camera.
    pub fn check(&self, mask: &Picture) -> anyhow::Result<()> {
        check(self.mesh, mask, &self.camera, self.started)
    }

    /// The poses at which the mesh has the silhouette of `mask`, best first. Further poses are at least 6 degrees from all before them,
    /// have other silhouettes from some side, and an `IoU` that is at most 0.03 lower.
    ///
    /// A mask that reaches a side of the picture ([`cut_sides`](softrast_views::cut_sides)) may belong to an object that extends beyond it:
    /// then only pixels in the picture are compared, and several sizes and places of the whole object are tried.
    ///
    /// # Errors
    ///
    /// The errors of [`check`](Self::check), of the progress function and of the device.
    pub fn run<B: RasterBackend>(self, mask: &Picture) -> anyhow::Result<Vec<FoundPose>> {
        self.found::<B>(&Target::new(mask, None)?)
    }

    /// Finds poses by the colours of a picture too, if the vertices of the mesh have colours: they distinguish poses
    /// with similar silhouettes. Poses are ranked by the sum of the `IoU` loss and the colour loss; further poses may
    /// have the silhouettes of the first, and have losses at most 0.03 higher. The camera of the view is ignored.
    ///
    /// # Errors
    ///
    /// The errors of [`run`](Self::run); if the mesh has no colours, or no pixel of the view has a colour.
    #[doc(alias = "run_by_color")]
    pub fn run_by_colour<B: RasterBackend>(
        self,
        view: &PaintedView,
    ) -> anyhow::Result<Vec<FoundPose>> {
        ensure!(self.mesh.colours().is_some(), "the mesh has no colours at its vertices");
        self.found::<B>(&Target::new(&view.view.mask, Some(view))?)
    }

    /// The poses that [`run`](Self::run) without a start improves at high resolution, the most
    /// promising first: at most six, or ten if the picture cuts the object off.
    ///
    /// # Errors
    ///
    /// The errors of [`run`](Self::run).
    pub fn starts<B: RasterBackend>(self, mask: &Picture) -> anyhow::Result<Vec<Pinhole>> {
        let Self { mesh, camera, settings, method, mut visit, .. } = self;
        let target = &Target::new(mask, None)?;
        Search { settings, mesh, target, camera, method: &method }.starts::<B>(&mut visit)
    }

    fn found<B: RasterBackend>(self, target: &Target<'_>) -> anyhow::Result<Vec<FoundPose>> {
        let Self { mesh, camera, started, settings, method, mut visit } = self;
        let search = Search { settings, mesh, target, camera, method: &method };
        search.found::<B>(started, &mut visit)
    }
}
