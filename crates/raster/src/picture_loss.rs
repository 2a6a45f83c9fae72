//! Image losses in addition to [`mse_loss`](crate::mse_loss) and [`iou_loss`](crate::iou_loss).

use softrast_tensor::{Backend, Tensor, TensorData};

/// Width in pixels of the window of [`ssim_loss`], and of the Gaussian in it.
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
/// Constants that keep the ratios of SSIM finite in constant windows, for values from 0 to 1.
const STABLE: [f64; 2] = [0.01 * 0.01, 0.03 * 0.03];

/// Mean absolute difference of each view: `[views, ..]` twice to `[views]`. The derivative at equal pixels is 0.
pub fn l1_loss<B: Backend, const D: usize>(
    image: Tensor<B, D>,
    target: Tensor<B, D>,
) -> Tensor<B, 1> {
    of_views((image - target).abs())
}

/// Huber loss: the mean over the pixels of each view of `d² / 2` where a difference d is at most `delta`, and `delta (|d| - delta / 2)`
/// beyond: `[views, ..]` twice to `[views]`. The gradient of an outlier is therefore at most `delta`.
///
/// Source: Huber, "Robust estimation of a location parameter", 1964.
///
/// # Panics
///
/// If `delta` is not positive.
pub fn huber_loss<B: Backend, const D: usize>(
    image: Tensor<B, D>,
    target: Tensor<B, D>,
    delta: f64,
) -> Tensor<B, 1> {
    assert!(delta > 0.0, "a delta of {delta} is not positive");
    let size = (image - target).abs();
    let near = size.clone().clamp_max(delta);
    of_views(near.clone() * (size - near * 0.5))
}

/// One minus the mean structural similarity of each view: `[views, channels, height, width]` twice, values from 0 to 1, to `[views]`, from
/// 0 for equal pictures to 2. Windows are 11 x 11 pixels with Gaussian weights of 1.5 pixels, and lie wholly in the picture.
///
/// Source: Wang et al., "Image quality assessment: from error visibility to structural similarity", 2004.
///
/// # Panics
///
/// If the pictures differ in size, or are smaller than a window.
pub fn ssim_loss<B: Backend>(image: Tensor<B, 4>, target: Tensor<B, 4>) -> Tensor<B, 1> {
    let [_, channels, height, width] = image.dims();
    assert_eq!(target.dims()[1..], [channels, height, width], "pictures differ in size");
    assert!(
        height.min(width) >= WINDOW,
        "a picture of {height} x {width} is smaller than a window of {WINDOW} x {WINDOW}"
    );
    let (down, across) = (window(height, &image), window(width, &image));
    let mean = |picture: Tensor<B, 4>| along(along(picture, &across).swap_dims(2, 3), &down);
    let (a, b) = (mean(image.clone()), mean(target.clone()));
    let (aa, bb, ab) = (a.clone() * a.clone(), b.clone() * b.clone(), a.clone() * b.clone());
    let spread = mean(image.clone() * image.clone()) - aa.clone();
    let other = mean(target.clone() * target.clone()) - bb.clone();
    let both = mean(image * target) - ab.clone();
    let [level, contrast] = STABLE;
    let above = (ab * 2.0 + level) * (both * 2.0 + contrast);
    // Rounding leaves a variance of at least -1e-7, which the constants compensate.
    let below = (aa + bb + level) * (spread + other + contrast);
    of_views(above * below.recip()).neg() + 1.0
}

/// The mean over `levels` of `loss`, for pictures `[views, channels, height, width]` in full size, half size, a quarter and so on. Wide
/// differences count at every level, so a picture is attracted to a target that it does not overlap.
///
/// ```
/// use softrast_raster::{HostBackend, huber_loss, l1_loss, multi_scale_loss, ssim_loss};
/// use softrast_tensor::{Tensor, numbers};
///
/// let full = |x: f64| Tensor::<HostBackend, 4>::full([1, 3, 16, 16], x, &Default::default());
/// assert_eq!(numbers(l1_loss(full(0.0), full(1.0))), [1.0]);
/// assert_eq!(numbers(huber_loss(full(0.0), full(1.0), 0.5)), [0.375]);
/// assert!(numbers(ssim_loss(full(1.0), full(1.0)))[0].abs() < 1e-5);
/// assert_eq!(numbers(multi_scale_loss(full(0.0), full(1.0), 2, l1_loss)), [1.0]);
/// ```
///
/// # Panics
///
/// If `levels` is 0, or the sides cannot be halved often enough.
pub fn multi_scale_loss<B: Backend>(
    image: Tensor<B, 4>,
    target: Tensor<B, 4>,
    levels: usize,
    loss: impl Fn(Tensor<B, 4>, Tensor<B, 4>) -> Tensor<B, 1>,
) -> Tensor<B, 1> {
    assert!(levels > 0, "a loss needs at least one level");
    let mut total = loss(image.clone(), target.clone());
    let mut pictures = [image, target];
    for _ in 1..levels {
        pictures = pictures.map(halved);
        let [image, target] = pictures.clone();
        total = total + loss(image, target);
    }
    total * (levels as f64).recip()
}

/// Means of blocks of 2 x 2 pixels.
fn halved<B: Backend>(picture: Tensor<B, 4>) -> Tensor<B, 4> {
    let [views, channels, height, width] = picture.dims();
    assert!(
        height.is_multiple_of(2) && width.is_multiple_of(2),
        "a picture of {height} x {width} cannot be halved"
    );
    let blocks = picture.reshape([views * channels, height / 2, 2, width / 2, 2]);
    blocks.mean_dim(4).mean_dim(2).reshape([views, channels, height / 2, width / 2])
}

/// Means over windows along the last axis.
fn along<B: Backend>(picture: Tensor<B, 4>, window: &Tensor<B, 2>) -> Tensor<B, 4> {
    let [views, channels, rows, length] = picture.dims();
    let [_, places] = window.dims();
    let flat = picture.reshape([views * channels * rows, length]);
    flat.matmul(window.clone()).reshape([views, channels, rows, places])
}

/// Windows at all positions of an axis of this `length`, in the float type of a picture: `[length, places]`.
fn window<B: Backend>(length: usize, like: &Tensor<B, 4>) -> Tensor<B, 2> {
    let middle = (WINDOW - 1) as f64 / 2.0;
    let curve = |k: usize| (-0.5 * ((k as f64 - middle) / SIGMA).powi(2)).exp();
    let total: f64 = (0..WINDOW).map(curve).sum();
    let places = length + 1 - WINDOW;
    let mut columns = vec![0.0; length * places];
    for place in 0..places {
        for k in 0..WINDOW {
            columns[(place + k) * places + place] = curve(k) / total;
        }
    }
    let data = TensorData::new(columns, [length, places]);
    Tensor::from_data(data, (&like.device(), like.dtype()))
}

/// The mean of each view.
fn of_views<B: Backend, const D: usize>(pixels: Tensor<B, D>) -> Tensor<B, 1> {
    let views = pixels.dims()[0];
    let flat: Tensor<B, 2> = pixels.flatten(1, D - 1);
    flat.mean_dim(1).reshape([views])
}
