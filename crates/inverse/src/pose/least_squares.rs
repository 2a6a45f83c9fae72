//! Refines poses to the least squares of their hard images, by Levenberg-Marquardt with finite differences.
//!
//! Hard images are supersampled: several pixels a side per compared pixel. They are therefore as smooth as a
//! downsampled mask and, unlike soft images, independent of the tessellation of the mesh.

use softrast_mesh::Mesh;
use softrast_raster::{HostBackend, Pinhole};
use softrast_tensor::{Tensor, numbers, tensor};

use super::masks::{MaskPose, MaskPoses, MaskScene};
use crate::InverseProblem;

/// Drawn pixels a side per compared pixel.
const SAMPLES: usize = 4;
/// Most compared pixels a side, which bounds memory: 14 images of 1024 × 1024 pixels are drawn.
const MOST: usize = 256;
/// Most steps.
const STEPS: usize = 12;
/// The search ends after a step that reduces the error by less than this share.
const LEAST_GAIN: f64 = 1e-3;
/// Damping factors tried at every step; 0 is Gauss-Newton.
const DAMPINGS: [f64; 4] = [0.0, 0.03, 0.3, 3.0];
/// Least diagonal entry under damping for a move of a pixel, relative to the mean of all: a parameter without effect does not move.
const LEAST_SQUARE: f64 = 1e-2;
/// Step of the finite differences, in compared pixels: smaller steps would resolve single drawn pixels.
const PIXELS: f64 = 1.0;
/// Image motion per unit of the focal length's logarithm, relative to that per radian of a turn.
const OF_ZOOM: f64 = 0.25;

/// The pose near this one that minimizes the squared difference between the silhouette of the mesh and the mask, with or without the focal
/// length, and the mean squared difference over `size` × `size` pixels (256 × 256 at most). It is the given pose if none near it is better.
/// `visit` receives the share that is done at each step; its error ends the search.
pub(super) fn least_squares(
    mesh: &Mesh,
    pose: &MaskPose,
    optimise_fov: bool,
    size: usize,
    mut visit: impl FnMut(f64) -> anyhow::Result<()>,
) -> anyhow::Result<(Pinhole, f64)> {
    let views = Views::new(mesh, pose, optimise_fov, size.min(MOST));
    let mut theta = vec![0.0; views.moves.len()];
    let mut now = views.differences(&[theta.clone()]).swap_remove(0);
    for step in 0..STEPS {
        visit(step as f64 / STEPS as f64)?;
        let Some((better, differences)) = views.step(&theta, &now) else { break };
        let (error, least) = (squares(&now), squares(&differences));
        if least.is_nan() || least >= error {
            break;
        }
        (theta, now) = (views.held(&better), differences);
        if error - least < LEAST_GAIN * error {
            break;
        }
    }
    let error = squares(&now) / now.len() as f64;
    let moved = theta.iter().any(|&x| x != 0.0);
    Ok((if moved { views.camera(&theta) } else { pose.start }, error))
}

/// Views of the mesh from poses near one.
struct Views {
    problem: MaskPoses,
    instances: Vec<MaskPose>,
    scene: MaskScene<HostBackend>,
    size: usize,
    /// Step of each parameter of θ for finite differences.
    moves: Vec<f64>,
}

impl Views {
    fn new(mesh: &Mesh, pose: &MaskPose, optimise_fov: bool, size: usize) -> Self {
        // A mesh that fills the cropped square has a radius of about 0.4 of it.
        let turn = PIXELS / (0.4 * size as f64);
        let mut moves = vec![turn; 6];
        moves.extend(optimise_fov.then_some(turn / OF_ZOOM));
        let instances = vec![pose.clone(); 2 * moves.len()];
        let mut problem = MaskPoses::new(mesh, instances.clone());
        problem.optimise_fov = optimise_fov;
        let scene = problem.scene(&instances, SAMPLES * size);
        Self { problem, instances, scene, size, moves }
    }

    /// θ of all views: these, padded with the last one.
    fn theta(&self, thetas: &[Vec<f64>]) -> Vec<f64> {
        let last = thetas[thetas.len() - 1].clone();
        let all = thetas.iter().cloned().chain(std::iter::repeat(last));
        all.take(self.instances.len()).flatten().collect()
    }

    /// These θ as a tensor of all views, projected onto the allowed ones.
    fn allowed(&self, thetas: &[Vec<f64>]) -> Tensor<HostBackend, 1> {
        let theta = self.theta(thetas);
        let length = theta.len();
        self.problem.allowed(&self.scene, tensor(theta, [length]))
    }

    /// θ projected onto the allowed ones.
    fn held(&self, theta: &[f64]) -> Vec<f64> {
        let mut all = numbers(self.allowed(&[theta.to_vec()]));
        all.truncate(theta.len());
        all
    }

    /// The differences of image and mask at each of these θ.
    fn differences(&self, thetas: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let Self { problem, scene, size, .. } = self;
        let image = problem.hard_image(scene, self.allowed(thetas));
        let all = numbers(scene.differences(image.squeeze_dim(1), *size));
        all.chunks(size * size).take(thetas.len()).map(<[f64]>::to_vec).collect()
    }

    /// The best of the damped least-squares steps of the linearized image, with its differences; `None` if no system can be solved.
    fn step(&self, theta: &[f64], now: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let count = theta.len();
        let moved = |k: usize| {
            let mut theta = theta.to_vec();
            theta[k / 2] +=
                if k.is_multiple_of(2) { self.moves[k / 2] } else { -self.moves[k / 2] };
            theta
        };
        let seen = self.differences(&(0..2 * count).map(moved).collect::<Vec<_>>());
        let slope = |k: usize| -> Vec<f64> {
            let both = seen[2 * k].iter().zip(&seen[2 * k + 1]);
            both.map(|(more, less)| (more - less) / (2.0 * self.moves[k])).collect()
        };
        let slopes: Vec<Vec<f64>> = (0..count).map(slope).collect();
        let normal: Vec<Vec<f64>> =
            slopes.iter().map(|a| slopes.iter().map(|b| dot(a, b)).collect()).collect();
        let down: Vec<f64> = slopes.iter().map(|slope| -dot(slope, now)).collect();
        let of_pixel = |k: usize| normal[k][k] * self.moves[k].powi(2);
        let mean = (0..count).map(of_pixel).sum::<f64>() / count as f64;
        let stepped = |damping: f64| {
            let mut damped = normal.clone();
            for k in 0..count {
                let least = LEAST_SQUARE * mean / self.moves[k].powi(2);
                damped[k][k] += damping * normal[k][k].max(least);
            }
            let step = solved(damped, down.clone())?;
            Some(theta.iter().zip(step).map(|(at, step)| at + step).collect())
        };
        let tried: Vec<Vec<f64>> = DAMPINGS.into_iter().filter_map(stepped).collect();
        if tried.is_empty() {
            return None;
        }
        let differences = self.differences(&tried);
        let tried = tried.into_iter().zip(differences);
        tried.min_by(|(_, a), (_, b)| squares(a).total_cmp(&squares(b)))
    }

    fn camera(&self, theta: &[f64]) -> Pinhole {
        self.scene.found(self.allowed(&[theta.to_vec()]), &self.instances[..1])[0]
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn squares(a: &[f64]) -> f64 {
    dot(a, a)
}

/// The solution of a symmetric positive definite system; `None` if the matrix is not positive definite.
fn solved(mut matrix: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<Vec<f64>> {
    let count = right.len();
    let least = 1e-12 * (0..count).map(|k| matrix[k][k]).fold(0.0, f64::max);
    for k in 0..count {
        let pivot = matrix[k].clone();
        if pivot[k].is_nan() || pivot[k] <= least {
            return None;
        }
        for i in k + 1..count {
            let factor = matrix[i][k] / pivot[k];
            matrix[i].iter_mut().zip(&pivot).for_each(|(x, above)| *x -= factor * above);
            right[i] -= factor * right[k];
        }
    }
    for k in (0..count).rev() {
        right[k] = (right[k] - dot(&matrix[k][k + 1..], &right[k + 1..])) / matrix[k][k];
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::silhouette_pixels;
    use softrast_mesh::fox;
    use softrast_raster::Orbit;
    use softrast_views::Picture;

    const SIDE: usize = 128;

    fn seen(camera: &Pinhole) -> Picture {
        let pixels = silhouette_pixels(&fox(), camera);
        Picture::new(pixels.iter().map(|&x| x as f32).collect(), SIDE)
    }

    fn camera(elevation_deg: f64, azimuth_deg: f64) -> Pinhole {
        let orbit = Orbit { distance: 3.2, elevation_deg, azimuth_deg, fov_deg: 45.0 };
        Pinhole::from_orbit(&orbit, SIDE)
    }

    fn start(mask: &Picture, start: Pinhole) -> MaskPose {
        let square = mask.view_square().unwrap();
        MaskPose { mask: mask.clone(), square, start, painted: None }
    }

    /// The refined pose, and the errors after and before.
    fn found(pose: &MaskPose, optimise_fov: bool) -> (Pinhole, [f64; 2]) {
        let views = Views::new(&fox(), pose, optimise_fov, 64);
        let before = views.differences(&[vec![0.0; views.moves.len()]]);
        let (camera, after) = least_squares(&fox(), pose, optimise_fov, 64, |_| Ok(())).unwrap();
        (camera, [after, squares(&before[0]) / before[0].len() as f64])
    }

    #[test]
    fn a_pose_that_is_a_few_degrees_off_is_found_to_a_fraction_of_one() {
        for (elevation, azimuth) in [(10.0, 40.0), (-20.0, 160.0), (50.0, 280.0)] {
            let truth = camera(elevation, azimuth);
            let mask = seen(&truth);
            let near = camera(elevation + 3.0, azimuth - 4.0);
            let (found, [after, before]) = found(&start(&mask, near), false);
            let off = crate::pose::found::angle_deg(&found, &truth);
            assert!(off < 0.4 && after < 0.05 * before, "{off} degrees, {before} to {after}");
            assert_eq!(found.focal, truth.focal);
        }
    }

    #[test]
    fn a_focal_length_is_found_with_the_pose() {
        let truth = camera(10.0, 40.0);
        let mask = seen(&truth);
        for zoom in [0.75, 1.3] {
            let [x, y, z] = truth.translation;
            let focal = truth.focal.map(|focal| zoom * focal);
            let near = Pinhole { focal, translation: [x, y, zoom * z], ..truth };
            let (found, [after, before]) = found(&start(&mask, near), true);
            let ratio = found.focal[0] / truth.focal[0];
            assert!((ratio - 1.0).abs() < 0.05 && after < before, "{ratio}, {before} to {after}");
        }
    }

    #[test]
    fn no_pose_becomes_worse_and_one_that_sees_nothing_stays() {
        let mask = seen(&camera(0.0, 0.0));
        for (elevation, azimuth) in [(80.0, 0.0), (0.0, 90.0), (-60.0, 200.0)] {
            let (_, [after, before]) = found(&start(&mask, camera(elevation, azimuth)), true);
            assert!(after <= before, "{before} to {after}");
        }
        let beside = Pinhole { translation: [50.0, 0.0, 3.2], ..camera(0.0, 0.0) };
        let (stays, [after, before]) = found(&start(&mask, beside), true);
        assert_eq!((stays, after), (beside, before));
    }

    #[test]
    fn a_number_that_changes_nothing_does_not_stop_the_others() {
        // The focal length of a lens of a tenth of a degree is undetermined: zoom and depth together change nothing.
        let orbit =
            Orbit { distance: 1800.0, elevation_deg: 10.0, azimuth_deg: 40.0, fov_deg: 0.1 };
        let truth = Pinhole::from_orbit(&orbit, SIDE);
        let near =
            Pinhole::from_orbit(&Orbit { elevation_deg: 13.0, azimuth_deg: 36.0, ..orbit }, SIDE);
        let (found, [after, before]) = found(&start(&seen(&truth), near), true);
        let off = crate::pose::found::angle_deg(&found, &truth);
        assert!(off < 1.0 && after < 0.1 * before, "{off} degrees, {before} to {after}");
    }

    #[test]
    fn equations_are_solved_unless_they_are_singular() {
        let matrix = vec![vec![4.0, 2.0, 0.0], vec![2.0, 3.0, 1.0], vec![0.0, 1.0, 2.0]];
        let solution = solved(matrix.clone(), vec![8.0, 11.0, 8.0]).unwrap();
        for (row, right) in matrix.iter().zip([8.0, 11.0, 8.0]) {
            assert!((dot(row, &solution) - right).abs() < 1e-12);
        }
        assert_eq!(solved(vec![vec![1.0, 1.0], vec![1.0, 1.0]], vec![1.0, 1.0]), None);
        assert_eq!(solved(vec![vec![f64::NAN]], vec![1.0]), None);
        assert_eq!(solved(vec![vec![0.0]], vec![0.0]), None);
    }
}
