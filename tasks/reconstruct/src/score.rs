use rayon::prelude::*;
use softrast_tensor::{Backend, numbers, tensor_on};

use crate::{Network, Shapes, Template, VIEWS, Voxels, pairs, template::points};

/// Pictures per batch of the network.
const BATCH: usize = 32;

/// Scores of shapes predicted from single pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Mean voxel `IoU` of each class, 0 to 1.
    pub classes: Vec<f64>,
    /// Mean voxel `IoU` of each class for the undeformed sphere, 0 to 1.
    pub sphere: Vec<f64>,
    /// Pictures of each class.
    pub pictures: Vec<usize>,
}

/// Scores `network` on the first `per_class` shapes of every class, each from `views` views that
/// are spread around it and differ between shapes.
///
/// # Errors
///
/// If a shape cannot be read, or the network returns non-finite coordinates.
pub fn score<B: Backend>(
    network: &Network<B>,
    template: &Template<B>,
    shapes: &dyn Shapes,
    [per_class, views]: [usize; 2],
    device: &B::Device,
) -> anyhow::Result<Score> {
    let faces = template.faces();
    let sphere = Voxels::of_mesh(&sphere(template, device), faces);
    let mut score = Score { classes: Vec::new(), sphere: Vec::new(), pictures: Vec::new() };
    for class in 0..shapes.classes().len() {
        let chosen: Vec<usize> = (0..per_class.min(shapes.count(class))).collect();
        let truths = chosen.par_iter().map(|&shape| shapes.voxels(class, shape));
        let truths = truths.collect::<anyhow::Result<Vec<_>>>()?;
        let seen: Vec<[usize; 2]> = chosen
            .iter()
            .flat_map(|&shape| (0..views).map(move |k| [shape, view_of(shape, k, views)]))
            .collect();
        let mut total = 0.0;
        for seen in seen.chunks(BATCH) {
            let pictures = seen.par_iter().map(|&[shape, view]| shapes.picture(class, shape, view));
            let pictures = pictures.collect::<anyhow::Result<Vec<_>>>()?;
            let predicted = predict(network, template, &pictures, device);
            let ious = predicted.par_iter().zip(seen).map(|(vertices, &[shape, _])| {
                Voxels::of_mesh(vertices, faces).iou(&truths[shape])
            });
            total += ious.collect::<Vec<f64>>().iter().sum::<f64>();
        }
        score.classes.push(total / seen.len() as f64);
        let of_sphere = truths.iter().map(|truth| sphere.iou(truth)).sum::<f64>();
        score.sphere.push(of_sphere / truths.len() as f64);
        score.pictures.push(seen.len());
    }
    Ok(score)
}

/// The values of all classes, and their mean.
pub(crate) fn with_mean(classes: &[f64]) -> impl Iterator<Item = f64> {
    classes.iter().copied().chain([softrast_lab::mean(classes)])
}

/// The k-th of `views` views of a shape.
pub(crate) fn view_of(shape: usize, k: usize, views: usize) -> usize {
    // 7 and 24 are coprime: neighbours differ, and all views occur.
    (7 * shape + k * VIEWS / views) % VIEWS
}

/// The vertices that the network predicts from `pictures`.
pub(crate) fn predict<B: Backend>(
    network: &Network<B>,
    template: &Template<B>,
    pictures: &[Vec<u8>],
    device: &B::Device,
) -> Vec<Vec<[f64; 3]>> {
    let (centre, displacement) = network.forward(pairs::tensor(pictures, device));
    let planes = numbers(template.deformed(centre, displacement));
    planes.chunks(3 * template.vertices()).map(points).collect()
}

/// The undeformed vertices.
fn sphere<B: Backend>(template: &Template<B>, device: &B::Device) -> Vec<[f64; 3]> {
    let count = template.vertices();
    let displacement = tensor_on(vec![0.0; 3 * count], [1, 3, count], device);
    let centre = tensor_on(vec![0.0; 3], [1, 3], device);
    points(&numbers(template.deformed(centre, displacement)))
}
