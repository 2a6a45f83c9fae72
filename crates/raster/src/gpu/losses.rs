//! Coverage of every pixel of an image, and losses between two images, as in `ops/elementary/image.rs`.

use cubecl::prelude::*;
use softrast_kernel::EMPTY;

use super::dual::{Dual, load};

/// Units of a cube, and pixels that it compares.
pub(super) const UNITS: u32 = 256;
pub(super) const BLOCK: u32 = 4096;
const _: () = assert!(UNITS == 256, "sums of a cube begin with halves of 128");

const NOTHING: f32 = EMPTY as f32;

/// Writes `1 - exp(-sums)`: one unit per pixel.
#[cube(launch)]
pub(super) fn coverage(
    sums: &Array<f32>,
    direction: &Array<f32>,
    out: &mut Array<f32>,
    pixels: u32,
    #[comptime] second: bool,
) {
    let pixel = ABSOLUTE_POS;
    if pixel >= pixels as usize {
        terminate!();
    }
    let depth = load(sums, pixel, direction, pixel, second);
    let through = depth.scale(-1.0f32).exp();
    out[pixel] = Dual::constant(1.0f32).sub(through).stored(second);
}

/// Writes the gradient of `Σ upstream · coverage` with respect to the sums: one unit per pixel.
#[cube(launch)]
pub(super) fn to_sums(
    sums: &Array<f32>,
    direction: &Array<f32>,
    upstream: &Array<f32>,
    gradient: &mut Array<f32>,
    pixels: u32,
    #[comptime] second: bool,
) {
    let pixel = ABSOLUTE_POS;
    if pixel >= pixels as usize {
        terminate!();
    }
    let depth = load(sums, pixel, direction, pixel, second);
    let through = depth.scale(-1.0f32).exp();
    gradient[pixel] = through.scale(upstream[pixel]).stored(second);
}

/// Two images per view: `[views, pixels]`, or `[1, pixels]` for all views.
#[derive(CubeType, CubeLaunch)]
pub(super) struct Compared {
    one: Array<f32>,
    other: Array<f32>,
    /// Derivatives of both.
    direction: Array<f32>,
    /// Pixels of a view, and the stride of each image between views: 0 if all views share the image.
    pixels: u32,
    one_step: u32,
    other_step: u32,
    /// Start of the derivatives of the second image.
    along: u32,
    views: u32,
    blocks: u32,
}

/// Terms of two pixels: the squared difference, or intersection and union.
#[derive(CubeType, Clone, Copy)]
struct Terms {
    first: Dual,
    second: Dual,
}

#[cube]
impl Compared {
    fn of_one(&self, view: u32, pixel: u32, #[comptime] second: bool) -> Dual {
        let at = (view * self.one_step + pixel) as usize;
        load(&self.one, at, &self.direction, at, second)
    }

    fn of_other(&self, view: u32, pixel: u32, #[comptime] second: bool) -> Dual {
        let at = (view * self.other_step + pixel) as usize;
        load(&self.other, at, &self.direction, self.along as usize + at, second)
    }

    fn terms(
        &self,
        view: u32,
        pixel: u32,
        #[comptime] iou: bool,
        #[comptime] second: bool,
    ) -> Terms {
        let a = self.of_one(view, pixel, second);
        let b = self.of_other(view, pixel, second);
        if iou {
            let both = a.mul(b);
            Terms { first: both, second: a.add(b).sub(both) }
        } else {
            let difference = a.sub(b);
            Terms { first: difference.mul(difference), second: Dual::constant(0.0f32) }
        }
    }
}

/// Sums four numbers over all units of a cube, and writes them from `at` on.
#[cube]
fn add_up(first: Dual, second: Dual, out: &mut Array<f32>, at: usize) {
    let mut shares = SharedMemory::<f32>::new(comptime!(4 * UNITS as usize));
    let own = UNIT_POS as usize;
    shares[own] = first.value;
    shares[own + comptime!(UNITS as usize)] = first.tangent;
    shares[own + comptime!(2 * UNITS as usize)] = second.value;
    shares[own + comptime!(3 * UNITS as usize)] = second.tangent;
    sync_cube();
    let mut half = 128u32;
    while half > 0 {
        if UNIT_POS < half {
            for number in 0..4usize {
                let at = number * comptime!(UNITS as usize) + own;
                shares[at] = shares[at] + shares[at + half as usize];
            }
        }
        sync_cube();
        half /= 2u32;
    }
    if UNIT_POS < 4 {
        out[at + own] = shares[own * comptime!(UNITS as usize)];
    }
}

/// Writes the sums of each block of pixels, `[views, blocks, 4]` with derivatives: one cube per block and view.
#[cube(launch)]
pub(super) fn add_blocks(
    images: &Compared,
    partial: &mut Array<f32>,
    #[comptime] iou: bool,
    #[comptime] second: bool,
) {
    let job = CUBE_POS as u32;
    if job >= images.views * images.blocks {
        terminate!();
    }
    let (view, block) = (job / images.blocks, job % images.blocks);
    let mut a = 0.0f32;
    let mut a_tangent = 0.0f32;
    let mut b = 0.0f32;
    let mut b_tangent = 0.0f32;
    for k in 0..comptime!(BLOCK / UNITS) {
        let pixel = block * BLOCK + k * UNITS + UNIT_POS;
        if pixel < images.pixels {
            let terms = images.terms(view, pixel, iou, second);
            a += terms.first.value;
            a_tangent += terms.first.tangent;
            b += terms.second.value;
            b_tangent += terms.second.tangent;
        }
    }
    let first = Dual { value: a, tangent: a_tangent };
    let second = Dual { value: b, tangent: b_tangent };
    add_up(first, second, partial, 4 * job as usize);
}

/// Sums the blocks of each view into `totals` `[views, 4]`: one cube per view.
#[cube(launch)]
pub(super) fn add_views(partial: &Array<f32>, totals: &mut Array<f32>, views: u32, blocks: u32) {
    let view = CUBE_POS as u32;
    if view >= views {
        terminate!();
    }
    let mut a = 0.0f32;
    let mut a_tangent = 0.0f32;
    let mut b = 0.0f32;
    let mut b_tangent = 0.0f32;
    let mut block = UNIT_POS;
    while block < blocks {
        let at = 4 * (view * blocks + block) as usize;
        a += partial[at];
        a_tangent += partial[at + 1];
        b += partial[at + 2];
        b_tangent += partial[at + 3];
        block += UNITS;
    }
    let first = Dual { value: a, tangent: a_tangent };
    let second = Dual { value: b, tangent: b_tangent };
    add_up(first, second, totals, 4 * view as usize);
}

/// The intersection of a view, and one over its union.
#[derive(CubeType, Clone, Copy)]
struct Overlap {
    overlap: Dual,
    inverse: Dual,
}

#[cube]
impl Overlap {
    fn load(totals: &Array<f32>, view: u32) -> Overlap {
        let at = 4 * view as usize;
        let union = Dual { value: totals[at + 2], tangent: totals[at + 3] };
        Overlap {
            overlap: Dual { value: totals[at], tangent: totals[at + 1] },
            inverse: union.add(Dual::constant(NOTHING)).recip(),
        }
    }
}

/// Writes the losses `[views]`: one unit each.
#[cube(launch)]
pub(super) fn judge(
    totals: &Array<f32>,
    losses: &mut Array<f32>,
    views: u32,
    pixels: u32,
    #[comptime] iou: bool,
    #[comptime] second: bool,
) {
    let view = ABSOLUTE_POS as u32;
    if view >= views {
        terminate!();
    }
    let loss = if iou {
        let found = Overlap::load(totals, view);
        Dual::constant(1.0f32).sub(found.overlap.mul(found.inverse))
    } else {
        let at = 4 * view as usize;
        let sum = Dual { value: totals[at], tangent: totals[at + 1] };
        sum.scale(1.0f32 / f32::cast_from(pixels))
    };
    losses[view as usize] = loss.stored(second);
}

/// Writes the gradient of `Σ upstream · losses` with respect to one of the images: one unit per pixel, over all views of the image.
#[cube(launch)]
pub(super) fn to_image(
    images: &Compared,
    totals: &Array<f32>,
    upstream: &Array<f32>,
    gradient: &mut Array<f32>,
    length: u32,
    #[comptime] to_other: bool,
    #[comptime] iou: bool,
    #[comptime] second: bool,
) {
    let own = ABSOLUTE_POS as u32;
    if own >= length {
        terminate!();
    }
    let (first, pixel) = (own / images.pixels, own % images.pixels);
    let step = if to_other { images.other_step } else { images.one_step };
    let end = select(step == 0u32, images.views, first + 1u32);
    let mut sum = 0.0f32;
    for view in first..end {
        let a = images.of_one(view, pixel, second);
        let b = images.of_other(view, pixel, second);
        let u = upstream[view as usize];
        if iou {
            let found = Overlap::load(totals, view);
            let other = if to_other { a } else { b };
            // d(-overlap / union) = -(1 / union) d overlap + (overlap / union²) d union.
            let to_overlap = found.inverse.scale(-u);
            let to_union = found.overlap.mul(found.inverse).mul(found.inverse).scale(u);
            let rest = Dual::constant(1.0f32).sub(other);
            sum += to_overlap.mul(other).add(to_union.mul(rest)).stored(second);
        } else {
            let part = if to_other { -2.0f32 } else { 2.0f32 };
            let factor = part * u / f32::cast_from(images.pixels);
            sum += a.sub(b).scale(factor).stored(second);
        }
    }
    gradient[own as usize] = sum;
}
