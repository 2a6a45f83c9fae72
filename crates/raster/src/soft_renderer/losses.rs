use softrast_kernel::PixelLoss;
use softrast_softness::Softness;
use softrast_tensor::Tensor;

use super::SoftRenderer;
use crate::{Projected, RasterBackend, loss::loss_of_images};

impl<S: Softness> SoftRenderer<S> {
    /// The [`mse_loss`](crate::mse_loss) of each view against a target `[1 or views, height, width]`, `[views]`: that of the
    /// [`silhouette`](Self::silhouette). Gradients reach the vertices alone, to second order.
    ///
    /// On the CPU, under the probabilistic sum and without a surrogate, it is one op that computes the gradient along with the image. It
    /// takes two thirds to nine tenths of the time of two ops.
    ///
    /// # Panics
    ///
    /// If the target is of another size.
    pub fn mse_loss<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        target: Tensor<B, 3>,
    ) -> Tensor<B, 1> {
        self.loss(PixelLoss::SquaredError, vertices, target, None)
    }

    /// The [`iou_loss`](crate::iou_loss) of each view, likewise.
    ///
    /// # Panics
    ///
    /// If the target is of another size.
    pub fn iou_loss<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        target: Tensor<B, 3>,
    ) -> Tensor<B, 1> {
        self.loss(PixelLoss::Iou, vertices, target, None)
    }

    /// [`mse_loss`](Self::mse_loss) where a share of each pixel counts, `[1 or views, height, width]` in [0, 1]: the coverage is multiplied by
    /// it. Without one, all of every pixel counts.
    ///
    /// # Panics
    ///
    /// If the target or the shares are of another size.
    pub fn weighted_mse_loss<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        target: Tensor<B, 3>,
        counted: Option<Tensor<B, 3>>,
    ) -> Tensor<B, 1> {
        self.loss(PixelLoss::SquaredError, vertices, target, counted)
    }

    /// [`iou_loss`](Self::iou_loss), likewise.
    ///
    /// # Panics
    ///
    /// If the target or the shares are of another size.
    pub fn weighted_iou_loss<B: RasterBackend>(
        &self,
        vertices: Projected<B>,
        target: Tensor<B, 3>,
        counted: Option<Tensor<B, 3>>,
    ) -> Tensor<B, 1> {
        self.loss(PixelLoss::Iou, vertices, target, counted)
    }

    fn loss<B: RasterBackend>(
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
        silhouette.loss(loss, vertices, table, target, counted)
    }
}
