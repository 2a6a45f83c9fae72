use burn::tensor::{Element, Tensor, TensorData, backend::Backend};
use softrast_raster::{RasterBackend, Rasterizer, Silhouette, TConorm, iou_loss, project};
use softrast_softness::{EdgeSoftness, SoftStep};

use crate::{SIZE, Template, orbit, smoothness::Smoothness};

/// Steps after which support and knots follow a softness that learns.
const RENEW: usize = 25;

/// Largest error of a pixel. Steps are noisy anyway, and an MLP that has not learned yet, whose tails
/// end late, would draw every face on every pixel at a tenth of it.
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
        let rasterizer = Rasterizer { size: SIZE, tolerance: TOLERANCE, t_conorm };
        let template = Template::new(device);
        let smoothness = Smoothness::new(template.faces(), template.vertices(), device);
        let silhouette =
            rasterizer.prepare(template.faces(), softness.softness, &softness.phi.val());
        Self { rasterizer, template, smoothness, silhouette, uses: 0 }
    }

    /// Starts an epoch: what is prepared does not depend on those before, so that a training which is
    /// resumed goes on as it would have.
    pub(crate) fn begin(&mut self) {
        self.uses = 0;
    }

    /// The template that centres and displacements deform.
    pub(crate) fn template(&self) -> &Template<B> {
        &self.template
    }

    /// What keeps the shapes with these `vertices` `[shapes, 3, vertices]` smooth, `[1]`.
    pub(crate) fn smoothness(&self, vertices: Tensor<B, 3>) -> Tensor<B, 1> {
        self.smoothness.loss(vertices)
    }

    /// `1 - IoU` of soft silhouettes, `[1]`: of the shapes with `vertices` `[2 pairs, 3, vertices]` that
    /// were predicted from `pictures` `[2 pairs, 4, 64, 64]` in these views, first all first pictures of
    /// the pairs, then all second ones.
    ///
    /// Either prediction of a pair is drawn from both of its views, four silhouettes; the mean is over
    /// all of them. Source: docs/notes.md, Reconstruction.
    pub(crate) fn silhouettes(
        &mut self,
        vertices: Tensor<B, 3>,
        pictures: &Tensor<B, 4>,
        views: &[usize],
        softness: &SoftStep<B>,
    ) -> Tensor<B, 1> {
        if self.uses.is_multiple_of(RENEW) {
            let phi = softness.phi.val();
            self.silhouette =
                self.rasterizer.prepare(self.template.faces(), softness.softness, &phi);
        }
        self.uses += 1;
        let pairs = views.len() / 2;
        let alpha = pictures.clone().narrow(1, 3, 1).reshape([2 * pairs, SIZE, SIZE]);
        // Each prediction from its own view, then from that of the other picture of its pair.
        let swapped = |x: &Tensor<B, 3>| {
            Tensor::cat(vec![x.clone().narrow(0, pairs, pairs), x.clone().narrow(0, 0, pairs)], 0)
        };
        let targets = Tensor::cat(vec![alpha.clone(), swapped(&alpha)], 0);
        let others = views[pairs..].iter().chain(&views[..pairs]);
        let orbits = orbits(views.iter().chain(others).copied(), &vertices.device());
        let shapes = Tensor::cat(vec![vertices.clone(), vertices], 0).swap_dims(1, 2);
        let drawn = self.silhouette.coverage(project(shapes, orbits), softness.phi.val());
        iou_loss(drawn, targets).mean()
    }
}

/// The cameras of views, `[views, 4]`.
pub(crate) fn orbits<B: Backend>(
    views: impl Iterator<Item = usize>,
    device: &B::Device,
) -> Tensor<B, 2> {
    let values: Vec<f64> = views.flat_map(orbit).collect();
    let data = TensorData::new(values.clone(), [values.len() / 4, 4]);
    Tensor::from_data(data, (device, <B::FloatElem as Element>::dtype()))
}

/// A softness that learns, in the float type of the backend.
pub(crate) fn soft_step<B: Backend>(
    softness: EdgeSoftness,
    phi: &[f64],
    device: &B::Device,
) -> SoftStep<B> {
    SoftStep::new(softness, phi, <B::FloatElem as Element>::dtype(), device)
}

/// The parameters of a softness as numbers.
pub(crate) fn phi<B: Backend>(softness: &SoftStep<B>) -> Vec<f64> {
    softness.phi.val().into_data().iter().collect()
}
