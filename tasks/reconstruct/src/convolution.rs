use burn::{
    nn::{
        PaddingConfig2d,
        conv::{Conv2d, Conv2dConfig},
    },
    tensor::{Tensor, backend::Backend},
};

/// Width and height of the window, the stride, and the zeros around a picture.
const WINDOW: usize = 5;
const STRIDE: usize = 2;
const PADDING: usize = 2;

/// A layer of 5×5 windows at every second pixel, with two zeros around the picture.
pub fn convolution<B: Backend>(ends: [usize; 2], device: &B::Device) -> Conv2d<B> {
    Conv2dConfig::new(ends, [WINDOW; 2])
        .with_stride([STRIDE; 2])
        .with_padding(PaddingConfig2d::Explicit(PADDING, PADDING, PADDING, PADDING))
        .init(device)
}

/// The layer's `forward` as one product of matrices: `[pictures, channels, height, width]` to
/// `[pictures, outputs, height / 2, width / 2]`, for an even height and width.
///
/// Pixels at every second place are four pictures of a quarter; of these a window's 25 pixels are
/// slices. burn-ndarray itself multiplies pixel by pixel, which takes several times as long.
pub fn convolved<B: Backend>(layer: &Conv2d<B>, pictures: Tensor<B, 4>) -> Tensor<B, 4> {
    let [count, channels, height, width] = pictures.dims();
    let [rows, columns] = [height, width].map(|size| size / STRIDE);
    let reach = PADDING * 2 / STRIDE;
    let padded = pictures.pad((PADDING, PADDING, PADDING, PADDING), 0.0);
    let split = [count, channels, rows + reach, STRIDE, columns + reach, STRIDE];
    let padded = padded.reshape(split);
    let quarter = |y: usize, x: usize| {
        let quarter = padded.clone().narrow(3, y, 1).narrow(5, x, 1);
        quarter.reshape([count, channels, rows + reach, columns + reach])
    };
    let quarters = [[quarter(0, 0), quarter(0, 1)], [quarter(1, 0), quarter(1, 1)]];
    let pixel = |y: usize, x: usize| {
        let quarter = quarters[y % STRIDE][x % STRIDE].clone();
        let [down, right] = [y / STRIDE, x / STRIDE];
        let seen =
            quarter.slice([0..count, 0..channels, down..down + rows, right..right + columns]);
        seen.reshape([count, channels, rows * columns])
    };
    let windows = (0..WINDOW).flat_map(|y| (0..WINDOW).map(move |x| (y, x)));
    let windows = Tensor::cat(windows.map(|(y, x)| pixel(y, x)).collect(), 1);
    let weight = layer.weight.val();
    let [outputs, ..] = weight.dims();
    let weight = weight.permute([0, 2, 3, 1]).reshape([1, outputs, WINDOW * WINDOW * channels]);
    let seen = weight.matmul(windows).reshape([count, outputs, rows, columns]);
    match &layer.bias {
        Some(bias) => seen + bias.val().reshape([1, outputs, 1, 1]),
        None => seen,
    }
}
