//! The loss of a training: `1 - IoU` of silhouettes, and a smoothness term.

use softrast_mesh::Edges;
use softrast_raster::{
    RasterBackend, TConorm, flatness, iou_loss,
    low_level::{Rasterizer, Silhouette},
    project,
};
use softrast_softness::{EdgeSoftness, SoftStep};
use softrast_tensor::{Backend, Element, Int, Tensor, TensorData, tensor_on};

use crate::{SIZE, Template, orbit};

/// Number of steps between updates of support and knots to the learned softness.
const RENEW: usize = 25;

/// Largest error of a pixel. Steps are noisy anyway, and an untrained MLP, whose tails end late,
/// would draw every face on every pixel at a tenth of it.
const TOLERANCE: f64 = 1e-3;

/// The silhouettes of predicted shapes against those of their pictures.
#[derive(Debug)]
pub(crate) struct Objective<B: Backend> {
    rasterizer: Rasterizer,
    template: Template<B>,
    smoothness: Smoothness<B>,
    silhouette: Silhouette<EdgeSoftness>,
    uses: usize,
}

impl<B: RasterBackend> Objective<B> {
    pub(crate) fn new(t_conorm: TConorm, softness: &SoftStep<B>, device: &B::Device) -> Self {
        let rasterizer = Rasterizer { tolerance: TOLERANCE, t_conorm, ..Rasterizer::new(SIZE) };
        let template = Template::new(device);
        let smoothness = Smoothness::new(template.faces(), template.vertices(), device);
        let silhouette =
            rasterizer.prepare(template.faces(), softness.softness, &softness.phi.val());
        Self { rasterizer, template, smoothness, silhouette, uses: 0 }
    }

    /// Starts an epoch: prepared data do not depend on earlier epochs, so that a resumed training
    /// gives the same results.
    pub(crate) fn begin(&mut self) {
        self.uses = 0;
    }

    /// Starts a step with this softness.
    pub(crate) fn renew(&mut self, softness: &SoftStep<B>) {
        if self.uses.is_multiple_of(RENEW) {
            let phi = softness.phi.val();
            self.silhouette =
                self.rasterizer.prepare(self.template.faces(), softness.softness, &phi);
        }
        self.uses += 1;
    }

    /// The template that centres and displacements deform.
    pub(crate) fn template(&self) -> &Template<B> {
        &self.template
    }

    /// The smoothness loss `[1]` of the shapes with these `vertices` `[shapes, 3, vertices]`.
    pub(crate) fn smoothness(&self, vertices: Tensor<B, 3>) -> Tensor<B, 1> {
        self.smoothness.loss(vertices)
    }

    /// `1 - IoU` of soft silhouettes, `[1]`, for the shapes with `vertices`
    /// `[2 pairs, 3, vertices]` that were predicted from `pictures` `[2 pairs, 4, 64, 64]` in these
    /// views: all first pictures of the pairs, then all second ones.
    ///
    /// Either prediction of a pair is drawn from both of its views, four silhouettes; the mean is over
    /// all of them. Source: docs/notes.md, Reconstruction.
    pub(crate) fn silhouettes(
        &self,
        vertices: Tensor<B, 3>,
        pictures: &Tensor<B, 4>,
        views: &[usize],
        softness: &SoftStep<B>,
    ) -> Tensor<B, 1> {
        let pairs = views.len() / 2;
        let alpha = pictures.clone().narrow(1, 3, 1).reshape([2 * pairs, SIZE, SIZE]);
        // Each prediction from its own view, then from the other view of its pair.
        let swapped = |x: &Tensor<B, 3>| {
            Tensor::cat(vec![x.clone().narrow(0, pairs, pairs), x.clone().narrow(0, 0, pairs)], 0)
        };
        let targets = Tensor::cat(vec![alpha.clone(), swapped(&alpha)], 0);
        let others = views[pairs..].iter().chain(&views[..pairs]);
        let orbits = orbits(views.iter().chain(others).copied(), &vertices.device());
        let shapes = Tensor::cat(vec![vertices.clone(), vertices], 0).swap_dims(1, 2);
        let drawn = self.silhouette.coverage(project(shapes, orbits).tensor(), softness.phi.val());
        iou_loss(drawn, targets).mean()
    }
}

/// The cameras of views, `[views, 4]`.
pub(crate) fn orbits<B: Backend>(
    views: impl Iterator<Item = usize>,
    device: &B::Device,
) -> Tensor<B, 2> {
    let values: Vec<f64> = views.flat_map(orbit).collect();
    let views = values.len() / 4;
    tensor_on(values, [views, 4], device)
}

/// A learnable softness, in the float type of the backend.
pub(crate) fn soft_step<B: Backend>(
    softness: EdgeSoftness,
    phi: &[f64],
    device: &B::Device,
) -> SoftStep<B> {
    SoftStep::new(softness, phi, <B::FloatElem as Element>::dtype(), device)
}

/// Weights of the two terms. Source: docs/notes.md, Reconstruction.
const LAPLACIAN: f64 = 5e-3;
const FLATNESS: f64 = 5e-4;

/// Smoothness loss of many shapes with the same closed topology.
#[derive(Clone, Debug)]
pub struct Smoothness<B: Backend> {
    /// Column v maps to the offset of vertex v from the mean of its neighbours, `[vertices, vertices]`. A
    /// dense product costs less than gathering neighbours if there are many shapes.
    away: Tensor<B, 2>,
    /// Four vertices of each hinge, all first ones before all second ones: `[4 hinges]`.
    corners: Tensor<B, 1, Int>,
}

impl<B: Backend> Smoothness<B> {
    /// The loss for shapes with these faces and this many vertices.
    ///
    /// # Panics
    ///
    /// If no two faces share an edge.
    pub fn new(faces: &[[u32; 3]], vertices: usize, device: &B::Device) -> Self {
        let edges = Edges::new(faces);
        assert!(!edges.hinges.is_empty(), "a surface needs faces that share an edge");
        let mut neighbours = vec![Vec::new(); vertices];
        for [a, b] in edges.ends.iter().map(|ends| ends.map(|v| v as usize)) {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        let mut away = vec![0.0; vertices * vertices];
        for (v, near) in neighbours.iter().enumerate().filter(|(_, near)| !near.is_empty()) {
            away[v * vertices + v] = 1.0;
            for &other in near {
                away[other * vertices + v] = -1.0 / near.len() as f64;
            }
        }
        let corners = (0..4).flat_map(|k| edges.hinges.iter().map(move |h| i64::from(h[k])));
        let corners: Vec<i64> = corners.collect();
        let count = corners.len();
        Self {
            away: tensor_on(away, [vertices; 2], device),
            corners: Tensor::from_data(TensorData::new(corners, [count]), device),
        }
    }

    /// Mean over the shapes of 0.005 `Σ |v - mean of the neighbours of v|²` and 0.0005 `Σ (cos α + 1)²`,
    /// `[1]`, of `vertices` `[shapes, 3, vertices]`.
    ///
    /// The first sum is over the vertices; the second over the edges between two faces, whose heights on the edge
    /// enclose α, 180 degrees on a flat surface. Source: docs/notes.md, Losses and errors.
    pub fn loss(&self, vertices: Tensor<B, 3>) -> Tensor<B, 1> {
        let [shapes, _, count] = vertices.dims();
        let rows = vertices.reshape([3 * shapes, count]);
        let away = rows.clone().matmul(self.away.clone());
        let laplacian = (away.clone() * away).sum();
        let [count] = self.corners.dims();
        let hinges = rows.select(1, self.corners.clone()).reshape([shapes, 3, count]);
        let flatness = flatness(hinges);
        (laplacian * LAPLACIAN + flatness * FLATNESS) * (shapes as f64).recip()
    }
}
