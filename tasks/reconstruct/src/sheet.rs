//! Contact sheets of inputs and predictions.

use image::{Rgb, RgbImage, imageops};
use softrast_lab::contact_sheet;
use softrast_mesh::vectors::{dot, norm, normal};
use softrast_tensor::Backend;

use crate::{Network, SIZE, Shapes, Template, VIEWS, score, view};

/// Small pictures are enlarged by this factor.
const ENLARGED: u32 = 2;
/// Most classes with a row, and shapes in each row.
const CLASSES: usize = 13;
const SHAPES: usize = 2;
/// Views between the input view and the second view: 105 degrees.
const TURNED: usize = 7;
/// Colour of predicted shapes.
const COLOUR: [f64; 3] = [0.55, 0.68, 0.9];

/// One row per class, with two shapes each: the input, the prediction from the same view, then the
/// prediction and the ground truth from another view.
///
/// # Errors
///
/// If a shape cannot be read.
pub(crate) fn sheet<B: Backend>(
    network: &Network<B>,
    template: &Template<B>,
    shapes: &dyn Shapes,
    device: &B::Device,
) -> anyhow::Result<RgbImage> {
    let mut cells = Vec::new();
    for class in 0..shapes.classes().len().min(CLASSES) {
        for shape in 0..SHAPES {
            let shape = shape.min(shapes.count(class) - 1);
            let view = score::view_of(shape + class, 0, 1);
            let other = (view + TURNED) % VIEWS;
            let input = shapes.picture(class, shape, view)?;
            let predicted = score::predict(network, template, std::slice::from_ref(&input), device);
            let drawn = |view| drawn(&predicted[0], template.faces(), view);
            let truth = on_white(&shapes.picture(class, shape, other)?);
            cells.extend([on_white(&input), drawn(view), drawn(other), truth].map(|image| {
                let side = SIZE as u32 * ENLARGED;
                imageops::resize(&image, side, side, imageops::FilterType::Nearest)
            }));
        }
    }
    Ok(contact_sheet(&cells, 4 * SHAPES))
}

/// A picture from planes of red, green, blue and alpha, on white.
fn on_white(planes: &[u8]) -> RgbImage {
    let pixels = SIZE * SIZE;
    RgbImage::from_fn(SIZE as u32, SIZE as u32, |x, y| {
        let pixel = y as usize * SIZE + x as usize;
        let alpha = f64::from(planes[3 * pixels + pixel]) / 255.0;
        Rgb([0, 1, 2].map(|k| {
            let colour = f64::from(planes[k * pixels + pixel]);
            (colour * alpha + 255.0 * (1.0 - alpha)).round() as u8
        }))
    })
}

/// A mesh in a view, with the light of the pictures of solids and hidden faces removed.
pub(crate) fn drawn(vertices: &[[f64; 3]], faces: &[[u32; 3]], view: usize) -> RgbImage {
    let [distance, _, _, fov] = view::orbit(view);
    let axes = view::axes(view);
    let focal = (fov / 2.0).to_radians().tan().recip();
    let mut image = RgbImage::from_pixel(SIZE as u32, SIZE as u32, Rgb([255; 3]));
    let mut nearest = vec![f64::INFINITY; SIZE * SIZE];
    let seen: Vec<[f64; 3]> = vertices
        .iter()
        .map(|&p| {
            let [x, y, z] = axes.map(|axis| dot(axis, p));
            let depth = (z + distance).max(0.01);
            let pixel = |ndc: f64| (ndc + 1.0) * SIZE as f64 / 2.0 - 0.5;
            [pixel(focal * x / depth), pixel(-focal * y / depth), depth]
        })
        .collect();
    for face in faces {
        let [a, b, c] = face.map(|v| seen[v as usize]);
        let normal = normal(face.map(|v| vertices[v as usize]));
        // Surfaces that are turned inside out are lit as if they were not.
        let side = if dot(normal, axes[2]) > 0.0 { -1.0 } else { 1.0 };
        let length = norm(normal).max(1e-12) * side;
        let light = view::light(normal.map(|x| x / length), &axes);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area.abs() < 1e-9 {
            continue;
        }
        let range = |k: usize| {
            let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            low.ceil().max(0.0) as usize..=(high.floor().min(SIZE as f64 - 1.0)).max(-1.0) as usize
        };
        for y in range(1) {
            for x in range(0) {
                let (px, py) = (x as f64, y as f64);
                let part = |u: [f64; 3], v: [f64; 3]| {
                    ((u[0] - px) * (v[1] - py) - (v[0] - px) * (u[1] - py)) / area
                };
                let weights = [part(b, c), part(c, a), part(a, b)];
                if weights.iter().any(|&w| w < 0.0) {
                    continue;
                }
                let depth = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2];
                if depth < nearest[y * SIZE + x] {
                    nearest[y * SIZE + x] = depth;
                    let colour = COLOUR.map(|c| (255.0 * c * light).round() as u8);
                    image.put_pixel(x as u32, y as u32, Rgb(colour));
                }
            }
        }
    }
    image
}
