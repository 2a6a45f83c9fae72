use serde::{Deserialize, Serialize};
use softrast_tensor::{
    Backend, Tensor,
    activation::relu,
    burn::{
        self,
        module::Module,
        nn::{
            BatchNorm, BatchNormConfig, Linear, LinearConfig, PaddingConfig2d,
            conv::{Conv2d, Conv2dConfig},
        },
    },
};

use crate::SIZE;

/// Widths of the layers of a [`Network`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum Width {
    /// The widths of the paper: 26 million parameters.
    Paper,
    /// A quarter of these widths: 2.3 million parameters, for a CPU.
    Quarter,
}

impl Width {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Quarter => "quarter",
        }
    }

    fn of(self, paper: usize) -> usize {
        match self {
            Self::Paper => paper,
            Self::Quarter => paper / 4,
        }
    }
}

/// An encoder of a picture, and a decoder to displacements of the vertices of a sphere.
///
/// Three 5×5 convolutions with stride 2 to 64, 128 and 256 channels, each with a batch norm; fully
/// connected layers of 1024, 1024 and 512 (the code), then of 1024 and 2048, and from there to a
/// centre and to all vertices. Rectifiers between all of them. Source: docs/notes.md, Reconstruction.
#[derive(Module, Debug)]
pub struct Network<B: Backend> {
    convolutions: Vec<Conv2d<B>>,
    norms: Vec<BatchNorm<B>>,
    connected: Vec<Linear<B>>,
    centre: Linear<B>,
    displacement: Linear<B>,
}

/// Channels of the convolutions after the picture's own four.
const CHANNELS: [usize; 3] = [64, 128, 256];
/// Outputs of the fully connected layers of the encoder, then of the decoder.
const CONNECTED: [usize; 5] = [1024, 1024, 512, 1024, 2048];
/// Scale of the centre's output, so that it moves slowly at first. Source: docs/notes.md, Reconstruction.
const CENTRE: f64 = 0.1;

impl<B: Backend> Network<B> {
    /// An untrained network, for a template with this many `vertices`.
    pub fn new(width: Width, vertices: usize, device: &B::Device) -> Self {
        let mut channels = vec![4];
        channels.extend(CHANNELS.map(|channels| width.of(channels)));
        let left = SIZE / 8;
        let mut ends = vec![channels[3] * left * left];
        ends.extend(CONNECTED.map(|outputs| width.of(outputs)));
        let last = ends[CONNECTED.len()];
        Self {
            convolutions: channels
                .windows(2)
                .map(|ends| convolution([ends[0], ends[1]], device))
                .collect(),
            norms: channels[1..].iter().map(|&c| BatchNormConfig::new(c).init(device)).collect(),
            connected: ends
                .windows(2)
                .map(|ends| LinearConfig::new(ends[0], ends[1]).init(device))
                .collect(),
            centre: LinearConfig::new(last, 3).init(device),
            displacement: LinearConfig::new(last, 3 * vertices).init(device),
        }
    }

    /// Dimensions of the weights of all layers, in order.
    pub(crate) fn sizes(&self) -> Vec<Vec<usize>> {
        let convolutions = self.convolutions.iter().map(|layer| layer.weight.dims().to_vec());
        let norms = self.norms.iter().map(|norm| norm.gamma.dims().to_vec());
        let connected = self.connected.iter().chain([&self.centre, &self.displacement]);
        let connected = connected.map(|layer| layer.weight.dims().to_vec());
        convolutions.chain(norms).chain(connected).collect()
    }

    /// Pictures `[pictures, 4, 64, 64]` to the centre `[pictures, 3]` and the displacements
    /// `[pictures, 3, vertices]`, both as [`Template::deformed`](crate::Template::deformed) takes them.
    pub fn forward(&self, pictures: Tensor<B, 4>) -> (Tensor<B, 2>, Tensor<B, 3>) {
        let [count, _, _, _] = pictures.dims();
        let layers = self.convolutions.iter().zip(&self.norms);
        let seen =
            layers.fold(pictures, |x, (layer, norm)| relu(norm.forward(convolved(layer, x))));
        let code =
            self.connected.iter().fold(seen.flatten(1, 3), |x, layer| relu(layer.forward(x)));
        let centre = self.centre.forward(code.clone()) * CENTRE;
        let displacement = self.displacement.forward(code);
        let [_, outputs] = displacement.dims();
        (centre, displacement.reshape([count, 3, outputs / 3]))
    }
}

/// Width and height of the window, the stride, and the padding.
const WINDOW: usize = 5;
const STRIDE: usize = 2;
const PADDING: usize = 2;

/// A layer of 5×5 windows at every second pixel, with zero padding of two pixels.
pub fn convolution<B: Backend>(ends: [usize; 2], device: &B::Device) -> Conv2d<B> {
    Conv2dConfig::new(ends, [WINDOW; 2])
        .with_stride([STRIDE; 2])
        .with_padding(PaddingConfig2d::Explicit(PADDING, PADDING, PADDING, PADDING))
        .init(device)
}

/// The layer's `forward` as one product of matrices: `[pictures, channels, height, width]` to
/// `[pictures, outputs, height / 2, width / 2]`, for an even height and width.
///
/// Pixels at every second place form four pictures of a quarter; a window's 25 pixels are slices of
/// these. burn-ndarray itself multiplies pixel by pixel, which takes several times as long.
pub fn convolved<B: Backend>(layer: &Conv2d<B>, pictures: Tensor<B, 4>) -> Tensor<B, 4> {
    let [count, channels, height, width] = pictures.dims();
    let [rows, columns] = [height, width].map(|size| size / STRIDE);
    let reach = PADDING * 2 / STRIDE;
    let padded = pictures.pad((PADDING, PADDING, PADDING, PADDING), 0.0);
    let split = [count, channels, rows + reach, STRIDE, columns + reach, STRIDE];
    let quarters = padded.reshape(split).permute([3, 5, 0, 1, 2, 4]);
    let quarters =
        quarters.reshape([STRIDE * STRIDE * count, channels, rows + reach, columns + reach]);
    let pixel = |y: usize, x: usize| {
        let first = count * (STRIDE * (y % STRIDE) + x % STRIDE);
        let [down, right] = [y / STRIDE, x / STRIDE];
        let within = [first..first + count, 0..channels, down..down + rows, right..right + columns];
        quarters.clone().slice(within).reshape([count, channels, rows * columns])
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
