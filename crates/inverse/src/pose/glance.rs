use std::borrow::Cow;

use softrast_mesh::{
    Mesh,
    vectors::{cross, product},
};
use softrast_raster::{
    HostBackend, Pinhole, Pinholes, Projected, hard_silhouette, iou_loss, project, vertex_tensor,
};
use softrast_tensor::{Tensor, numbers, tensor};

use super::{
    ColouredViews, VertexColours,
    shifts::{Stencil, Window},
    target::Target,
};
use softrast_views::bounding_ball;

/// Pixels a side, directions and rolls of the first stage, and views that are drawn at once.
const COARSE_SIDE: usize = Window::SIDE;
const DIRECTIONS: usize = 160;
const ROLLS: usize = 16;
const AT_ONCE: usize = 256;
/// Least depth of the middle of a mesh, in its radii.
const NEAREST: f64 = 1.2;
/// Visible shares of an object that the picture cuts off.
const SHOWN: [f64; 7] = [1.0, 0.87, 0.76, 0.66, 0.57, 0.5, 0.43];
/// Candidates per rotation that are returned.
const KEPT: usize = 2;

/// A coarse search over all directions and rolls at low resolution: cameras that match the place and size of the mask, with their error.
pub(super) fn glance(mesh: &Mesh, target: &Target<'_>, camera: &Pinhole) -> Vec<(Pinhole, f64)> {
    let look = Look::new(mesh, target, camera);
    let all: Vec<_> = directions().collect();
    let found = all.chunks(AT_ONCE).flat_map(|some| match target.cut {
        false => look.moved(some),
        // A picture may be too narrow for any placement: then it is treated as if it showed the whole object.
        true => {
            Some(look.shifted(some)).filter(|it| !it.is_empty()).unwrap_or_else(|| look.moved(some))
        }
    });
    found.collect()
}

/// Inputs of the coarse search: mesh, mask and camera.
struct Look<'a> {
    mesh: &'a Mesh,
    corners: Tensor<HostBackend, 3>,
    middle: [f64; 3],
    radius: f64,
    camera: &'a Pinhole,
    square: [f64; 3],
    /// The mask at low resolution, and the share of each pixel that the picture covers.
    levels: Vec<f64>,
    covered: Vec<f64>,
    /// Extent of the white pixels, in pixels of the picture.
    white: f64,
    colours: Option<ColouredViews<HostBackend>>,
}

impl<'a> Look<'a> {
    fn new(mesh: &'a Mesh, target: &Target<'_>, camera: &'a Pinhole) -> Self {
        let &Target { mask, square, painted, .. } = target;
        let (middle, radius) = bounding_ball(mesh);
        let [levels, covered] = mask.part(square, COARSE_SIDE);
        let [_, _, white] = mask.square().unwrap_or(square);
        let colours = mesh.colours().zip(painted).map(|(colours, view)| {
            let coat = VertexColours::new(colours, mesh.faces().into());
            ColouredViews::of_pictures(coat, &[(view, square); AT_ONCE], COARSE_SIDE)
        });
        let corners = vertex_tensor(mesh.positions(), &Default::default());
        Self { mesh, corners, middle, radius, camera, square, levels, covered, white, colours }
    }

    /// Pixels of the picture per low-resolution pixel.
    fn pixel(&self) -> f64 {
        self.square[2] / COARSE_SIDE as f64
    }

    /// The direction of a place in the square, as x and y at depth 1.
    fn ray(&self, [column, row]: [f64; 2]) -> [f64; 2] {
        let [left, top, _] = self.square;
        let at = [left + self.pixel() * column, top + self.pixel() * row];
        [0, 1].map(|k| (at[k] - self.camera.centre[k]) / self.camera.focal[k])
    }

    /// The camera of this rotation that sees the middle of the mesh in this direction, at this depth.
    fn place(&self, rotation: [[f64; 3]; 3], [x, y]: [f64; 2], depth: f64) -> Pinhole {
        let seen = rotation.map(|row| (0..3).map(|k| row[k] * self.middle[k]).sum::<f64>());
        let at = [x * depth, y * depth, depth];
        Pinhole { rotation, translation: [0, 1, 2].map(|k| at[k] - seen[k]), ..*self.camera }
    }

    /// The silhouettes of cameras in a square of the picture, `[views, side, side]`, and the projected vertices.
    fn drawn(
        &self,
        cameras: &[Pinhole],
        [left, top, extent]: [f64; 3],
        side: usize,
    ) -> (Tensor<HostBackend, 3>, Projected<HostBackend>) {
        let cropped = cameras.iter().map(|of| of.cropped([left, top], [extent; 2], side));
        let cropped = Pinholes::new(&cropped.collect::<Vec<_>>(), &Default::default());
        let seen = project(self.corners.clone(), &cropped);
        (hard_silhouette(seen.clone(), self.mesh.faces(), side), seen)
    }

    /// The image within the picture, and its error.
    fn judged(&self, cameras: &[Pinhole]) -> [Vec<f64>; 2] {
        let mut cameras = Cow::Borrowed(cameras);
        if self.colours.is_some() && cameras.len() < AT_ONCE {
            // The colour targets have this many views.
            cameras.to_mut().resize(AT_ONCE, *self.camera);
        }
        let views = cameras.len();
        let of_views = |image: &[f64]| {
            tensor::<HostBackend, 3>(image.repeat(views), [views, COARSE_SIDE, COARSE_SIDE])
        };
        let (drawn, seen) = self.drawn(&cameras, self.square, COARSE_SIDE);
        // Pixels outside the picture do not count.
        let drawn = drawn * of_views(&self.covered);
        let loss = iou_loss(drawn.clone(), of_views(&self.levels));
        let loss = match &self.colours {
            Some(colours) => loss + colours.hard_loss(seen, COARSE_SIDE),
            None => loss,
        };
        [numbers(drawn), numbers(loss)]
    }

    /// Cameras of these rotations moved to the mask, with their error before the last move.
    fn moved(&self, rotations: &[[[f64; 3]; 3]]) -> Vec<(Pinhole, f64)> {
        let target = moments(&self.levels);
        // The mask, centred in its square, is first taken as that of a ball.
        let ray = self.ray(target.middle);
        let depth = 2.0 * self.radius * self.camera.focal[0] / self.white;
        let towards = turned_to(ray);
        let placed = rotations.iter().map(|&local| self.place(product(towards, local), ray, depth));
        let mut cameras: Vec<Pinhole> = placed.collect();
        let mut losses = Vec::new();
        // Two moves; the second is nearly exact.
        for _ in 0..2 {
            let [drawn, error] = self.judged(&cameras);
            losses = error;
            for (camera, image) in cameras.iter_mut().zip(drawn.chunks(COARSE_SIDE * COARSE_SIDE)) {
                let now = moments(image);
                let [x, y, z] = camera.transform(self.middle);
                // If nothing is drawn, the mesh is far outside, and the camera does not move.
                let larger = if now.area > 0.0 { (now.area / target.area).sqrt() } else { 1.0 };
                let off = [0, 1].map(|k| {
                    let pixels = target.middle[k]
                        - if now.area > 0.0 { now.middle[k] } else { target.middle[k] };
                    pixels * self.pixel() / camera.focal[k]
                });
                *camera = self.place(
                    camera.rotation,
                    [x / z + off[0], y / z + off[1]],
                    (z * larger).max(NEAREST * self.radius),
                );
            }
        }
        cameras.into_iter().zip(losses).collect()
    }

    /// Cameras of these rotations for a mask that the picture cuts off, whose place and size are unreliable. The whole
    /// silhouette is tried in several sizes at all places, and compared within the picture.
    fn shifted(&self, rotations: &[[[f64; 3]; 3]]) -> Vec<(Pinhole, f64)> {
        let window = Window::new(&self.levels, &self.covered);
        // In the middle, nearer than a ball as large as the visible mask would be.
        let [left, top, extent] = self.square;
        let ray = self.ray([COARSE_SIDE as f64 / 2.0; 2]);
        let towards = turned_to(ray);
        let depth = (2.0 * self.radius * self.camera.focal[0] / self.white / 1.3)
            .max(NEAREST * self.radius);
        // The apparent radius of a ball is that of its tangent lines of sight.
        let across = (depth * depth - self.radius * self.radius).sqrt();
        let reach = 1.05 * self.radius * self.camera.focal[0].max(self.camera.focal[1]) / across;
        let middle = [left + extent / 2.0, top + extent / 2.0];
        let around = [middle[0] - reach, middle[1] - reach, 2.0 * reach];
        let placed: Vec<Pinhole> = rotations
            .iter()
            .map(|&local| self.place(product(towards, local), ray, depth))
            .collect();
        let (drawn, _) = self.drawn(&placed, around, Stencil::SIDE);
        let drawn = numbers(drawn);
        // Window cells per stencil cell.
        let cell = 2.0 * reach / Stencil::SIDE as f64 / self.pixel();
        let mut cameras = Vec::new();
        for (&local, image) in rotations.iter().zip(drawn.chunks(Stencil::SIDE * Stencil::SIDE)) {
            let area = image.iter().sum::<f64>() * cell * cell;
            let fits = SHOWN.iter().filter_map(|shown| {
                let larger = (window.area() / shown / area).sqrt();
                let depth = depth / larger;
                let stencil = Stencil::new(image, cell * larger);
                let (at, overlap) = window.best(&stencil)?;
                (depth >= NEAREST * self.radius).then(|| {
                    let ray = self.ray(at);
                    (self.place(product(turned_to(ray), local), ray, depth), overlap)
                })
            });
            let mut fits: Vec<(Pinhole, f64)> = fits.collect();
            fits.sort_by(|(_, a), (_, b)| b.total_cmp(a));
            cameras.extend(fits.into_iter().take(KEPT).map(|(camera, _)| camera));
        }
        let judged = cameras.chunks(AT_ONCE).flat_map(|some| {
            let [_, losses] = self.judged(some);
            some.iter().copied().zip(losses)
        });
        judged.collect()
    }
}

/// Area and centroid of an image, in its pixels.
struct Moments {
    area: f64,
    middle: [f64; 2],
}

fn moments(image: &[f64]) -> Moments {
    let area: f64 = image.iter().sum();
    let sum = |at: fn(usize) -> usize| {
        image.iter().enumerate().map(|(k, level)| level * (at(k) as f64 + 0.5)).sum::<f64>()
    };
    Moments { area, middle: [sum(|k| k % COARSE_SIDE) / area, sum(|k| k / COARSE_SIDE) / area] }
}

/// Rotations of a camera around its target: directions evenly spread over the sphere, each with evenly spaced rolls.
///
/// Source: the Fibonacci sphere, González 2010.
fn directions() -> impl Iterator<Item = [[f64; 3]; 3]> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..DIRECTIONS * ROLLS).map(move |k| {
        let (direction, roll) = (k / ROLLS, k % ROLLS);
        let y = 1.0 - (2 * direction + 1) as f64 / DIRECTIONS as f64;
        let (sin, cos) = (golden * direction as f64).sin_cos();
        let around = (1.0 - y * y).sqrt();
        // An orbiting camera, then rolled. No direction is a pole.
        let ahead = [around * cos, y, around * sin];
        let right = [-ahead[2] / around, 0.0, ahead[0] / around];
        let down = cross(ahead, right);
        let (sin, cos) = (std::f64::consts::TAU * roll as f64 / ROLLS as f64).sin_cos();
        [
            [0, 1, 2].map(|k| cos * right[k] + sin * down[k]),
            [0, 1, 2].map(|k| cos * down[k] - sin * right[k]),
            ahead,
        ]
    })
}

/// The smallest rotation that takes the forward axis to the direction (x, y, 1).
fn turned_to([x, y]: [f64; 2]) -> [[f64; 3]; 3] {
    let length = (x * x + y * y + 1.0).sqrt();
    let [x, y, z] = [x / length, y / length, 1.0 / length];
    let h = 1.0 / (1.0 + z);
    [[1.0 - h * x * x, -h * x * y, x], [-h * x * y, 1.0 - h * y * y, y], [-x, -y, z]]
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
        let angle_deg = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| {
            let trace: f64 =
                a.as_flattened().iter().zip(b.as_flattened()).map(|(x, y)| x * y).sum();
            ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
        };
        // Arbitrary angles.
        for k in 0..200u32 {
            let [x, y] = [0.7 * f64::from(k), 1.3 * f64::from(k)].map(|a| a.sin() * 2.0);
            let pose = product(
                turned_to([x, y]),
                product(all[37 * k as usize % all.len()], turned_to([y, -x])),
            );
            let nearest = all.iter().map(|&r| angle_deg(pose, r));
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
