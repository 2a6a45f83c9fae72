use std::sync::Arc;

use softrast_raster::{
    Attributes, ColourRenderer, HostBackend, NEAR, Pinhole, Pinholes, Projected, RasterBackend,
    SoftRenderer, TConorm, project,
};
use softrast_softness::{DepthSoftness, EdgeSoftness, Family};
use softrast_tensor::{Autodiff, Tensor, TensorData};

use super::{
    pixels::{judge_channels, judge_mask},
    target::Target,
    view::ViewOfShape,
};
use crate::RemeshingAdam;

type B = Autodiff<HostBackend>;

/// Scale of the soft edge, in pixels.
const EDGE_PX: f64 = 0.35;
/// Scale of the depth softness, in units of half the extent of the object.
const DEPTH: f64 = 0.02;
/// Largest error of a pixel, in coverage or in the range of the channels.
const TOLERANCE: f64 = 1e-3;
/// Samples along each side of a pixel for its hard coverage.
const SAMPLES: usize = 2;
/// Channels of normals, and of colours.
const CHANNELS: usize = 3;

/// Views at one resolution, and the renderers of the surface there.
pub(super) struct Stage {
    targets: Vec<Target>,
    cameras: Vec<Pinhole>,
    silhouettes: SoftRenderer<EdgeSoftness>,
    colours: ColourRenderer,
    has_normals: bool,
    has_colours: bool,
}

/// A step's loss, a mean over pixels, and its gradients.
pub(super) struct Pulled {
    pub(super) loss: f64,
    /// `[vertices, 3]`.
    pub(super) vertices: Vec<f32>,
    /// The gradient with respect to vertex colours, if they are optimised.
    pub(super) colours: Option<Vec<f32>>,
}

impl Stage {
    /// Renderers for these targets of all views, of an object within `reach` of the origin. If `is_hard`, coverage is hard, with the
    /// gradient of soft coverage.
    pub(super) fn new(
        views: &[ViewOfShape],
        targets: Vec<Target>,
        reach: f64,
        is_hard: bool,
    ) -> Self {
        let size = targets[0].size;
        let cameras: Vec<Pinhole> = views.iter().map(|view| view.camera(size)).collect();
        let depths = || cameras.iter().map(|camera| camera.translation[2]);
        let near = (depths().fold(f64::INFINITY, f64::min) - reach).max(NEAR);
        let planes = [near, depths().fold(near, f64::max) + reach];
        let edge = EdgeSoftness::new(Family::CubicHermite);
        let scale = EDGE_PX * 2.0 / size as f64;
        let depth = DEPTH * reach / (planes[1] - planes[0]);
        // The faces of the surface replace this one.
        let face = [[0, 1, 2]];
        // The bounded sum is exact for two adjacent front faces.
        let silhouettes = SoftRenderer::new(&face, size, edge, scale)
            .with_tolerance(TOLERANCE)
            .with_t_conorm(TConorm::Yager(1.0))
            .without_back_faces();
        let silhouettes = if is_hard { silhouettes.with_hard_image(SAMPLES) } else { silhouettes };
        let colours = ColourRenderer::new(&face, size, edge, scale, planes)
            .with_depth(DepthSoftness::Family(Family::Exp), depth)
            .with_tolerance(TOLERANCE)
            .without_back_faces();
        let has_normals = targets.iter().any(|target| target.normals.is_some());
        let has_colours = targets.iter().any(|target| target.colours.is_some());
        Self { targets, cameras, silhouettes, colours, has_normals, has_colours }
    }

    /// The loss of a surface in one of the views, and its gradients.
    pub(super) fn pull(&mut self, shape: &RemeshingAdam, view: usize) -> Pulled {
        let device = Default::default();
        let faces: Arc<[[u32; 3]]> = shape.faces().into();
        self.silhouettes = self.silhouettes.with_faces(faces.clone());
        self.colours = self.colours.with_faces(faces.clone());
        let geometry = shape.geometry();
        let vertices = leaf(geometry.positions().to_vec(), 3);
        let cameras = Pinholes::new(&[self.cameras[view]], &device);
        let seen = project(vertices.clone(), cameras);
        let coverage = self.silhouettes.silhouette(seen.clone());
        let drawn = self.drawn(shape, &faces, seen);

        let (target, covered) = (&self.targets[view], floats(coverage.clone().inner()));
        let pixels = covered.len();
        let mut to_coverage = vec![0.0; pixels];
        let mut loss = judge_mask(target, &covered, &mut to_coverage);
        let mut total = None;
        if let Some(Drawn { image, .. }) = &drawn {
            let shown = floats(image.clone().inner());
            let mut to_image = vec![0.0; shown.len()];
            let kinds = [(self.has_normals, &target.normals), (self.has_colours, &target.colours)];
            let parts = kinds.into_iter().filter(|(has, _)| *has).map(|(_, channels)| channels);
            let length = CHANNELS * pixels;
            for (k, known) in parts.enumerate() {
                let (range, Some(known)) = (k * length..(k + 1) * length, known) else { continue };
                let (channels, to) = (&shown[range.clone()], &mut to_image[range]);
                let known = (known, target.counted.as_slice());
                loss += judge_channels(known, &covered, channels, to, &mut to_coverage);
            }
            total = Some(along(image.clone(), to_image));
        }
        let by_coverage = along(coverage, to_coverage);
        let total = total.map_or(by_coverage.clone(), |total| total + by_coverage);
        let gradients = total.backward();
        let gradient = |of: &Tensor<B, 3>| {
            of.grad(&gradients).map_or_else(|| vec![0.0; of.dims().iter().product()], floats)
        };
        let mut to_vertices = gradient(&vertices);
        let mut colours = None;
        if let Some(Drawn { channels, .. }) = &drawn {
            let (rows, width) = (gradient(channels), channels.dims()[2]);
            if self.has_normals {
                let mut halves = triples(&rows, width, 0);
                halves.iter_mut().for_each(|half| *half *= 0.5);
                let pulled = geometry.pulled_back(&faces, &halves);
                to_vertices.iter_mut().zip(pulled).for_each(|(to, pulled)| *to += pulled);
            }
            colours = self.has_colours.then(|| triples(&rows, width, width - CHANNELS));
        }
        Pulled { loss: loss / pixels as f64, vertices: to_vertices, colours }
    }

    /// Half normals and colours in the view, if there are some.
    fn drawn(
        &self,
        shape: &RemeshingAdam,
        faces: &Arc<[[u32; 3]]>,
        seen: Projected<B>,
    ) -> Option<Drawn> {
        let normals = shape.geometry().normals();
        let halves = self.has_normals.then(|| normals.iter().map(|n| 0.5 * n).collect());
        let colours = self.has_colours.then(|| shape.colours());
        let (numbers, count) = match (halves, colours) {
            (Some(numbers), None) | (None, Some(numbers)) => (numbers, CHANNELS),
            (Some(halves), Some(colours)) => (interleaved(&halves, &colours), 2 * CHANNELS),
            (None, None) => return None,
        };
        let background = self.colours.background(&vec![0.0; count], &Default::default());
        let channels = leaf(numbers, count);
        let attributes = Attributes::new(channels.clone(), faces.clone());
        let image = self.colours.image(seen, &attributes, &background);
        Some(Drawn { channels, image })
    }
}

/// Channels of a surface in a view, in addition to its coverage.
struct Drawn {
    /// Numbers at vertices, `[1, vertices, channels]`.
    channels: Tensor<B, 3>,
    image: Tensor<B, 4>,
}

/// Three columns of rows of this width, `[rows, 3]`.
fn triples(numbers: &[f32], width: usize, first: usize) -> Vec<f32> {
    if width == CHANNELS {
        return numbers.to_vec();
    }
    let mut all = vec![0.0; numbers.len() / width * CHANNELS];
    let rows = numbers.chunks_exact(width).zip(all.as_chunks_mut::<CHANNELS>().0);
    rows.for_each(|(row, to)| to.copy_from_slice(&row[first..first + CHANNELS]));
    all
}

/// Rows of three of one list, each followed by a row of the other.
fn interleaved(first: &[f32], second: &[f32]) -> Vec<f32> {
    let rows = first.as_chunks::<CHANNELS>().0.iter().zip(second.as_chunks::<CHANNELS>().0);
    rows.flat_map(|(first, second)| first.iter().chain(second)).copied().collect()
}

/// A leaf to differentiate, `[1, vertices, width]`, with the numbers `[vertices, width]`.
fn leaf(numbers: Vec<f32>, width: usize) -> Tensor<B, 3> {
    let shape = [1, numbers.len() / width, width];
    Tensor::from_data(TensorData::new(numbers, shape), &Default::default()).require_grad()
}

/// Inner product of an image and a direction, whose gradient with respect to the image is the direction.
fn along<const D: usize>(image: Tensor<B, D>, direction: Vec<f32>) -> Tensor<B, 1> {
    let data = TensorData::new(direction, image.shape());
    (image * Tensor::from_data(data, &Default::default())).sum()
}

/// Numbers of a tensor, read in place: conversion through the data of a shared tensor goes number by number.
fn floats<const D: usize>(tensor: Tensor<HostBackend, D>) -> Vec<f32> {
    let in_place =
        HostBackend::numbers(&tensor.clone().into_primitive().tensor()).map(<[f32]>::to_vec);
    in_place.unwrap_or_else(|| tensor.into_data().iter().collect())
}
