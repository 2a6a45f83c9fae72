//! The loss of images against targets, and its gradient with respect to the images.

use rayon::prelude::*;

use super::target::{Channels, Target};

/// Pixels per parallel task.
const AT_ONCE: usize = 1 << 13;

/// Sum of the absolute differences of coverage and mask. Adds its gradient with respect to coverage; both are `[pixels]`.
pub(super) fn judge_mask(target: &Target, coverage: &[f32], to_coverage: &mut [f32]) -> f64 {
    let of = |(part, to): (usize, &mut [f32])| {
        let pixels = part * AT_ONCE..part * AT_ONCE + to.len();
        let (counted, mask) = (&target.counted[pixels.clone()], &target.mask[pixels.clone()]);
        let (coverage, mut loss) = (&coverage[pixels], 0.0);
        for k in 0..to.len() {
            let off = coverage[k] * counted[k] - mask[k];
            to[k] += sign(off) * counted[k];
            loss += f64::from(off.abs());
        }
        loss
    };
    to_coverage.par_chunks_mut(AT_ONCE).enumerate().map(of).sum()
}

/// Sum of the absolute differences of three drawn channels and the known ones. Adds its gradients with respect to channels, `[3, pixels]`,
/// and coverage.
///
/// A channel c contributes `a c` at coverage a. Where pixels of the target count in full or not at all, the outline is unknown: `p a c` is
/// compared with `a` times the known value, p being the fraction that counts, and coverage gets no gradient.
pub(super) fn judge_channels(
    (target, counted): (&Channels, &[f32]),
    coverage: &[f32],
    channels: &[f32],
    to_channels: &mut [f32],
    to_coverage: &mut [f32],
) -> f64 {
    let count = coverage.len();
    let planes = channels.chunks(count).zip(to_channels.chunks_mut(count)).zip(&target.levels);
    let of_plane = |((drawn, to), known): ((&[f32], &mut [f32]), &Vec<f32>)| -> f64 {
        let each = to.par_chunks_mut(AT_ONCE).zip(to_coverage.par_chunks_mut(AT_ONCE));
        let of = |(part, (to, to_coverage)): (usize, (&mut [f32], &mut [f32]))| {
            let pixels = part * AT_ONCE..part * AT_ONCE + to.len();
            let (coverage, drawn) = (&coverage[pixels.clone()], &drawn[pixels.clone()]);
            let (known, counted) = (&known[pixels.clone()], &counted[pixels.clone()]);
            let (part, mut loss) = (&target.part[pixels], 0.0);
            for k in 0..to.len() {
                let (a, c) = (coverage[k], drawn[k]);
                let off = if target.is_opaque {
                    let off = part[k] * a * c - a * known[k];
                    to[k] += sign(off) * part[k] * a;
                    off
                } else {
                    let off = counted[k] * a * c - known[k];
                    to[k] += sign(off) * counted[k] * a;
                    to_coverage[k] += sign(off) * counted[k] * c;
                    off
                };
                loss += f64::from(off.abs());
            }
            loss
        };
        each.enumerate().map(of).sum()
    };
    planes.map(of_plane).sum()
}

/// -1, 0 or 1.
#[inline(always)]
fn sign(x: f32) -> f32 {
    f32::from(i8::from(x > 0.0) - i8::from(x < 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Irregular numbers from 0 to 1.
    fn numbers(count: usize, seed: f32) -> Vec<f32> {
        (0..count).map(|k| (0.5 + 0.5 * (seed + 2.7 * k as f32).sin()).clamp(0.0, 1.0)).collect()
    }

    #[test]
    fn gradients_are_those_of_differences() {
        const COUNT: usize = 12;
        for is_opaque in [false, true] {
            let target = Target {
                size: 0,
                mask: numbers(COUNT, 0.1),
                counted: numbers(COUNT, 0.2),
                normals: None,
                colours: Some(Channels {
                    levels: [0.3, 0.4, 0.5].map(|seed| numbers(COUNT, seed)),
                    part: numbers(COUNT, 0.6),
                    is_opaque,
                }),
            };
            let (coverage, channels) = (numbers(COUNT, 0.7), numbers(3 * COUNT, 0.8));
            let colours = (target.colours.as_ref().unwrap(), target.counted.as_slice());
            let judged = |coverage: &[f32], channels: &[f32]| {
                let (mut to_coverage, mut to_channels) = (vec![0.0; COUNT], vec![0.0; 3 * COUNT]);
                let mut loss = judge_mask(&target, coverage, &mut to_coverage);
                let (to, more) = (&mut to_channels, &mut to_coverage);
                loss += judge_channels(colours, coverage, channels, to, more);
                (loss, to_coverage, to_channels)
            };
            let (_, to_coverage, to_channels) = judged(&coverage, &channels);
            let h = 1e-3;
            for k in 0..4 * COUNT {
                let moved = |by: f32| {
                    let (mut coverage, mut channels) = (coverage.clone(), channels.clone());
                    if k < COUNT {
                        coverage[k] += by
                    } else {
                        channels[k - COUNT] += by
                    }
                    judged(&coverage, &channels).0
                };
                let slope = (moved(h) - moved(-h)) / f64::from(2.0 * h);
                // The slope contains the channels' part even where they give coverage no gradient.
                let found = if k < COUNT { to_coverage[k] } else { to_channels[k - COUNT] };
                if k >= COUNT || !is_opaque {
                    assert!((slope - f64::from(found)).abs() < 2e-2, "{k}: {slope} {found}");
                }
            }
        }
    }
}
