//! Texels by the gradient of what views show.

use rayon::prelude::*;
use softrast_views::{TexelPull, TexelReads};

use super::texels::Texels;

/// Weight of squared differences of neighbouring texels' changes, beside 1 for a pixel.
const SMOOTH: f32 = 0.03;
/// Weight of squared changes, so that every texel has an answer.
const STAYS: f32 = 1e-3;
/// Steps of conjugate gradients. On spot and on the dinosaur, held out, 20 change nothing above 0.001 dB.
pub(super) const STEPS: usize = 10;

/// Changes texels towards the least squared differences to all views, as conjugate gradients do it. `told` is called with the steps taken and the mean
/// squared difference; an error of it ends the descent, and the texels are as they were then.
///
/// With A what views read of texels x, W how much pixels count and y what is known, `|W (A x - y)|² + SMOOTH Σ (dᵢ - dⱼ)² + STAYS Σ dᵢ²` is least, d the
/// change of x: so what no view shows stays as it is beside what they show. The row sums of `Aᵀ W² A` precondition it. Source: Hestenes and Stiefel 1952.
pub(super) fn fit<E>(
    reads: &TexelReads,
    texels: &mut Texels,
    mut told: impl FnMut(usize, f64) -> Result<(), E>,
) -> Result<(), E> {
    let beside = Beside { size: texels.size, is_read: &texels.is_read };
    let TexelPull { half: mut objective, gradient } = reads.pull(&texels.colours, true);
    let counts = reads.counts().max(f64::MIN_POSITIVE);
    let mean = |objective: f64| 2.0 * objective.max(0.0) / (3.0 * counts);
    told(0, mean(objective))?;
    let ones = vec![1.0; texels.colours.len()];
    let sums = reads.pull(&ones, false).gradient;
    let scale: Vec<f32> = sums.par_iter().map(|sum| (sum + 4.0 * SMOOTH + STAYS).recip()).collect();
    let downhill = |(k, x): (usize, &f32)| if beside.is_read[k / 3] { -x } else { 0.0 };
    let mut residual: Vec<f32> = gradient.par_iter().enumerate().map(downhill).collect();
    let mut change = vec![0.0f32; residual.len()];
    let mut along = product(&residual, &scale);
    let mut size = dot(&residual, &along);
    let mut ended = Ok(());
    for step in 1..=STEPS {
        let mut pulled = reads.pull(&along, false).gradient;
        beside.add(&along, &mut pulled);
        let length = size / dot(&along, &pulled);
        // All is as it should be.
        if !length.is_finite() {
            break;
        }
        let by = length as f32;
        change.par_iter_mut().zip(&along).for_each(|(x, d)| *x += by * d);
        residual.par_iter_mut().zip(&pulled).for_each(|(x, d)| *x -= by * d);
        objective -= 0.5 * length * size;
        ended = told(step, mean(objective));
        if ended.is_err() {
            break;
        }
        let next = product(&residual, &scale);
        let now = dot(&residual, &next);
        let kept = (now / size) as f32;
        along.par_iter_mut().zip(&next).for_each(|(d, x)| *d = x + kept * *d);
        size = now;
    }
    let changed = texels.colours.par_iter_mut().zip(&change);
    changed.for_each(|(x, change)| *x = (*x + change).clamp(0.0, 1.0));
    ended
}

/// Which texels have neighbours.
struct Beside<'a> {
    size: usize,
    is_read: &'a [bool],
}

impl Beside<'_> {
    /// Adds half the gradient of smoothness and of the size of changes; texels that are not read do not move.
    fn add(&self, change: &[f32], to: &mut [f32]) {
        let size = self.size;
        to.par_chunks_mut(3 * size).enumerate().for_each(|(y, row)| {
            for x in 0..size {
                let texel = y * size + x;
                if !self.is_read[texel] {
                    row[3 * x..3 * x + 3].fill(0.0);
                    continue;
                }
                let others = [
                    (x > 0).then(|| texel - 1),
                    (x + 1 < size).then(|| texel + 1),
                    (y > 0).then(|| texel - size),
                    (y + 1 < size).then(|| texel + size),
                ];
                for other in others.into_iter().flatten().filter(|&other| self.is_read[other]) {
                    for k in 0..3 {
                        row[3 * x + k] += SMOOTH * (change[3 * texel + k] - change[3 * other + k]);
                    }
                }
                (0..3).for_each(|k| row[3 * x + k] += STAYS * change[3 * texel + k]);
            }
        });
    }
}

fn product(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.par_iter().zip(b).map(|(a, b)| a * b).collect()
}

/// In 64 bits, part by part, so that the number of threads changes nothing.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let of = |(a, b): (&[f32], &[f32])| -> f64 {
        a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum()
    };
    let parts: Vec<f64> = a.par_chunks(1 << 14).zip(b.par_chunks(1 << 14)).map(of).collect();
    parts.into_iter().sum()
}
