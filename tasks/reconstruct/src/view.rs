//! Pictures of solids by ray casting, without the rasterizer: training data must not depend on the
//! renderer in training.

use softrast_mesh::vectors::{difference, dot, norm};

use crate::solid::{Part, Solid};

/// Width and height of the pictures in pixels.
pub const SIZE: usize = 64;
/// Views around a shape.
pub const VIEWS: usize = 24;
/// Distance of the cameras in world units, their elevation and field of view.
///
/// Source: docs/notes.md, Reconstruction.
const DISTANCE: f64 = 2.732;
const ELEVATION_DEG: f64 = 30.0;
const FOV_DEG: f64 = 30.0;

/// Largest distance at which a ray has met a surface, in world units: a thirtieth of a pixel.
const MET: f64 = 8e-4;
/// Most steps of a ray; more occur only where it grazes a surface.
const STEPS: usize = 96;

/// Camera of a view: distance, elevation, azimuth and field of view, in world units and degrees, as
/// in [`softrast_raster::project`]. Azimuth falls by 15 degrees from view to view.
pub fn orbit(view: usize) -> [f64; 4] {
    [DISTANCE, ELEVATION_DEG, -360.0 / VIEWS as f64 * view as f64, FOV_DEG]
}

/// Right, up and ahead of the camera of a view, in world axes.
pub(crate) fn axes(view: usize) -> [[f64; 3]; 3] {
    let [_, elevation, azimuth, _] = orbit(view).map(f64::to_radians);
    let ([se, ce], [sa, ca]) = ([elevation.sin(), elevation.cos()], [azimuth.sin(), azimuth.cos()]);
    [[-ca, 0.0, -sa], [-se * sa, ce, se * ca], [-ce * sa, -se, ce * ca]]
}

/// Light that a surface with the unit `normal` reflects to the camera with these [`axes`], 0 to 1:
/// from above, and a little from behind the camera's left.
pub(crate) fn light(normal: [f64; 3], axes: &[[f64; 3]; 3]) -> f64 {
    let towards = [0, 1, 2].map(|k| 0.7 * axes[1][k] - 0.8 * axes[2][k] - 0.4 * axes[0][k]);
    let facing = dot(normal, towards) / norm(towards);
    0.25 + 0.45 * facing.max(0.0) + 0.3 * (0.5 + 0.5 * normal[1])
}

/// The picture of `solid` in a view: planes of red, green, blue and alpha, `[4 * 64 * 64]`, each
/// row by row from the top. Alpha is 255 if the ray through the centre of the pixel meets the
/// solid, otherwise alpha and colours are 0.
pub(crate) fn picture(solid: &Solid, view: usize) -> Vec<u8> {
    let axes = axes(view);
    let focal = (FOV_DEG / 2.0).to_radians().tan();
    let eye = axes[2].map(|x| -DISTANCE * x);
    let pixels = SIZE * SIZE;
    let mut planes = vec![0; 4 * pixels];
    let ndc = |k: usize| (2 * k + 1) as f64 / SIZE as f64 - 1.0;
    let balls: Vec<_> = solid.parts.iter().map(Part::ball).collect();
    let mut near = Vec::new();
    for pixel in 0..pixels {
        let (x, y) = (focal * ndc(pixel % SIZE), -focal * ndc(pixel / SIZE));
        let ray = [0, 1, 2].map(|k| x * axes[0][k] + y * axes[1][k] + axes[2][k]);
        let length = norm(ray);
        let ray = ray.map(|x| x / length);
        // Only parts whose bounding ball the ray passes through can be met.
        near.clear();
        let (mut start, mut end) = (f64::INFINITY, 0.0_f64);
        for (part, ball) in solid.parts.iter().zip(&balls) {
            if let Some((enters, leaves)) = passage(eye, ray, ball) {
                near.push(part);
                (start, end) = (start.min(enters), end.max(leaves));
            }
        }
        let Some(point) = meeting(&near, eye, ray, start..end) else { continue };
        let light = light(normal(solid, point), &axes);
        for (channel, colour) in solid.colour.iter().enumerate() {
            planes[channel * pixels + pixel] = (255.0 * light * colour).round() as u8;
        }
        planes[3 * pixels + pixel] = 255;
    }
    planes
}

/// Entry and exit of a ray through a ball, as distances from the eye.
fn passage(eye: [f64; 3], ray: [f64; 3], (centre, radius): &([f64; 3], f64)) -> Option<(f64, f64)> {
    let offset = difference(*centre, eye);
    let along = dot(offset, ray);
    let square = radius * radius - (dot(offset, offset) - along * along);
    (square > 0.0).then(|| (along - square.sqrt(), along + square.sqrt()))
}

/// The first intersection of a ray with the parts, by sphere tracing.
fn meeting(
    parts: &[&Part],
    eye: [f64; 3],
    ray: [f64; 3],
    range: std::ops::Range<f64>,
) -> Option<[f64; 3]> {
    let mut t = range.start;
    for _ in 0..STEPS {
        if t >= range.end {
            return None;
        }
        let point = [0, 1, 2].map(|k| eye[k] + t * ray[k]);
        let distance = parts.iter().map(|part| part.distance(point)).fold(f64::INFINITY, f64::min);
        if distance < MET {
            return Some(point);
        }
        t += distance;
    }
    None
}

/// The surface normal near `p`.
fn normal(solid: &Solid, p: [f64; 3]) -> [f64; 3] {
    const H: f64 = 1e-4;
    let at = |k: usize, by: f64| {
        let mut p = p;
        p[k] += by;
        solid.distance(p)
    };
    let gradient = [0, 1, 2].map(|k| at(k, H) - at(k, -H));
    let length = norm(gradient).max(1e-12);
    gradient.map(|x| x / length)
}
