use softrast_tensor::{Backend, Bool, Tensor, TensorData, numbers};

/// The background, blended with the faces at every pixel.
///
/// ```
/// use softrast_raster::{Background, HostBackend, blend};
/// use softrast_tensor::{numbers, tensor, vector};
///
/// // A white face and a black background of equal weight, at one pixel.
/// let background = Background { colour: vector::<HostBackend>(&[0.0]), log_weight: vector(&[0.0]) };
/// let blended = blend(tensor(vec![0.0], [1; 3]), tensor(vec![1.0], [1; 4]), &background);
/// assert_eq!(numbers(blended), [0.5]);
/// ```
#[derive(Clone, Debug)]
pub struct Background<B: Backend> {
    /// Its colour `[channels]`.
    pub colour: Tensor<B, 1>,
    /// Logarithm of its weight, `[1]`; finite.
    pub log_weight: Tensor<B, 1>,
}

/// Normalised depth, of the same shape: 1 at the near plane, 0 at the far plane, linear between and beyond.
///
/// ```
/// use softrast_raster::{HostBackend, nearness};
/// use softrast_tensor::{numbers, vector};
///
/// let depths = vector::<HostBackend>(&[1.0, 2.0, 5.0]);
/// assert_eq!(numbers(nearness(depths, [1.0, 3.0])), [1.0, 0.5, -1.0]);
/// ```
///
/// Source: docs/notes.md, Colour.
///
/// # Panics
///
/// If the near plane is not nearer than the far one.
pub fn nearness<B: Backend, const D: usize>(
    depth: Tensor<B, D>,
    [near, far]: [f64; 2],
) -> Tensor<B, D> {
    assert!(near < far, "the near plane {near} is not nearer than the far plane {far}");
    (depth.neg() + far) * (far - near).recip()
}

/// Blended colours of pixels: `[views, channels, pixels]`.
///
/// `C = (Σⱼ wⱼ cⱼ + w c) / (Σⱼ wⱼ + w)`, where the weight `wⱼ` of a face is its edge weight times its depth weight, and w is the weight of
/// the background. `log_weight` `[views, faces, pixels]` holds `ln wⱼ`, which may be far below the range of an exponential; `colour` is
/// `[views, faces, channels, pixels]`. The result does not depend on the order of the faces, and gradients of any order are exact.
///
/// Source: Wu et al. 2024, Eq. 4. Not in the paper: the background, without which a pixel far from all faces is 0/0. The running rescale of
/// the released code is not provided: it depends on the order of the faces, and its gradient is inexact (docs/notes.md, Colour).
///
/// # Panics
///
/// If the shapes do not fit.
pub fn blend<B: Backend>(
    log_weight: Tensor<B, 3>,
    colour: Tensor<B, 4>,
    background: &Background<B>,
) -> Tensor<B, 3> {
    let [views, faces, pixels] = log_weight.dims();
    let [channels] = background.colour.dims();
    assert_eq!(colour.dims(), [views, faces, channels, pixels], "shape of the colours");
    let behind = background.log_weight.clone().reshape([1, 1, 1]).expand([views, 1, pixels]);
    let all = Tensor::cat(vec![log_weight, behind], 1);
    // Weights relative to the largest: a common factor cancels, in the gradient as well.
    let largest = all.clone().detach().max_dim(1);
    let weight = (all - largest).exp();
    let share = weight.clone() / weight.sum_dim(1);
    let of_faces = share.clone().narrow(1, 0, faces).reshape([views, faces, 1, pixels]);
    let of_background = share.narrow(1, faces, 1);
    let seen = (of_faces * colour).sum_dim(1).reshape([views, channels, pixels]);
    seen + of_background * background.colour.clone().reshape([1, channels, 1])
}

/// Colours without softness, `[views, channels, pixels]`: the colour of the nearest face at each pixel.
///
/// `distance` `[views, faces, pixels]` is the signed distance to each face, which covers a pixel from 0 on; `depth` is `[views, faces]`,
/// `colour` `[views, faces, channels, pixels]`. The first of equally near faces is used; pixels without a face have the colour `background`
/// `[channels]`. The result has no gradient. Used for targets and metrics.
///
/// Source: docs/notes.md, Colour.
///
/// # Panics
///
/// If the shapes do not fit, or the backend cannot be read synchronously.
#[doc(alias = "hard_color")]
pub fn hard_colour<B: Backend>(
    distance: Tensor<B, 3>,
    depth: Tensor<B, 2>,
    colour: Tensor<B, 4>,
    background: Tensor<B, 1>,
) -> Tensor<B, 3> {
    let [views, faces, pixels] = distance.dims();
    let [channels] = background.dims();
    assert_eq!(depth.dims(), [views, faces], "shape of the depths");
    assert_eq!(colour.dims(), [views, faces, channels, pixels], "shape of the colours");
    let device = colour.device();
    let nearest = nearest_faces(distance, depth);
    // A flat index into the colours for each number of the image: on the CPU many times faster than a gather along an axis. A GPU is sent
    // more.
    let place = |k: usize| {
        let (view, channel, pixel) = (k / pixels / channels, k / pixels % channels, k % pixels);
        let face = nearest[view * pixels + pixel].unwrap_or(0);
        (((view * faces + face) * channels + channel) * pixels + pixel) as i64
    };
    let places: Vec<i64> = (0..views * channels * pixels).map(place).collect();
    let places = TensorData::new(places, [views * channels * pixels]);
    let front = colour.flatten::<1>(0, 3).select(0, Tensor::from_data(places, &device));
    let seen: Vec<bool> = nearest.iter().map(Option::is_some).collect();
    let seen = Tensor::<B, 3, Bool>::from_data(TensorData::new(seen, [views, 1, pixels]), &device);
    let behind = background.reshape([1, channels, 1]).expand([views, channels, pixels]);
    let seen = seen.expand([views, channels, pixels]);
    behind.mask_where(seen, front.reshape([views, channels, pixels])).detach()
}

/// The nearest face that covers each pixel of each view.
fn nearest_faces<B: Backend>(distance: Tensor<B, 3>, depth: Tensor<B, 2>) -> Vec<Option<usize>> {
    let [views, faces, pixels] = distance.dims();
    let [distance, depth] = [numbers(distance), numbers(depth)];
    let nearest = |view: usize, pixel: usize| {
        let covers = |face: &usize| distance[(view * faces + face) * pixels + pixel] >= 0.0;
        let at = |face: usize| depth[view * faces + face];
        (0..faces).filter(covers).reduce(|a, b| if at(b) < at(a) { b } else { a })
    };
    let nearest = &nearest;
    (0..views).flat_map(|view| (0..pixels).map(move |pixel| nearest(view, pixel))).collect()
}
