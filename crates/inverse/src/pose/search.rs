use std::borrow::{Borrow, Cow};

use anyhow::{Context, ensure};
use softrast_mesh::Mesh;
use softrast_raster::{
    HostBackend, Pinhole, Pinholes, RasterBackend, hard_silhouette, iou_loss, project_pinhole,
    vertices,
};
use softrast_softness::{numbers, tensor};

use super::{
    Coat, ColouredViews,
    masks::{MaskPose, MaskPoses, ball},
};
use crate::{
    InverseProblem, Iterate, Method, PaintedView, Picture, SolveConfig, coloured_pixels, mask_iou,
    minimize, silhouette_pixels,
};

/// Pixels a side, directions and rolls of the first look, and views that are drawn at once.
const GLANCE: usize = 32;
const DIRECTIONS: usize = 160;
const ROLLS: usize = 16;
const AT_ONCE: usize = 256;
/// A look and coarse steps are at the mesh with detail of this fraction of its diameter merged, about a pixel and a half.
const DETAIL: f64 = 1.0 / 20.0;
/// A mesh whose surface is mostly such detail is looked at as it is.
const LEAST_AREA: f64 = 0.4;
/// A pose whose error on few pixels is larger than the least by more than this is given up.
const HOPEFUL: f64 = 0.08;
/// Starts that differ by less are one.
const APART_DEG: f64 = 12.0;
/// Answers that differ by less are one.
const ANSWERS_APART_DEG: f64 = 6.0;
/// Poses are one, however they are turned, if the silhouettes of the mesh from three sides overlap by so much, as those of a vase do.
const ALIKE: f64 = 0.985;
/// Pixels a side of these.
const SIDE_VIEW: usize = 48;
/// Poses of the first look that are improved on few pixels, a little, and the steps of that.
const STARTS: (usize, usize) = (128, 12);
/// Those of them that are improved on few pixels further, and the steps of that.
const COARSE: (usize, usize) = (24, 48);
/// Pixels a side of both.
const COARSE_SIZE: usize = 48;
/// Poses of these that are improved on many pixels.
const FINE: usize = 6;
/// How much less than the best `IoU` a pose may have to count as another answer.
const NEARLY: f64 = 0.03;

/// How poses are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSearch {
    /// Steps on many pixels.
    pub fine_steps: usize,
    /// Pixels a side of these.
    pub fine_size: usize,
    /// Learning rate on few pixels, in radians; on many it is a third of that.
    pub learning_rate: f64,
    /// Whether the focal length is optimised too.
    pub optimise_fov: bool,
}

impl Default for PoseSearch {
    fn default() -> Self {
        Self { fine_steps: 80, fine_size: 128, learning_rate: 0.03, optimise_fov: false }
    }
}

/// A pose that fits a mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundPose {
    /// The camera of the whole picture.
    pub camera: Pinhole,
    /// Overlap over union of its hard silhouette and the mask, both of all pixels of the picture, where a pixel of the mask is in from one
    /// half on.
    pub iou: f64,
    /// How near its colours come to the picture, in decibels, where they are asked for; see [`PaintedView::psnr`].
    pub psnr: Option<f64>,
}

impl Borrow<Pinhole> for FoundPose {
    fn borrow(&self) -> &Pinhole {
        &self.camera
    }
}

/// What a pose is told by: a mask, its square that is looked at, and colours if they tell it too.
#[derive(Clone, Copy)]
struct Target<'a> {
    mask: &'a Picture,
    square: [f64; 3],
    painted: Option<&'a PaintedView>,
}

impl<'a> Target<'a> {
    fn new(mask: &'a Picture, painted: Option<&'a PaintedView>) -> anyhow::Result<Self> {
        Ok(Self { mask, square: mask.looked_at()?, painted })
    }

    /// Starts of poses, told by silhouettes alone or by colours too.
    fn poses(&self, starts: impl IntoIterator<Item = Pinhole>, by_colour: bool) -> Vec<MaskPose> {
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

impl PoseSearch {
    /// Steps that [`PoseSearch::run`] takes from a start, or from anywhere.
    pub fn steps(&self, started: bool) -> usize {
        self.fine_steps + if started { 0 } else { STARTS.1 + COARSE.1 }
    }

    /// What [`PoseSearch::run`] would refuse at once.
    ///
    /// # Errors
    ///
    /// If nothing or all of the mask is white, the mesh has no extent, or the start does not see it.
    pub fn check(
        mesh: &Mesh,
        mask: &Picture,
        camera: &Pinhole,
        started: bool,
    ) -> anyhow::Result<()> {
        mask.looked_at()?;
        let (middle, radius) = ball(mesh);
        ensure!(radius > 0.0, "the mesh has no extent: all its vertices are in one place");
        let [_, _, depth] = camera.seen(middle);
        ensure!(
            !started || depth > radius,
            "the start is inside the mesh, or has it behind: the middle of the mesh is {depth:.3} ahead, and must be more than {radius:.3}, as \
             far as its farthest vertex; is t in the units of the mesh?"
        );
        Ok(())
    }

    /// The poses from which `mesh` has the silhouette of `mask`, the best first: those after it are at least 6 degrees from all before,
    /// look otherwise from some side, and fit nearly as well: their `IoU` is less by 0.03 at most.
    ///
    /// `camera` has the intrinsics; its pose is where to start if it is `started`, else all directions and rolls are tried. `visit` sees
    /// the number of each step and the least loss; an error of it ends the search.
    ///
    /// # Errors
    ///
    /// Those of [`PoseSearch::check`], of `visit` and of the device.
    pub fn run<B: RasterBackend>(
        &self,
        mesh: &Mesh,
        mask: &Picture,
        camera: &Pinhole,
        started: bool,
        method: &Method,
        mut visit: impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<FoundPose>> {
        let target = Target::new(mask, None)?;
        self.found::<B>(mesh, &target, camera, started, method, &mut visit)
    }

    /// The same by the colours of a picture too, those of the vertices of `mesh` being known: colours tell apart poses that look alike as
    /// silhouettes. The camera is that of the view. Poses are ranked by the `IoU` loss and the error of colours together; those after the
    /// first may look like it as silhouettes, and have losses that are larger by 0.03 at most.
    ///
    /// # Errors
    ///
    /// Those of [`PoseSearch::run`]; if the mesh has no colours, or no pixel of the view has a colour.
    pub fn run_by_colour<B: RasterBackend>(
        &self,
        mesh: &Mesh,
        view: &PaintedView,
        started: bool,
        method: &Method,
        mut visit: impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<FoundPose>> {
        ensure!(mesh.colours().is_some(), "the mesh has no colours at its vertices");
        let target = Target::new(&view.view.mask, Some(view))?;
        self.found::<B>(mesh, &target, &view.view.camera, started, method, &mut visit)
    }

    fn found<B: RasterBackend>(
        &self,
        mesh: &Mesh,
        target: &Target<'_>,
        camera: &Pinhole,
        started: bool,
        method: &Method,
        visit: &mut impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<FoundPose>> {
        Self::check(mesh, target.mask, camera, started)?;
        let starts = match started {
            true => vec![*camera],
            false => self.hopeful::<B>(mesh, target, camera, method, visit)?,
        };
        let begun = self.steps(started) - self.fine_steps;
        let (poses, fine) = (target.poses(starts, true), self.fine());
        let found = self.improved::<B>(mesh, poses, method, &fine, begun, visit)?;
        let scored = found.into_iter().map(|(camera, loss)| {
            let iou = mask_iou(&silhouette_pixels(mesh, &camera), target.mask);
            let psnr =
                target.painted.and_then(|view| view.psnr_of(&coloured_pixels(mesh, &camera)));
            let loss = if target.painted.is_some() { loss } else { 1.0 - iou };
            (FoundPose { camera, iou, psnr }, loss)
        });
        let few = coarse(mesh);
        let alike = target.painted.is_none().then_some(&*few);
        let scored = apart(scored.collect(), FINE, ANSWERS_APART_DEG, alike);
        let best = scored.first().context("no pose was tried")?.1;
        let nearly = scored.into_iter().filter(|(_, loss)| *loss <= best + NEARLY);
        Ok(nearly.map(|(pose, _)| pose).collect())
    }

    /// The poses that [`PoseSearch::run`] improves on many pixels where nothing is known, the most hopeful first; at most six.
    ///
    /// # Errors
    ///
    /// Those of [`PoseSearch::check`], of `visit` and of the device.
    pub fn starts<B: RasterBackend>(
        &self,
        mesh: &Mesh,
        mask: &Picture,
        camera: &Pinhole,
        method: &Method,
        mut visit: impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<Pinhole>> {
        Self::check(mesh, mask, camera, false)?;
        self.hopeful::<B>(mesh, &Target::new(mask, None)?, camera, method, &mut visit)
    }

    fn hopeful<B: RasterBackend>(
        &self,
        mesh: &Mesh,
        target: &Target<'_>,
        camera: &Pinhole,
        method: &Method,
        visit: &mut impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<Pinhole>> {
        let few = coarse(mesh);
        let alike = target.painted.is_none().then_some(&*few);
        let mut found = apart(glance(&few, target, camera), STARTS.0, APART_DEG, None);
        let mut begun = 0;
        // Few steps already tell the hopeless apart: many starts are had for little.
        for ((_, steps), left) in [(STARTS, COARSE.0), (COARSE, FINE)] {
            // Silhouettes bring a pose near for less time than colours; these say then which it is.
            let poses = target.poses(found.into_iter().map(|(start, _)| start), false);
            let stage = SolveConfig { steps, size: COARSE_SIZE, learning_rate: self.learning_rate };
            let better = self.improved::<B>(&few, poses, method, &stage, begun, visit)?;
            found = apart(self.judged(&few, target, better), left, APART_DEG, alike);
            begun += steps;
        }
        let least = found.first().map_or(0.0, |&(_, loss)| loss);
        let found = found.into_iter().filter(|&(_, loss)| loss <= least + HOPEFUL);
        Ok(found.map(|(start, _)| start).collect())
    }

    /// Poses with the error of their hard image on few pixels: with colours, if they are asked for.
    fn judged(
        &self,
        mesh: &Mesh,
        target: &Target<'_>,
        poses: Vec<(Pinhole, f64)>,
    ) -> Vec<(Pinhole, f64)> {
        if target.painted.is_none() {
            return poses;
        }
        let instances = target.poses(poses.iter().map(|&(camera, _)| camera), true);
        let problem = MaskPoses::new(mesh, instances.clone(), self.optimise_fov);
        let scene = problem.scene::<HostBackend>(&instances, COARSE_SIZE);
        let image = problem.hard_image(&scene, problem.start(&scene));
        let losses = numbers(problem.image_loss(&scene, image));
        poses.into_iter().zip(losses).map(|((camera, _), loss)| (camera, loss)).collect()
    }

    /// How poses are improved on many pixels.
    pub fn fine(&self) -> SolveConfig {
        let learning_rate = self.learning_rate / 3.0;
        SolveConfig { size: self.fine_size, steps: self.fine_steps, learning_rate }
    }

    /// Poses that are improved side by side: the best of the way of each by its hard image, and the error of that.
    fn improved<B: RasterBackend>(
        &self,
        mesh: &Mesh,
        poses: Vec<MaskPose>,
        method: &Method,
        stage: &SolveConfig,
        begun: usize,
        visit: &mut impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<(Pinhole, f64)>> {
        let problem = MaskPoses::new(mesh, poses.clone(), self.optimise_fov);
        let mut best = vec![None; poses.len()];
        minimize::<_, B>(&problem, &poses, method, stage, false, |iterate: &Iterate, scene| {
            let now = scene.found(iterate.theta.clone(), &poses);
            for ((best, camera), &loss) in best.iter_mut().zip(now).zip(&iterate.hard_loss) {
                if best.is_none_or(|(_, least)| loss < least) {
                    *best = Some((camera, loss));
                }
            }
            let least = iterate.loss.iter().copied().fold(f64::INFINITY, f64::min);
            if iterate.step == 0 { Ok(()) } else { visit(begun + iterate.step, least) }
        })?;
        Ok(best.into_iter().flatten().collect())
    }
}

/// A mesh without what cannot be told on few pixels.
fn coarse(mesh: &Mesh) -> Cow<'_, Mesh> {
    let (_, radius) = ball(mesh);
    let merged = mesh.clustered(DETAIL * 2.0 * radius);
    let merged = merged.filter(|few| few.area() > LEAST_AREA * mesh.area());
    merged.map_or(Cow::Borrowed(mesh), Cow::Owned)
}

/// A look at all directions and rolls on few pixels: cameras at which the mesh is where the mask is and as large, with their error before
/// they were moved there for the last time.
fn glance(mesh: &Mesh, target: &Target<'_>, camera: &Pinhole) -> Vec<(Pinhole, f64)> {
    let &Target { mask, square, painted } = target;
    let (middle, radius) = ball(mesh);
    let [levels, covered] = mask.part(square, GLANCE);
    let target = moments(&levels);
    let [left, top, extent] = square;
    let pixel = extent / GLANCE as f64;
    // The mask, in the middle of its square, is that of a ball at first.
    let at = [left + pixel * target.middle[0], top + pixel * target.middle[1]];
    let ray = [0, 1].map(|k| (at[k] - camera.centre[k]) / camera.focal[k]);
    let [_, _, white] = mask.square().unwrap_or(square);
    let depth = 2.0 * radius * camera.focal[0] / white;
    let towards = turned_to(ray);
    let device = Default::default();
    let corners = vertices::<HostBackend>(mesh.positions(), &device);
    let place = |rotation: [[f64; 3]; 3], [x, y]: [f64; 2], depth: f64| {
        let seen = rotation.map(|row| (0..3).map(|k| row[k] * middle[k]).sum::<f64>());
        let at = [x * depth, y * depth, depth];
        Pinhole { rotation, translation: [0, 1, 2].map(|k| at[k] - seen[k]), ..*camera }
    };
    let all: Vec<_> = directions().map(|local| times(towards, local)).collect();
    let colours = mesh.colours().zip(painted).map(|(colours, view)| {
        let coat = Coat::new(colours, mesh.faces().into());
        ColouredViews::<HostBackend>::of_pictures(coat, &[(view, square); AT_ONCE], GLANCE)
    });
    let mut found = Vec::with_capacity(all.len());
    for rotations in all.chunks(AT_ONCE) {
        let views = rotations.len();
        let mut cameras: Vec<Pinhole> = rotations.iter().map(|&r| place(r, ray, depth)).collect();
        let mut losses = Vec::new();
        // Twice moved to where the mask is, the second time as good as exactly.
        for _ in 0..2 {
            let cropped = cameras.iter().map(|of| of.cropped([left, top], [extent; 2], GLANCE));
            let cropped = Pinholes::new(&cropped.collect::<Vec<_>>(), &device);
            let of_views = |image: &[f64]| {
                tensor::<HostBackend, 3>(image.repeat(views), [views, GLANCE, GLANCE])
            };
            // What lies outside of the picture does not count.
            let seen = project_pinhole(corners.clone(), &cropped);
            let drawn = hard_silhouette(seen.clone(), mesh.faces(), GLANCE) * of_views(&covered);
            let loss = iou_loss(drawn.clone(), of_views(&levels));
            losses = numbers(match &colours {
                Some(colours) => loss + colours.hard_loss(seen, GLANCE),
                None => loss,
            });
            let drawn = numbers(drawn);
            for (camera, image) in cameras.iter_mut().zip(drawn.chunks(GLANCE * GLANCE)) {
                let now = moments(image);
                let [x, y, z] = camera.seen(middle);
                // Nothing is seen where the mesh is far out: as it was.
                let larger = if now.area > 0.0 { (now.area / target.area).sqrt() } else { 1.0 };
                let off = [0, 1].map(|k| {
                    let pixels = target.middle[k]
                        - if now.area > 0.0 { now.middle[k] } else { target.middle[k] };
                    pixels * pixel / camera.focal[k]
                });
                *camera = place(
                    camera.rotation,
                    [x / z + off[0], y / z + off[1]],
                    (z * larger).max(1.2 * radius),
                );
            }
        }
        found.extend(cameras.into_iter().zip(losses));
    }
    found
}

/// How large an image is, and where its middle is, in its pixels.
struct Moments {
    area: f64,
    middle: [f64; 2],
}

fn moments(image: &[f64]) -> Moments {
    let area: f64 = image.iter().sum();
    let sum = |at: fn(usize) -> usize| {
        image.iter().enumerate().map(|(k, level)| level * (at(k) as f64 + 0.5)).sum::<f64>()
    };
    Moments { area, middle: [sum(|k| k % GLANCE) / area, sum(|k| k / GLANCE) / area] }
}

/// Rotations of a camera around what it looks at: directions spread evenly over the sphere, each with rolls all around.
///
/// Source: the Fibonacci sphere, González 2010.
fn directions() -> impl Iterator<Item = [[f64; 3]; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..DIRECTIONS * ROLLS).map(move |k| {
        let (direction, roll) = (k / ROLLS, k % ROLLS);
        let y = 1.0 - (2 * direction + 1) as f64 / DIRECTIONS as f64;
        let (sin, cos) = (golden * direction as f64).sin_cos();
        let around = (1.0 - y * y).sqrt();
        // As a camera that orbits, then rolled. No direction is a pole.
        let ahead = [around * cos, y, around * sin];
        let right = [-ahead[2] / around, 0.0, ahead[0] / around];
        let down = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| ahead[i] * right[j] - ahead[j] * right[i]);
        let (sin, cos) = (std::f64::consts::TAU * roll as f64 / ROLLS as f64).sin_cos();
        [
            [0, 1, 2].map(|k| cos * right[k] + sin * down[k]),
            [0, 1, 2].map(|k| cos * down[k] - sin * right[k]),
            ahead,
        ]
    })
}

/// The least rotation that takes the axis ahead to where (x, y, 1) is.
fn turned_to([x, y]: [f64; 2]) -> [[f64; 3]; 3] {
    let length = (x * x + y * y + 1.0).sqrt();
    let [x, y, z] = [x / length, y / length, 1.0 / length];
    let h = 1.0 / (1.0 + z);
    [[1.0 - h * x * x, -h * x * y, x], [-h * x * y, 1.0 - h * y * y, y], [-x, -y, z]]
}

fn times(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    a.map(|row| [0, 1, 2].map(|j| (0..3).map(|k| row[k] * b[k][j]).sum()))
}

/// The best so many of these, each at least so many degrees from all that are better; with a mesh, only those at which it looks otherwise,
/// so that the turns of a vase are one pose.
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
        let sides = mesh.map(|mesh| from_three_sides(mesh, camera.rotation));
        let alike = |other: &Option<Vec<bool>>| {
            sides.as_ref().zip(other.as_ref()).is_some_and(|(a, b)| overlap(a, b) >= ALIKE)
        };
        if !kept.iter().any(|(_, other)| alike(other)) {
            kept.push(((pose, loss), sides));
        }
    }
    kept.into_iter().map(|(pose, _)| pose).collect()
}

/// Silhouettes of a turned mesh along each of its axes then: from the camera, from beside and from above.
fn from_three_sides(mesh: &Mesh, rotation: [[f64; 3]; 3]) -> Vec<bool> {
    let (middle, radius) = ball(mesh);
    let positions = mesh.positions().iter().map(|p| {
        let p = [0, 1, 2].map(|k| (p[k] - middle[k]) / radius);
        rotation.map(|row| (0..3).map(|k| row[k] * p[k]).sum::<f64>())
    });
    let positions: Vec<[f64; 3]> = positions.collect();
    let views = [[0, 1], [2, 1], [0, 2]];
    // Without perspective, at depth 1.
    let seen =
        views.iter().flat_map(|&[x, y]| positions.iter().flat_map(move |p| [p[x], p[y], 1.0]));
    let seen = tensor::<HostBackend, 3>(seen.collect(), [views.len(), positions.len(), 3]);
    let drawn = numbers(hard_silhouette(seen, mesh.faces(), SIDE_VIEW));
    drawn.into_iter().map(|level| level > 0.5).collect()
}

/// Overlap over union.
fn overlap(a: &[bool], b: &[bool]) -> f64 {
    let count = |of: fn(bool, bool) -> bool| a.iter().zip(b).filter(|&(&a, &b)| of(a, b)).count();
    count(|a, b| a && b) as f64 / count(|a, b| a || b).max(1) as f64
}

/// Angle between the rotations of two cameras.
fn angle_deg(a: &Pinhole, b: &Pinhole) -> f64 {
    let trace: f64 =
        a.rotation.as_flattened().iter().zip(b.rotation.as_flattened()).map(|(x, y)| x * y).sum();
    ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_rotation(r: [[f64; 3]; 3]) -> bool {
        let camera = Pinhole {
            rotation: r,
            translation: [0.0; 3],
            focal: [1.0; 2],
            centre: [0.0; 2],
            size: 1.into(),
        };
        camera.check().is_ok()
    }

    #[test]
    fn every_pose_is_near_one_that_is_looked_at() {
        let all: Vec<_> = directions().collect();
        assert!(all.iter().all(|&r| is_rotation(r)));
        let camera = |rotation| Pinhole {
            rotation,
            translation: [0.0; 3],
            focal: [1.0; 2],
            centre: [0.0; 2],
            size: 1.into(),
        };
        // Turned by any angles.
        for k in 0..200 {
            let [x, y] = [0.7 * f64::from(k), 1.3 * f64::from(k)].map(|a| a.sin() * 2.0);
            let pose = times(
                turned_to([x, y]),
                times(all[37 * k as usize % all.len()], turned_to([y, -x])),
            );
            let nearest = all.iter().map(|&r| angle_deg(&camera(pose), &camera(r)));
            assert!(nearest.fold(f64::INFINITY, f64::min) < 20.0);
        }
    }

    #[test]
    fn the_axis_ahead_is_turned_to_where_it_should_be() {
        let r = turned_to([0.5, -2.0]);
        assert!(is_rotation(r));
        assert!((r[0][2] / r[2][2] - 0.5).abs() < 1e-12 && (r[1][2] / r[2][2] + 2.0).abs() < 1e-12);
    }
}
