use std::sync::Arc;

use anyhow::ensure;
use serde::Deserialize;
use softrast_raster::{Projected, RasterBackend, SoftRenderer, TConorm, low_level::Rasterizer};
use softrast_softness::{EdgeSoftness, Softness};
use softrast_tensor::{Autodiff, Tensor, numbers, tensor};

use crate::{Backend, SoftnessChoice};

/// Most pixels a side of the picture and of the gradients, and most triangles.
const LARGEST: usize = 256;
const MOST: usize = 8;
/// Largest error of a pixel: a tenth of a screen's resolution of levels.
const TOLERANCE: f64 = 4e-4;

/// Triangles and their display.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Corners in NDC, x right and y up.
    pub triangles: Vec<[[f64; 2]; 3]>,
    /// The softness of edges, scaled to the width; a surrogate is ignored.
    pub softness: SoftnessChoice,
    /// Its width, in NDC.
    pub width: f64,
    /// T-conorm of the coverages, such as `probabilistic` or `yager:2`.
    pub t_conorm: String,
    /// Pixels a side of the picture.
    pub size: usize,
    /// Pixels a side of the gradients.
    pub grid: usize,
}

/// A soft picture, and the gradient of every pixel with respect to the triangles.
pub struct Field {
    /// Coverage `[size * size]` in [0, 1], top row first.
    pub image: Vec<f32>,
    /// Derivatives of the coverage of each pixel of a coarser picture with respect to each corner:
    /// `[grid * grid, triangles, 3, 2]`, per NDC.
    pub gradient: Vec<f32>,
}

/// Draws triangles over each other, and caches renderers for the next picture.
#[derive(Default)]
pub struct Playground {
    kept: Option<(Key, SoftRenderer<EdgeSoftness>, SoftRenderer<EdgeSoftness>)>,
}

/// Parameters of the cached renderers, except the width.
#[derive(PartialEq)]
struct Key {
    name: String,
    squared: bool,
    t_conorm: TConorm,
    size: usize,
    triangles: usize,
}

impl Playground {
    /// The picture of a scene and its gradients.
    ///
    /// # Errors
    ///
    /// If a name is unknown, or a number out of range.
    pub fn draw(&mut self, scene: &Scene) -> anyhow::Result<Field> {
        let Scene { triangles, softness: choice, width, t_conorm, size, grid } = scene;
        ensure!(
            (1..=MOST).contains(&triangles.len()),
            "{} triangles: expected 1 to {MOST}",
            triangles.len()
        );
        ensure!(
            (1..=LARGEST).contains(size) && (1..=LARGEST).contains(grid),
            "a picture of {size} pixels a side and gradients at {grid}: expected 1 to {LARGEST}"
        );
        ensure!((1e-4..=1.0).contains(width), "a width of {width}: expected 1e-4 to 1");
        ensure!(
            triangles.as_flattened().as_flattened().iter().all(|x| x.abs() <= 100.0),
            "a corner is more than 100 away"
        );
        let softness = choice.of_task("pose")?;
        let edge = softness.softness;
        let phi = of_width(edge, &softness.phi_at(0.0, *size), *width);
        let key = Key {
            name: choice.name.clone(),
            squared: choice.squared,
            t_conorm: t_conorm.parse()?,
            size: *size,
            triangles: triangles.len(),
        };
        let kept = self.kept.take().filter(|(kept, ..)| *kept == key);
        let (key, mut picture, mut pixel) = kept.unwrap_or_else(|| {
            let count = triangles.len() as u32;
            let faces: Arc<[_]> = (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
            let renderer = |size: usize| {
                let (t_conorm, tolerance) = (key.t_conorm, TOLERANCE);
                let rasterizer = Rasterizer { t_conorm, tolerance, ..Rasterizer::new(size) };
                SoftRenderer::with_rasterizer(rasterizer, faces.clone(), edge, phi.clone())
            };
            let [picture, pixel] = [*size, 1].map(renderer);
            (key, picture, pixel)
        });
        picture.set_phi(phi.clone());
        pixel.set_phi(phi);
        let corners = triangles.as_flattened();
        let image = picture.silhouette(Projected::new(vertices::<Backend>(corners, &[[0.0; 2]])));
        let gradient = gradients(&pixel, corners, *grid);
        self.kept = Some((key, picture, pixel));
        Ok(Field { image: floats(image), gradient })
    }
}

/// The parameters scaled to a width in NDC.
fn of_width(edge: EdgeSoftness, phi: &[f64], width: f64) -> Vec<f64> {
    let ratio = width / edge.width(phi);
    edge.with_scale_values(phi, if edge.scale_is_squared() { ratio * ratio } else { ratio })
}

/// Derivatives of the coverage at the pixels of a `grid` with respect to each corner, `[grid * grid, corners, 2]`.
///
/// Every pixel is a separate view of one pixel, with the triangles moved to it: the gradient of the sum of all images
/// then has the gradient of each pixel in that view's corners.
fn gradients(pixel: &SoftRenderer<EdgeSoftness>, corners: &[[f64; 2]], grid: usize) -> Vec<f32> {
    let centre = |k: usize| (2 * k + 1) as f64 / grid as f64 - 1.0;
    let places: Vec<_> = (0..grid * grid).map(|k| [centre(k % grid), -centre(k / grid)]).collect();
    let leaf = vertices::<Autodiff<Backend>>(corners, &places).require_grad();
    let gradient = leaf.grad(&pixel.silhouette(Projected::new(leaf.clone())).sum().backward());
    let gradient = gradient.unwrap_or_else(|| leaf.inner().zeros_like());
    floats(gradient.narrow(2, 0, 2))
}

/// Corners relative to each of these places, `[places, corners, 3]`: x and y in NDC, depth 1.
fn vertices<B: RasterBackend>(corners: &[[f64; 2]], places: &[[f64; 2]]) -> Tensor<B, 3> {
    let from = |[x, y]: &[f64; 2]| {
        let (x, y) = (*x, *y);
        corners.iter().flat_map(move |corner| [corner[0] - x, corner[1] - y, 1.0])
    };
    tensor(places.iter().flat_map(from).collect(), [places.len(), corners.len(), 3])
}

fn floats<const D: usize>(tensor: Tensor<Backend, D>) -> Vec<f32> {
    numbers(tensor).into_iter().map(|x| x as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(t_conorm: &str) -> Scene {
        let softness =
            SoftnessChoice { name: "logistic".into(), squared: false, first: 0.03, last: 0.002 };
        let triangles =
            vec![[[-0.6, -0.5], [0.7, -0.4], [0.1, 0.6]], [[0.5, 0.5], [-0.5, 0.3], [0.0, -0.7]]];
        Scene { triangles, softness, width: 0.1, t_conorm: t_conorm.into(), size: 16, grid: 16 }
    }

    #[test]
    fn gradients_of_pixels_are_differences_of_the_picture() {
        let step = 1e-2;
        for t_conorm in ["probabilistic", "einstein", "yager:2"] {
            let given = scene(t_conorm);
            let field = Playground::default().draw(&given).unwrap();
            for (triangle, corner, axis) in [(0, 1, 0), (1, 2, 1)] {
                let image = |by: f64| {
                    let mut moved = given.clone();
                    moved.triangles[triangle][corner][axis] += by;
                    Playground::default().draw(&moved).unwrap().image
                };
                let (more, less) = (image(step), image(-step));
                let largest = (0..256).map(|k| {
                    let found = field.gradient[((k * 2 + triangle) * 3 + corner) * 2 + axis];
                    (found - (more[k] - less[k]) / (2.0 * step as f32)).abs()
                });
                let largest = largest.fold(0.0, f32::max);
                assert!(largest < 0.03, "{t_conorm}: {largest}");
            }
        }
    }

    #[test]
    fn a_narrower_softness_is_drawn_with_what_was_kept() {
        let (mut kept, given) = (Playground::default(), scene("probabilistic"));
        kept.draw(&given).unwrap();
        let narrow = Scene { width: 0.02, ..given };
        let (again, anew) =
            (kept.draw(&narrow).unwrap(), Playground::default().draw(&narrow).unwrap());
        let difference = again.image.iter().zip(&anew.image).map(|(a, b)| (a - b).abs());
        assert!(difference.fold(0.0, f32::max) < 2e-3);
    }

    #[test]
    fn wrong_numbers_are_one_line() {
        let unknown = Playground::default().draw(&scene("sum")).err().unwrap().to_string();
        assert!(unknown.starts_with("unknown T-conorm \"sum\""), "{unknown}");
        let wide = Playground::default().draw(&Scene { width: 2.0, ..scene("einstein") });
        assert_eq!(wide.err().unwrap().to_string(), "a width of 2: expected 1e-4 to 1");
    }
}
