use std::sync::Arc;

use anyhow::{Context, bail, ensure};
use softrast_mesh::Mesh;
use softrast_raster::{
    HostBackend, Pinhole, Pinholes, RasterBackend, hard_silhouette, iou_loss, project_pinhole,
    vertices,
};
use softrast_softness::{numbers, tensor};

use super::masks::{MaskPose, MaskPoses, ball};
use crate::{Iterate, Method, Picture, SolveConfig, mask_iou, minimize, silhouette_pixels};

/// What is looked at is this much larger than the mask.
const MARGIN: f64 = 1.5;
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

/// How poses are looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseSearch {
    /// Poses of the first look that are improved on few pixels, a little.
    pub starts: usize,
    /// Steps of that.
    pub start_steps: usize,
    /// Poses of these that are improved on few pixels further.
    pub coarse: usize,
    /// Steps of that.
    pub coarse_steps: usize,
    /// Pixels a side of both.
    pub coarse_size: usize,
    /// Poses of these that are improved on many pixels.
    pub fine: usize,
    /// Steps of that.
    pub fine_steps: usize,
    /// Pixels a side of that.
    pub fine_size: usize,
    /// Learning rate of the former, in radians; the latter has a third of it.
    pub learning_rate: f64,
    /// Whether the focal length is optimised too.
    pub optimise_fov: bool,
    /// How much less than the best `IoU` a pose may have to count as another answer.
    pub nearly: f64,
}

impl Default for PoseSearch {
    fn default() -> Self {
        Self {
            starts: 128,
            start_steps: 12,
            coarse: 24,
            coarse_steps: 48,
            coarse_size: 48,
            fine: 6,
            fine_steps: 80,
            fine_size: 128,
            learning_rate: 0.03,
            optimise_fov: false,
            nearly: 0.03,
        }
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
}

impl PoseSearch {
    /// Steps that [`PoseSearch::run`] takes from a start, or from anywhere.
    pub fn steps(&self, started: bool) -> usize {
        self.fine_steps + if started { 0 } else { self.start_steps + self.coarse_steps }
    }

    /// The poses from which `mesh` has the silhouette of `mask`, the best first: those after it are at least 6 degrees from all before
    /// and nearly as good.
    ///
    /// `camera` has the intrinsics; its pose is where to start if it is `started`, else all directions and rolls are tried. `visit` sees
    /// the number of each step and the least loss; an error of it ends the search.
    ///
    /// # Errors
    ///
    /// If nothing or all of the mask is white, the mesh has no extent, or the start does not see it; those of `visit` and the device.
    pub fn run<B: RasterBackend>(
        &self,
        mesh: &Mesh,
        mask: &Picture,
        camera: &Pinhole,
        started: bool,
        method: &Method,
        mut visit: impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<FoundPose>> {
        let square = looked_at(mask)?;
        let (middle, radius) = ball(mesh);
        ensure!(radius > 0.0, "the mesh has no extent: all its vertices are in one place");
        let mask = Arc::new(mask.clone());
        let posed = |start: Pinhole| MaskPose { mask: mask.clone(), square, start };
        let starts = if started {
            let [_, _, depth] = camera.seen(middle);
            ensure!(
                depth > radius,
                "the camera is inside the mesh, or has it behind: it is {depth:.3} ahead, and the mesh reaches {radius:.3} around its middle"
            );
            vec![*camera]
        } else {
            let merged = mesh
                .clustered(DETAIL * 2.0 * radius)
                .filter(|few| few.area() > LEAST_AREA * mesh.area());
            let few = merged.as_ref().unwrap_or(mesh);
            let mut found = glance(few, &mask, square, camera);
            let mut begun = 0;
            // Few steps already tell the hopeless apart: many starts are had for little.
            let stages = [(self.starts, self.start_steps), (self.coarse, self.coarse_steps)];
            for (count, steps) in stages {
                let poses = apart(found, count, APART_DEG).into_iter();
                let poses = poses.map(|(start, _)| posed(start)).collect();
                let stage = Stage { steps, size: self.coarse_size, rate: self.learning_rate };
                found = self.improved::<B>(few, poses, method, stage, begun, &mut visit)?;
                begun += steps;
            }
            let found = apart(found, self.fine, APART_DEG);
            let least = found.first().map_or(0.0, |&(_, loss)| loss);
            let found = found.into_iter().filter(|&(_, loss)| loss <= least + HOPEFUL);
            found.map(|(start, _)| start).collect()
        };
        let begun = self.steps(started) - self.fine_steps;
        let fine =
            Stage { steps: self.fine_steps, size: self.fine_size, rate: self.learning_rate / 3.0 };
        let poses = starts.into_iter().map(posed).collect();
        let found = self.improved::<B>(mesh, poses, method, fine, begun, &mut visit)?;
        let scored = found
            .into_iter()
            .map(|(camera, _)| (camera, 1.0 - mask_iou(&silhouette_pixels(mesh, &camera), &mask)));
        let scored: Vec<(Pinhole, f64)> = apart(scored.collect(), self.fine, ANSWERS_APART_DEG);
        let best = scored.first().context("no pose was tried")?.1;
        let nearly = scored.iter().filter(|(_, loss)| *loss <= best + self.nearly);
        Ok(nearly.map(|&(camera, loss)| FoundPose { camera, iou: 1.0 - loss }).collect())
    }

    /// Poses that are improved side by side: the best of the way of each by its hard image, and the error of that.
    fn improved<B: RasterBackend>(
        &self,
        mesh: &Mesh,
        poses: Vec<MaskPose>,
        method: &Method,
        stage: Stage,
        begun: usize,
        visit: &mut impl FnMut(usize, f64) -> anyhow::Result<()>,
    ) -> anyhow::Result<Vec<(Pinhole, f64)>> {
        let problem = MaskPoses::new(mesh, poses.clone(), self.optimise_fov);
        let config =
            SolveConfig { size: stage.size, steps: stage.steps, learning_rate: stage.rate };
        let mut best = vec![None; poses.len()];
        minimize::<_, B>(&problem, &poses, method, &config, false, |iterate: &Iterate, scene| {
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

#[derive(Clone, Copy)]
struct Stage {
    steps: usize,
    size: usize,
    rate: f64,
}

/// The square of a mask that is looked at: left, top and extent in pixels.
///
/// # Errors
///
/// If nothing or all of it is white.
fn looked_at(mask: &Picture) -> anyhow::Result<[f64; 3]> {
    let Some([left, top, extent]) = mask.square() else {
        bail!("the mask is empty: no pixel is half white or more (--invert takes what is black)");
    };
    let white = mask.pixels().iter().filter(|&&level| level >= 0.5).count();
    ensure!(
        white < mask.pixels().len(),
        "the mask is full: all pixels are white, and there is no outline to fit"
    );
    let margin = (MARGIN - 1.0) / 2.0 * extent;
    Ok([left - margin, top - margin, MARGIN * extent])
}

/// A look at all directions and rolls on few pixels: cameras at which the mesh is where the mask is and as large, with their error.
fn glance(mesh: &Mesh, mask: &Picture, square: [f64; 3], camera: &Pinhole) -> Vec<(Pinhole, f64)> {
    let (middle, radius) = ball(mesh);
    let [levels, covered] = mask.part(square, GLANCE);
    let target = moments(&levels);
    let [left, top, extent] = square;
    let pixel = extent / GLANCE as f64;
    // The mask, in the middle of its square, is that of a ball at first.
    let at = [left + pixel * target.middle[0], top + pixel * target.middle[1]];
    let ray = [0, 1].map(|k| (at[k] - camera.centre[k]) / camera.focal[k]);
    let depth = 2.0 * radius * camera.focal[0] * MARGIN / extent;
    let towards = turned_to(ray);
    let device = Default::default();
    let corners = vertices::<HostBackend>(mesh.positions(), &device);
    let place = |rotation: [[f64; 3]; 3], [x, y]: [f64; 2], depth: f64| {
        let seen = rotation.map(|row| (0..3).map(|k| row[k] * middle[k]).sum::<f64>());
        let at = [x * depth, y * depth, depth];
        Pinhole { rotation, translation: [0, 1, 2].map(|k| at[k] - seen[k]), ..*camera }
    };
    let all: Vec<_> = directions().map(|local| times(towards, local)).collect();
    let mut found = Vec::with_capacity(all.len());
    for rotations in all.chunks(AT_ONCE) {
        let views = rotations.len();
        let mut cameras: Vec<Pinhole> = rotations.iter().map(|&r| place(r, ray, depth)).collect();
        let mut losses = Vec::new();
        // Twice moved to where the mask is, the second time as good as exactly.
        for _ in 0..2 {
            let cropped = cameras.iter().map(|of| of.cropped([left, top], [extent; 2], GLANCE));
            let cropped = Pinholes::new(&cropped.collect::<Vec<_>>(), &device);
            let drawn =
                hard_silhouette(project_pinhole(corners.clone(), &cropped), mesh.faces(), GLANCE);
            let of_views = |image: &[f64]| {
                tensor::<HostBackend, 3>(image.repeat(views), [views, GLANCE, GLANCE])
            };
            losses = numbers(iou_loss(drawn.clone() * of_views(&covered), of_views(&levels)));
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

/// The best so many of these, each at least so many degrees from all that are better.
fn apart(mut poses: Vec<(Pinhole, f64)>, count: usize, degrees: f64) -> Vec<(Pinhole, f64)> {
    poses.sort_by(|(_, a), (_, b)| a.total_cmp(b));
    let mut kept: Vec<(Pinhole, f64)> = Vec::new();
    for (camera, loss) in poses {
        if kept.len() < count && kept.iter().all(|(other, _)| angle_deg(&camera, other) >= degrees)
        {
            kept.push((camera, loss));
        }
    }
    kept
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
