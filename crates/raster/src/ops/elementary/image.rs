//! Per-pixel ops of an image, and losses between two images.

use rayon::prelude::*;

use super::{Elementary, Views, number::Number};
use softrast_kernel::{EMPTY, Float};

/// Pixels per task; the sums of tasks are added in order, whatever the number of threads.
const PIXELS: usize = 8192;
/// Number of interleaved partial sums.
const BESIDE: usize = 16;

/// `1 - exp(-sums)`, the coverage of the probabilistic sum; any shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coverage;

impl Elementary for Coverage {
    fn forward<N: Number>(&self, inputs: &[&[N]], _: &[Vec<usize>]) -> Vec<N> {
        let minus = -N::Float::ONE;
        mapped(inputs[0], inputs[0], |sum, _| N::of(1.0) - sum.scale(minus).exp())
    }

    fn vjp<N: Number>(
        &self,
        inputs: &[&[N]],
        _: &[Vec<usize>],
        upstream: &[N::Float],
        _: &[bool],
    ) -> Vec<N> {
        let minus = -N::Float::ONE;
        mapped(inputs[0], upstream, |sum, u| sum.scale(minus).exp().scale(u))
    }
}

/// Writes `of` each pair to `out`, in parallel.
fn map_to<A: Copy + Sync, B: Copy + Sync, C: Copy + Send>(
    out: &mut [C],
    a: &[A],
    b: &[B],
    of: impl Fn(A, B) -> C + Copy + Sync,
) {
    let block = |(out, (a, b)): (&mut [C], (&[A], &[B]))| {
        // A local copy cannot change in the loop, which is then vectorized.
        let own = of;
        for (out, (&a, &b)) in out.iter_mut().zip(a.iter().zip(b)) {
            *out = own(a, b);
        }
    };
    match out.len() {
        0..=PIXELS => block((out, (a, b))),
        _ => {
            let inputs = a.par_chunks(PIXELS).zip(b.par_chunks(PIXELS));
            out.par_chunks_mut(PIXELS).zip(inputs).for_each(block);
        }
    }
}

/// `of` each pair, as a vector.
fn mapped<A: Copy + Sync, B: Copy + Sync, N: Number>(
    a: &[A],
    b: &[B],
    of: impl Fn(A, B) -> N + Copy + Sync,
) -> Vec<N> {
    let mut out = vec![N::of(0.0); a.len()];
    map_to(&mut out, a, b, of);
    out
}

/// Sums `of` over pairs, in a fixed order that does not depend on the number of threads.
pub(crate) fn summed<N: Number, const K: usize>(
    a: &[N],
    b: &[N],
    of: impl Fn(N, N) -> [N; K] + Sync,
) -> [N; K] {
    let zero = N::of(0.0);
    let block = |(a, b): (&[N], &[N])| {
        let mut sums = [[zero; BESIDE]; K];
        for (a, b) in a.chunks(BESIDE).zip(b.chunks(BESIDE)) {
            for (i, (&a, &b)) in a.iter().zip(b).enumerate() {
                let terms = of(a, b);
                for k in 0..K {
                    sums[k][i] = sums[k][i] + terms[k];
                }
            }
        }
        sums.map(|sums| sums.into_iter().fold(zero, |total, sum| total + sum))
    };
    let blocks: Vec<_> = match a.len() {
        0..=PIXELS => vec![block((a, b))],
        _ => a.par_chunks(PIXELS).zip(b.par_chunks(PIXELS)).map(block).collect(),
    };
    let mut totals = [zero; K];
    for sums in blocks {
        for k in 0..K {
            totals[k] = totals[k] + sums[k];
        }
    }
    totals
}

/// Two images per view, `[views, height, width]`, or one for all views.
struct Compared<'a, N> {
    images: [Views<'a, N>; 2],
    count: usize,
}

impl<'a, N: Number> Compared<'a, N> {
    fn new(inputs: &[&'a [N]], dims: &[Vec<usize>]) -> Self {
        let images = [0, 1].map(|which| Views::new(inputs[which], &dims[which]));
        Self { images, count: dims[0][0].max(dims[1][0]) }
    }

    /// Both images of a view.
    fn of(&self, view: usize) -> [&'a [N]; 2] {
        self.images.map(|images| images.of(view))
    }

    /// The loss `of` both images of each view.
    fn losses(&self, of: impl Fn(&[N], &[N]) -> N + Sync) -> Vec<N> {
        let of_view = |view| {
            let [a, b] = self.of(view);
            of(a, b)
        };
        (0..self.count).into_par_iter().map(of_view).collect()
    }

    /// The gradients with respect to both images, those that are wanted: for each view, `of` returns functions of the pixels of the two.
    fn gradients<G: Fn(N, N) -> N + Copy + Sync>(
        &self,
        wanted: &[bool],
        of: impl Fn(usize, &[N], &[N]) -> [G; 2] + Sync,
    ) -> Vec<N> {
        let zero = N::of(0.0);
        let mut all = Vec::new();
        for (which, images) in self.images.iter().enumerate().filter(|&(which, _)| wanted[which]) {
            let to_view = |out: &mut [N], view| {
                let [a, b] = self.of(view);
                map_to(out, a, b, of(view, a, b)[which]);
            };
            let mut gradient = vec![zero; self.count * images.length];
            let views = gradient.par_chunks_mut(images.length.max(1)).enumerate();
            views.for_each(|(view, out)| to_view(out, view));
            if images.shared {
                let (total, others) = gradient.split_at_mut(images.length);
                for other in others.chunks(images.length.max(1)) {
                    total.iter_mut().zip(other).for_each(|(total, &part)| *total = *total + part);
                }
                gradient.truncate(images.length);
            }
            all.append(&mut gradient);
        }
        all
    }
}

/// Length of an image.
fn pixels(dims: &[Vec<usize>]) -> usize {
    dims[0][1..].iter().product()
}

/// Mean squared difference of each view; see [`crate::mse_loss`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct SquaredError;

impl Elementary for SquaredError {
    fn forward<N: Number>(&self, inputs: &[&[N]], dims: &[Vec<usize>]) -> Vec<N> {
        let part = N::Float::ONE / N::Float::from_f64(pixels(dims) as f64);
        Compared::new(inputs, dims).losses(|a, b| {
            let [sum] = summed(a, b, |a: N, b: N| [(a - b) * (a - b)]);
            sum.scale(part)
        })
    }

    fn vjp<N: Number>(
        &self,
        inputs: &[&[N]],
        dims: &[Vec<usize>],
        upstream: &[N::Float],
        wanted: &[bool],
    ) -> Vec<N> {
        let part = N::Float::from_f64(2.0) / N::Float::from_f64(pixels(dims) as f64);
        Compared::new(inputs, dims).gradients(wanted, |view, _, _| {
            [part, -part].map(|part| {
                let factor = part * upstream[view];
                move |a: N, b: N| (a - b).scale(factor)
            })
        })
    }
}

/// One minus the intersection over union of each view; see [`crate::iou_loss`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Iou;

impl Iou {
    /// The intersection, and one over the union.
    fn of<N: Number>(a: &[N], b: &[N]) -> [N; 2] {
        let [overlap, union] = summed(a, b, |a: N, b: N| {
            let both = a * b;
            [both, a + b - both]
        });
        [overlap, (union + N::of(EMPTY)).recip()]
    }
}

impl Elementary for Iou {
    fn forward<N: Number>(&self, inputs: &[&[N]], dims: &[Vec<usize>]) -> Vec<N> {
        Compared::new(inputs, dims).losses(|a, b| {
            let [overlap, inverse] = Self::of(a, b);
            N::of(1.0) - overlap * inverse
        })
    }

    fn vjp<N: Number>(
        &self,
        inputs: &[&[N]],
        dims: &[Vec<usize>],
        upstream: &[N::Float],
        wanted: &[bool],
    ) -> Vec<N> {
        Compared::new(inputs, dims).gradients(wanted, |view, a, b| {
            let [overlap, inverse] = Self::of(a, b);
            // d(-overlap / union) = -(1 / union) d overlap + (overlap / union²) d union.
            let to_overlap = inverse.scale(-upstream[view]);
            let to_union = (overlap * inverse * inverse).scale(upstream[view]);
            [false, true].map(|second| {
                move |a: N, b: N| {
                    let other = if second { a } else { b };
                    to_overlap * other + to_union * (N::of(1.0) - other)
                }
            })
        })
    }
}
