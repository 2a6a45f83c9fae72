use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use softrast_kernel::{Bands, Inputs, Judged, Kernels, PixelLoss, bands_of_losses, filled, task};
use softrast_tensor::{Element, TensorData};

use crate::{
    ProfileSum,
    ops::{
        elementary::{Number, dual_upstream, flat},
        pass::Pass,
    },
};

/// Numbers of a gradient that are scaled per task.
const SCALED: usize = 1 << 14;

/// The loss of silhouettes relative to a target, in one op: the forward pass also computes its gradient with respect to the vertices.
#[derive(Clone, Debug)]
pub struct SilhouetteLoss {
    pub(crate) sum: ProfileSum,
    pub(crate) loss: PixelLoss,
    /// Whether pixel weights are an input.
    pub(crate) weighted: bool,
    /// The gradients of the losses, for a recorded op; as many numbers as the vertices have.
    pub(crate) kept: Option<Arc<OnceLock<TensorData>>>,
}

impl SilhouetteLoss {
    /// The op of a call whose passes share a cache.
    pub(crate) fn keeping(&self) -> Self {
        let kept = Some(self.kept.clone().unwrap_or_default());
        Self { sum: self.sum.keeping(), kept, ..self.clone() }
    }

    /// A pass over `vertices` `[views, 3, vertices]`, a `table` `[rows, 4]`, a `target` and, if the op is weighted, pixel weights, both
    /// `[1 or views, height, width]`, to losses `[views]`. Only the vertices have a gradient.
    pub(crate) fn run<F: Kernels + Element + Number<Float = F>>(
        &self,
        pass: &Pass,
        slices: &[&[F]],
        dims: &[Vec<usize>],
    ) -> TensorData {
        let (images, rest) = slices[2..].split_at(if self.weighted { 2 } else { 1 });
        let [vertices, table] = [slices[0], slices[1]];
        let judged = Judged { target: images[0], counted: images.get(1).copied() };
        let views = dims[0][0];
        let bands = bands_of_losses(views, self.sum.size);
        let inputs = Inputs { bands, ..self.sum.inputs(views, vertices, table) };
        let own = OnceLock::new();
        let bands = self.sum.kept.as_deref().unwrap_or(&own).get_or_init(|| F::bands(&inputs));
        let losses = |gradient| F::losses(&inputs, bands, judged, self.loss, gradient);
        let own_gradient = OnceLock::new();
        let gradient = || {
            let kept = self.kept.as_deref().unwrap_or(&own_gradient);
            kept.get_or_init(|| {
                let [_, gradient] = losses(true);
                flat(gradient)
            })
        };
        let of_view = vertices.len() / views.max(1);
        match pass {
            Pass::Forward => {
                let [losses, gradient] = losses(self.kept.is_some());
                if let Some(kept) = &self.kept {
                    // Another call may have set it first, with the same gradient.
                    let _ = kept.set(flat(gradient));
                }
                flat(losses)
            }
            Pass::Vjp { wanted } => {
                let vertices_alone = wanted[0] && !wanted[1..].contains(&true);
                assert!(vertices_alone, "only the vertices have a gradient");
                let gradient = gradient();
                let numbers = gradient.as_slice::<F>().expect("numbers of this type");
                let mut scaled = filled(F::ZERO, numbers.len());
                let views = numbers.par_chunks(of_view.max(1)).zip(rest[0]);
                scaled.par_chunks_mut(of_view.max(1)).zip(views).for_each(
                    |(scaled, (own, &factor))| {
                        let parts = scaled.par_chunks_mut(SCALED).zip(own.par_chunks(SCALED));
                        parts.for_each(|(scaled, own)| {
                            let numbers = scaled.iter_mut().zip(own);
                            task("scaling", || {
                                numbers.for_each(|(to, &number)| *to = number * factor)
                            });
                        });
                    },
                );
                flat(scaled)
            }
            Pass::VjpOfVjp { wanted, .. } => {
                let (upstream, direction) = (rest[0], rest[1]);
                let mut all = Vec::new();
                if wanted[0] {
                    all = self.along(&inputs, bands, judged, [upstream, direction], dims);
                }
                if wanted[slices.len() - rest.len()] {
                    let gradient = gradient();
                    let numbers = gradient.as_slice::<F>().expect("numbers of this type");
                    let views =
                        numbers.chunks(of_view.max(1)).zip(direction.chunks(of_view.max(1)));
                    all.extend(views.map(|(gradient, direction)| {
                        let products = gradient.iter().zip(direction);
                        products.fold(F::ZERO, |sum, (&a, &b)| sum + a * b)
                    }));
                }
                flat(all)
            }
        }
    }

    /// The derivative of the gradient `Σ upstream · loss` along a direction of the vertices.
    fn along<F: Kernels + Element + Number<Float = F>>(
        &self,
        inputs: &Inputs<F>,
        bands: &Bands,
        judged: Judged<F>,
        [upstream, direction]: [&[F]; 2],
        dims: &[Vec<usize>],
    ) -> Vec<F> {
        let sums = F::sums(inputs, bands);
        let image = vec![dims[0][0], self.sum.size.height, self.sum.size.width];
        let shapes = [image, dims[2].clone()];
        // `by_sums` does not depend on the motion of the sums; its change along the direction does.
        let still = vec![F::ZERO; sums.len()];
        let [by_sums, _] = dual_upstream(self.loss, [&sums, &still], judged, upstream, &shapes);
        let (along, wanted) = ([true, false], [true, false, true]);
        let pulled = F::sums_vjp_of_vjp(inputs, bands, &by_sums, direction, along, wanted);
        let (curved, moved) = pulled.split_at(inputs.vertices.len());
        let [_, change] = dual_upstream(self.loss, [&sums, moved], judged, upstream, &shapes);
        let rest = F::sums_vjp(inputs, bands, &change, [true, false]);
        curved.iter().zip(rest).map(|(&a, b)| a + b).collect()
    }
}
