use softrast_kernel::PixelLoss;
use softrast_softness::Softness;
use softrast_tensor::Tensor;

use super::SoftRenderer;
use crate::{Projected, RasterBackend, loss::loss_of_images};

impl<S: Softness> SoftRenderer<S> {
    /// The [`mse_loss`](crate::mse_loss) of each view of the [`silhouette`](Self::silhouette) relative to a target
    /// `[1 or views, height, width]`, `[views]`. Gradients reach only the vertices, to second order.
    ///
    /// On the CPU, with the probabilistic sum and without a surrogate, it is one op that computes the gradient together with the image. It
    /// takes seven to eight tenths of the time of two ops.
    ///
    /// # Panics
    ///
    /// If the target has another size.
    pub fn mse_loss<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        target: Tensor<B, 3>,
    ) -> Tensor<B, 1> {
        self.weighted_loss(PixelLoss::SquaredError, vertices, target, None)
    }

    /// The [`iou_loss`](crate::iou_loss) of each view; see [`mse_loss`](Self::mse_loss).
    ///
    /// # Panics
    ///
    /// If the target has another size.
    pub fn iou_loss<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        target: Tensor<B, 3>,
    ) -> Tensor<B, 1> {
        self.weighted_loss(PixelLoss::Iou, vertices, target, None)
    }

    /// [`mse_loss`](Self::mse_loss) or [`iou_loss`](Self::iou_loss) with pixel weights `[1 or views, height, width]` in [0, 1], which
    /// multiply the coverage. Without weights, every pixel counts in full.
    ///
    /// ```
    /// use softrast_raster::{HostBackend, Projected, SoftRenderer, low_level::PixelLoss, vertex_tensor};
    /// use softrast_softness::Family;
    /// use softrast_tensor::{Tensor, numbers};
    ///
    /// let device = Default::default();
    /// let corners = [[-0.5, -0.5, 1.0], [0.5, -0.5, 1.0], [0.0, 0.5, 1.0]];
    /// let corners = Projected::new(vertex_tensor::<HostBackend>(&corners, &device));
    /// let renderer = SoftRenderer::new(&[[0, 1, 2]], 8, Family::Logistic, 0.02);
    /// // Weights of 0 leave an empty image.
    /// let full = |x: f64| Tensor::full([1, 8, 8], x, &device);
    /// for loss in [PixelLoss::SquaredError, PixelLoss::Iou] {
    ///     let loss = renderer.weighted_loss(loss, corners.clone(), full(1.0), Some(full(0.0)));
    ///     assert_eq!(numbers(loss), [1.0]);
    /// }
    /// ```
    ///
    /// # Panics
    ///
    /// If the target or the weights have another size.
    pub fn weighted_loss<B: RasterBackend>(
        &self,
        loss: PixelLoss,
        vertices: Projected<B>,
        target: Tensor<B, 3>,
        counted: Option<Tensor<B, 3>>,
    ) -> Tensor<B, 1> {
        if self.surrogate.is_some() || self.samples.is_some() {
            let counted = counted.map(Tensor::detach);
            return loss_of_images(loss, self.silhouette(vertices), target.detach(), counted);
        }
        let vertices = vertices.tensor();
        let (silhouette, table) = self.own_table(&vertices);
        silhouette.loss_by_table(loss, vertices, table, target, counted)
    }
}
