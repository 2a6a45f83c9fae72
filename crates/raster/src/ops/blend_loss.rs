use std::{
    ops::Range,
    sync::{Arc, OnceLock},
};

use softrast_kernel::{Kernels, blend::Inputs};
use softrast_tensor::{Element, TensorData};

use crate::{
    SoftBlend,
    ops::{
        elementary::{Number, flat, summed},
        pass::Pass,
    },
};

/// Pixels that are added up together, few enough for one task: bands are tasks already.
const AT_ONCE: usize = 4096;

/// The squared error of images in colour relative to a target, in one op: the forward pass also computes its gradient. Differentiable once.
#[derive(Clone, Debug)]
pub struct BlendLoss {
    pub(crate) blend: SoftBlend,
    /// Which of vertices, attributes, tables, background and texture have a gradient; tables have none.
    pub(crate) wanted: [bool; 5],
    /// The gradient of the sum of the losses, for a recorded op.
    pub(crate) kept: Option<Arc<OnceLock<TensorData>>>,
}

impl BlendLoss {
    /// The op of a call whose passes share a cache.
    pub(crate) fn keeping(&self) -> Self {
        let kept = Some(self.kept.clone().unwrap_or_default());
        Self { kept, ..self.clone() }
    }

    /// A pass over the inputs of the [`SoftBlend`] and a target `[1 or views, planes, height, width]`, to losses `[views]`: the first planes
    /// of the image are compared with it.
    pub(crate) fn run<F: Kernels + Element + Number<Float = F>>(
        &self,
        pass: &Pass,
        slices: &[&[F]],
        dims: &[Vec<usize>],
    ) -> TensorData {
        let count = self.blend.inputs_count();
        let inputs = self.blend.inputs(slices, dims);
        let target = Target { numbers: slices[count], shape: &dims[count] };
        match pass {
            Pass::Forward => {
                let [losses, gradient] = self.judged(&inputs, target, None);
                if let Some(kept) = &self.kept {
                    // Another call may have set it first, with the same gradient.
                    let _ = kept.set(flat(gradient));
                }
                flat(losses)
            }
            Pass::Vjp { .. } => {
                let upstream = slices[count + 1];
                let Some(kept) = self.kept.as_ref().and_then(|kept| kept.get()) else {
                    panic!("the gradient of a loss that was not recorded");
                };
                if upstream.iter().any(|&factor| factor != upstream[0]) {
                    let [_, gradient] = self.judged(&inputs, target, Some(upstream));
                    return flat(gradient);
                }
                let gradient = kept.as_slice::<F>().expect("numbers of this type");
                flat(gradient.iter().map(|&number| number * upstream[0]).collect())
            }
            Pass::VjpOfVjp { .. } => {
                panic!("a loss in colour that is one op is differentiable once")
            }
        }
    }

    /// The loss of each view, and the gradient of their sum, or of their sum weighted by an `upstream`.
    fn judged<F: Kernels + Number<Float = F>>(
        &self,
        inputs: &Inputs<F>,
        target: Target<F>,
        upstream: Option<&[F]>,
    ) -> [Vec<F>; 2] {
        let part = F::ONE / F::from_f64(target.of_view() as f64);
        let judge = |view: usize, pixels: Range<usize>, image: &[Vec<F>], to: &mut [Vec<F>]| {
            let factor = part * upstream.map_or(F::ONE, |upstream| upstream[view]);
            let factor = factor + factor;
            let mut loss = F::ZERO;
            for (plane, (drawn, to)) in image.iter().zip(to).enumerate().take(target.shape[1]) {
                let wanted = &target.plane(view, plane)[pixels.clone()];
                for (drawn, wanted) in drawn.chunks(AT_ONCE).zip(wanted.chunks(AT_ONCE)) {
                    let [sum] = summed(drawn, wanted, |a: F, b: F| [(a - b) * (a - b)]);
                    loss += sum * part;
                }
                for (to, (&a, &b)) in to.iter_mut().zip(drawn.iter().zip(wanted)) {
                    *to = (a - b) * factor;
                }
            }
            loss
        };
        F::blend_judged(inputs, &F::kept(inputs, false), &judge, self.wanted)
    }
}

/// The target of a loss.
#[derive(Clone, Copy)]
struct Target<'a, F> {
    numbers: &'a [F],
    /// `[1 or views, planes, height, width]`.
    shape: &'a [usize],
}

impl<'a, F> Target<'a, F> {
    /// Numbers of a view.
    fn of_view(&self) -> usize {
        self.shape[1..].iter().product()
    }

    fn plane(&self, view: usize, plane: usize) -> &'a [F] {
        let view = if self.shape[0] == 1 { 0 } else { view };
        let length = self.shape[2] * self.shape[3];
        &self.numbers[(view * self.shape[1] + plane) * length..][..length]
    }
}
