use std::borrow::{Borrow, Cow};

use anyhow::{Context, ensure};
use softrast_mesh::Mesh;
use softrast_raster::{HostBackend, Pinhole, Projected, RasterBackend, hard_silhouette};
use softrast_softness::Softness;
use softrast_tensor::{numbers, tensor};

use super::{
    found::{FoundPose, angle_deg},
    glance::glance,
    least_squares::least_squares,
    masks::{MaskPose, MaskPoses},
    target::Target,
};
use crate::{InverseProblem, Iterate, Method, SolveConfig, minimize, silhouette_pixels};
use softrast_views::{Frame, Picture, bounding_ball, coloured_pixels, cut_sides, mask_iou};

/// Low-resolution stages use the mesh with details of this fraction of its diameter merged, about a pixel and a half.
const DETAIL: f64 = 1.0 / 20.0;
/// Least share of the surface that remains after merging details; otherwise the mesh is used unchanged.
const LEAST_AREA: f64 = 0.4;
/// Poses are dropped if their low-resolution error exceeds the smallest by more than this.
const PROMISING_MARGIN: f64 = 0.08;
/// Starts that differ by less are merged.
const APART_DEG: f64 = 12.0;
/// Answers that differ by less are merged.
const ANSWERS_APART_DEG: f64 = 6.0;
/// Poses with any rotation are merged if the mesh's silhouettes from three sides have at least this `IoU`, as for the turns of a vase.
pub(super) const DUPLICATE_IOU: f64 = 0.985;
/// Pixels a side of these silhouettes.
const SIDE_VIEW: usize = 48;
/// Poses of the coarse search that are improved a little at low resolution, and the steps of that stage.
const STARTS: (usize, usize) = (128, 12);
/// Pixels a side of the low-resolution stages.
const COARSE_SIZE: usize = 48;
/// Most answers.
const ANSWERS: usize = 6;
/// Largest difference to the best `IoU` of a further answer.
const BEST_MARGIN: f64 = 0.03;

/// Stages after the first improvement of poses.
struct Stages {
    /// Poses that are improved further at low resolution, and the steps of that stage.
    coarse: (usize, usize),
    /// Poses of the coarse stage that are improved at high resolution.
    fine: usize,
    /// Poses of the fine stage that are improved at high resolution once more.
    last: usize,
}

impl Stages {
    const OF_WHOLE: Self = Self { coarse: (24, 48), fine: 6, last: 0 };
    /// A partial outline fits more poses nearly as well, and size, place and rotation compensate for each other, so it takes more steps. On
    /// 20 views of the fox without 30 to 60 % of its silhouette, these stages find one more than those for whole silhouettes.
    const OF_CUT: Self = Self { coarse: (40, 72), fine: 10, last: 3 };

    fn of(cut: bool) -> Self {
        if cut { Self::OF_CUT } else { Self::OF_WHOLE }
    }
}

/// Poses that are refined by least squares.
const SHARPENED: usize = 3;
/// Steps that least squares count as in the progress.
const SHARPENING_STEPS: usize = 16;
/// Factors of the focal length for the start of the best pose (by colour, of the best few) if it is
/// optimised, and the least depth of the middle of the mesh, in its radii.
const ZOOMS: [f64; 3] = [0.65, 1.0, 1.5];
const NEAREST: f64 = 1.2;

/// Default steps at high resolution: by a mask, and by colours. Only silhouettes are refined by least squares afterwards.
const FINE_STEPS: [usize; 2] = [20, 80];

/// Settings of a search for poses; see [`PoseSearch`](super::PoseSearch).
#[derive(Clone, Copy)]
pub(super) struct Settings {
    /// Steps at high resolution, instead of [`FINE_STEPS`].
    pub(super) fine_steps: Option<usize>,
    /// Pixels a side at high resolution.
    pub(super) fine_size: usize,
    /// Learning rate at low resolution, in radians; at high resolution it is a third of that.
    pub(super) learning_rate: f64,
    pub(super) optimise_fov: bool,
}

/// A search for the poses of a mesh that fit a target. The camera has the intrinsics, and may have the pose to start from.
pub(super) struct Search<'a, S> {
    pub(super) settings: Settings,
    pub(super) mesh: &'a Mesh,
    pub(super) target: &'a Target<'a>,
    pub(super) camera: Pinhole,
    pub(super) method: &'a Method<S>,
}

/// Steps of the search for starts, without a given start.
pub(super) fn steps_of_starts(mask: &Picture) -> usize {
    STARTS.1 + Stages::of(!cut_sides(mask).is_empty()).coarse.1
}

/// Checks the inputs of a search.
pub(super) fn check(
    mesh: &Mesh,
    mask: &Picture,
    camera: &Pinhole,
    started: bool,
) -> anyhow::Result<()> {
    mask.view_square()?;
    let (middle, radius) = bounding_ball(mesh);
    ensure!(radius > 0.0, "the mesh has no extent: all its vertices are in one place");
    let [_, _, depth] = camera.transform(middle);
    ensure!(
        !started || depth > radius,
        "the start is inside the mesh, or has it behind: the middle of the mesh is {depth:.3} ahead, and must be more than {radius:.3}, as \
         far as its farthest vertex; is t in the units of the mesh?"
    );
    Ok(())
}

impl Settings {
    fn fine_steps(&self, painted: bool) -> usize {
        self.fine_steps.unwrap_or(FINE_STEPS[usize::from(painted)])
    }

    /// Steps of a search for a mask, or by colour if `painted`; from a given start, or without.
    pub(super) fn steps(&self, mask: &Picture, painted: bool, started: bool) -> usize {
        let Stages { last, .. } = Stages::of(!cut_sides(mask).is_empty());
        let fine_steps = self.fine_steps(painted);
        let fine = (1 + usize::from(last > 0)) * fine_steps;
        let last = match painted {
            false => SHARPENING_STEPS,
            true if self.optimise_fov => fine_steps,
            true => 0,
        };
        fine + last + if started { 0 } else { steps_of_starts(mask) }
    }
}

impl<S: Softness> Search<'_, S> {
    /// The poses that fit the target, best first; from the pose of the camera only, if `started`.
    pub(super) fn found<B: RasterBackend>(
        &self,
        started: bool,
        visit: &mut impl FnMut(usize, f64, &Pinhole) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<FoundPose>> {
        let target = self.target;
        check(self.mesh, target.mask, &self.camera, started)?;
        let frame = Frame::of_mesh(self.mesh);
        let mesh = &frame.mesh(self.mesh);
        let free = Search { mesh, camera: frame.camera(&self.camera), ..*self };
        let fixed = Search { settings: Settings { optimise_fov: false, ..self.settings }, ..free };
        let visit =
            &mut |step, loss, pose: &Pinhole| visit(step, loss, &frame.camera_to_world(pose));
        let starts = match started {
            true => vec![fixed.camera],
            false => fixed.promising_starts::<B>(visit)?,
        };
        let Stages { coarse: (_, coarse_steps), last, .. } = Stages::of(target.cut);
        let mut begun = if started { 0 } else { STARTS.1 + coarse_steps };
        let (poses, fine) = (target.poses(starts, true), free.fine());
        let mut found = fixed.improved::<B>(poses, &fine, begun, visit)?;
        if last > 0 {
            begun += fine.steps;
            found.sort_by(|(_, a), (_, b)| a.total_cmp(b));
            let best = found.drain(..last.min(found.len())).map(|(camera, _)| camera);
            let better = fixed.improved::<B>(target.poses(best, true), &fine, begun, visit)?;
            found.extend(better);
        }
        found.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        if target.painted.is_none() {
            begun += fine.steps;
            let (best, loss) = *found.first().context("no pose was tried")?;
            let visit = |share: f64| {
                visit(begun + (share * SHARPENING_STEPS as f64).ceil() as usize, loss, &best)
            };
            found = free.sharpened(&found, visit)?;
        } else if self.settings.optimise_fov {
            begun += fine.steps;
            let best = found.iter().take(SHARPENED).flat_map(|(camera, _)| zoomed(camera));
            let better = free.improved::<B>(target.poses(best, true), &fine, begun, visit)?;
            found.extend(better);
        }
        let scored = found.into_iter().map(|(camera, loss)| {
            let iou = mask_iou(&silhouette_pixels(mesh, &camera), target.mask);
            let psnr =
                target.painted.and_then(|view| view.psnr_of(&coloured_pixels(mesh, &camera)));
            let loss = if target.painted.is_some() { loss } else { 1.0 - iou };
            (FoundPose { camera, iou, psnr }, loss)
        });
        let few = coarse(mesh);
        let alike = target.painted.is_none().then_some(&*few);
        let scored = apart(scored.collect(), ANSWERS, ANSWERS_APART_DEG, alike);
        let best = scored.first().context("no pose was tried")?.1;
        let nearly = scored.into_iter().filter(|(_, loss)| *loss <= best + BEST_MARGIN);
        let in_world =
            |pose: FoundPose| FoundPose { camera: frame.camera_to_world(&pose.camera), ..pose };
        Ok(nearly.map(|(pose, _)| in_world(pose)).collect())
    }

    /// The poses that a search without a start improves at high resolution, the most promising first.
    pub(super) fn starts<B: RasterBackend>(
        &self,
        visit: &mut impl FnMut(usize, f64, &Pinhole) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<Pinhole>> {
        check(self.mesh, self.target.mask, &self.camera, false)?;
        let frame = Frame::of_mesh(self.mesh);
        let mesh = &frame.mesh(self.mesh);
        let search = Search { mesh, camera: frame.camera(&self.camera), ..*self };
        let visit =
            &mut |step, loss, pose: &Pinhole| visit(step, loss, &frame.camera_to_world(pose));
        let starts = search.promising_starts::<B>(visit)?;
        Ok(starts.iter().map(|camera| frame.camera_to_world(camera)).collect())
    }

    fn promising_starts<B: RasterBackend>(
        &self,
        visit: &mut impl FnMut(usize, f64, &Pinhole) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<Pinhole>> {
        let (target, learning_rate) = (self.target, self.settings.learning_rate);
        let few = coarse(self.mesh);
        let low = Search { mesh: &few, ..*self };
        let alike = target.painted.is_none().then_some(&*few);
        let mut found = apart(glance(&few, target, &self.camera), STARTS.0, APART_DEG, None);
        ensure!(
            !found.is_empty(),
            "no pose can be searched for in a mask that is so narrow: give a pose to start from (--start)"
        );
        let mut begun = 0;
        // A few steps suffice to drop hopeless poses, so many starts are cheap.
        let Stages { coarse, fine, .. } = Stages::of(target.cut);
        for ((_, steps), left) in [(STARTS, coarse.0), (coarse, fine)] {
            // Silhouettes approach a pose faster than colours do; colours then rank the results.
            let poses = target.poses(found.into_iter().map(|(start, _)| start), false);
            let stage = SolveConfig { steps, size: COARSE_SIZE, learning_rate };
            let better = low.improved::<B>(poses, &stage, begun, visit)?;
            found = apart(low.judged(better), left, APART_DEG, alike);
            begun += steps;
        }
        let least = found.first().map_or(0.0, |&(_, loss)| loss);
        let found = found.into_iter().filter(|&(_, loss)| loss <= least + PROMISING_MARGIN);
        Ok(found.map(|(start, _)| start).collect())
    }

    /// These poses, the first few refined by least squares: with their focal length and, if it is
    /// optimised, with a free one. `visit` receives the share that is done.
    fn sharpened(
        &self,
        found: &[(Pinhole, f64)],
        mut visit: impl FnMut(f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<(Pinhole, f64)>> {
        let Settings { fine_size, optimise_fov, .. } = self.settings;
        let (best, others) = found.split_at(SHARPENED.min(found.len()));
        let best: Vec<Pinhole> = best.iter().map(|(camera, _)| *camera).collect();
        let zoomed = best.first().into_iter().flat_map(zoomed).chain(best.iter().skip(1).copied());
        let zoomed: Vec<Pinhole> = zoomed.filter(|_| optimise_fov).collect();
        let count = (best.len() + zoomed.len()) as f64;
        let mut done = 0.0;
        let mut sharp = |starts: Vec<Pinhole>, optimise_fov: bool| {
            let poses = self.target.poses(starts, false).into_iter().map(|pose| {
                let visit = |share: f64| visit((done + share) / count);
                let sharp = least_squares(self.mesh, &pose, optimise_fov, fine_size, visit)?;
                done += 1.0;
                anyhow::Ok(sharp)
            });
            poses.collect::<anyhow::Result<Vec<_>>>()
        };
        let (fixed, free) = (sharp(best, false)?, sharp(zoomed, true)?);
        // Squared differences rank the focal lengths of one pose: an IoU counts whole pixels.
        let free = apart(free, ANSWERS, ANSWERS_APART_DEG, None);
        Ok([&fixed, others, &free].concat())
    }

    /// Poses with the low-resolution error of their hard image: by colour, if the target has colours; else as given.
    fn judged(&self, poses: Vec<(Pinhole, f64)>) -> Vec<(Pinhole, f64)> {
        if self.target.painted.is_none() {
            return poses;
        }
        let instances = self.target.poses(poses.iter().map(|&(camera, _)| camera), true);
        let problem = self.problem(&instances);
        let scene = problem.scene::<HostBackend>(&instances, COARSE_SIZE);
        let image = problem.hard_image(&scene, problem.start(&scene));
        let losses = numbers(problem.image_loss(&scene, image));
        poses.into_iter().zip(losses).map(|((camera, _), loss)| (camera, loss)).collect()
    }

    fn problem(&self, poses: &[MaskPose]) -> MaskPoses {
        let mut problem = MaskPoses::new(self.mesh, poses.to_vec());
        problem.optimise_fov = self.settings.optimise_fov;
        problem
    }

    /// Settings of the high-resolution stage.
    fn fine(&self) -> SolveConfig {
        let Settings { fine_size, learning_rate, .. } = self.settings;
        let steps = self.settings.fine_steps(self.target.painted.is_some());
        SolveConfig { size: fine_size, steps, learning_rate: learning_rate / 3.0 }
    }

    /// Poses that are improved together: the iterate of each with the smallest error of the hard image, and that error.
    fn improved<B: RasterBackend>(
        &self,
        poses: Vec<MaskPose>,
        stage: &SolveConfig,
        begun: usize,
        visit: &mut impl FnMut(usize, f64, &Pinhole) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<(Pinhole, f64)>> {
        let problem = self.problem(&poses);
        let mut best = vec![None; poses.len()];
        minimize::<_, B>(&problem, &poses, self.method, stage, |iterate: &Iterate, scene| {
            let now = scene.found(iterate.theta.clone(), &poses);
            for ((best, camera), &loss) in best.iter_mut().zip(now).zip(&iterate.hard_loss) {
                if best.is_none_or(|(_, least)| loss < least) {
                    *best = Some((camera, loss));
                }
            }
            let least = iterate.loss.iter().copied().fold(f64::INFINITY, f64::min);
            let fits = best.iter().flatten().min_by(|(_, a), (_, b)| a.total_cmp(b));
            match fits {
                Some((camera, _)) if iterate.step > 0 => visit(begun + iterate.step, least, camera),
                _ => Ok(()),
            }
        })?;
        Ok(best.into_iter().flatten().collect())
    }
}

/// The camera, in the frame of the mesh, with other focal lengths and depths at which the mesh appears equally large.
fn zoomed(camera: &Pinhole) -> impl Iterator<Item = Pinhole> {
    let [x, y, depth] = camera.translation;
    let zooms = ZOOMS.into_iter().filter(move |zoom| zoom * depth > NEAREST);
    let camera = *camera;
    zooms.map(move |zoom| Pinhole {
        focal: camera.focal.map(|focal| zoom * focal),
        translation: [x, y, zoom * depth],
        ..camera
    })
}

/// A mesh without details below the low resolution.
pub(super) fn coarse(mesh: &Mesh) -> Cow<'_, Mesh> {
    let (_, radius) = bounding_ball(mesh);
    let merged = mesh.clustered(DETAIL * 2.0 * radius);
    let merged = merged.filter(|few| few.area() > LEAST_AREA * mesh.area());
    merged.map_or(Cow::Borrowed(mesh), Cow::Owned)
}

/// The best `count` of these, each at least this many degrees from all better ones; with a mesh,
/// also only those with different silhouettes, so that the turns of a vase are one pose.
fn apart<P: Copy + Borrow<Pinhole>>(
    mut poses: Vec<(P, f64)>,
    count: usize,
    degrees: f64,
    mesh: Option<&Mesh>,
) -> Vec<(P, f64)> {
    poses.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    let mut kept: Vec<((P, f64), _)> = Vec::new();
    for (pose, loss) in poses {
        if kept.len() == count {
            break;
        }
        let camera = pose.borrow();
        if kept.iter().any(|((other, _), _)| angle_deg(camera, other.borrow()) < degrees) {
            continue;
        }
        let sides = mesh.map(|mesh| from_three_sides(mesh, bounding_ball(mesh), camera.rotation));
        let alike = |other: &Option<Vec<bool>>| {
            sides.as_ref().zip(other.as_ref()).is_some_and(|(a, b)| overlap(a, b) >= DUPLICATE_IOU)
        };
        if !kept.iter().any(|(_, other)| alike(other)) {
            kept.push(((pose, loss), sides));
        }
    }
    kept.into_iter().map(|(pose, _)| pose).collect()
}

/// Silhouettes of a rotated mesh along each axis, centred on a ball: from the front, the side and above.
pub(super) fn from_three_sides(
    mesh: &Mesh,
    (middle, radius): ([f64; 3], f64),
    rotation: [[f64; 3]; 3],
) -> Vec<bool> {
    let positions = mesh.positions().iter().map(|p| {
        let p = [0, 1, 2].map(|k| (p[k] - middle[k]) / radius);
        rotation.map(|row| (0..3).map(|k| row[k] * p[k]).sum::<f64>())
    });
    let positions: Vec<[f64; 3]> = positions.collect();
    let views = [[0, 1], [2, 1], [0, 2]];
    // Orthographic, at depth 1.
    let seen =
        views.iter().flat_map(|&[x, y]| positions.iter().flat_map(move |p| [p[x], p[y], 1.0]));
    let seen = tensor::<HostBackend, 3>(seen.collect(), [views.len(), positions.len(), 3]);
    let drawn = numbers(hard_silhouette(Projected::new(seen), mesh.faces(), SIDE_VIEW));
    drawn.into_iter().map(|level| level > 0.5).collect()
}

/// Intersection over union.
pub(super) fn overlap(a: &[bool], b: &[bool]) -> f64 {
    let count = |of: fn(bool, bool) -> bool| a.iter().zip(b).filter(|&(&a, &b)| of(a, b)).count();
    count(|a, b| a && b) as f64 / count(|a, b| a || b).max(1) as f64
}
