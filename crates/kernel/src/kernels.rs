use crate::{
    Bands, Float, Inputs, Judged, PixelLoss,
    blend::{self, Judge, Kept},
    loss, pairs, sum,
};

/// Floats that passes run on: `f32` and `f64`.
pub trait Kernels: Float {
    /// The lists of the faces that reach each band of rows, valid for all passes over the same vertices.
    fn bands(inputs: &Inputs<Self>) -> Bands;

    /// Sums of the profile, `[views, height, width]`. `bands` must be those of `inputs`.
    fn sums(inputs: &Inputs<Self>, bands: &Bands) -> Vec<Self>;

    /// Gradients of `Σ upstream · sums` with respect to vertices and table, those that are `wanted`, concatenated in this order.
    fn sums_vjp(
        inputs: &Inputs<Self>,
        bands: &Bands,
        upstream: &[Self],
        wanted: [bool; 2],
    ) -> Vec<Self>;

    /// Pullback of `direction` through [`Kernels::sums_vjp`]; `direction` has the layout of its result with `along` wanted. Gradients with
    /// respect to vertices, table and upstream, those that are wanted, concatenated in this order.
    fn sums_vjp_of_vjp(
        inputs: &Inputs<Self>,
        bands: &Bands,
        upstream: &[Self],
        direction: &[Self],
        along: [bool; 2],
        wanted: [bool; 3],
    ) -> Vec<Self>;

    /// Losses `[views]`, and the gradient of each with respect to its vertices, `[views, 3, vertices]`: zeros if it is not wanted.
    fn losses(
        inputs: &Inputs<Self>,
        bands: &Bands,
        judged: Judged<Self>,
        loss: PixelLoss,
        with_gradient: bool,
    ) -> [Vec<Self>; 2];

    /// Number of pixel-face pairs that one pass visits, over all views; the table is not read.
    fn pairs(inputs: &Inputs<Self>) -> usize;

    /// Prepares the data shared by colour passes over these inputs. `sums`: whether the sums of the image are cached, channels and share of
    /// each pixel rounded up to fours, and one number more.
    fn kept(inputs: &blend::Inputs<Self>, sums: bool) -> Kept<Self>;

    /// The image `[views, channels + 1, height, width]`: blended channels, then the faces' share. `kept` must be that of `inputs`.
    fn blend(inputs: &blend::Inputs<Self>, kept: &Kept<Self>) -> Vec<Self>;

    /// Gradients of `Σ upstream · image` with respect to vertices, attributes, tables, background and texture, those that are wanted,
    /// concatenated in this order.
    fn blend_vjp(
        inputs: &blend::Inputs<Self>,
        kept: &Kept<Self>,
        upstream: &[Self],
        wanted: [bool; 5],
    ) -> Vec<Self>;

    /// Losses `[views]` of the image, as `judge` finds them, and the gradients of their sum with respect to the inputs that are wanted, as by
    /// [`Kernels::blend_vjp`].
    ///
    /// # Panics
    ///
    /// If the gradient of the tables is wanted.
    fn blend_judged(
        inputs: &blend::Inputs<Self>,
        kept: &Kept<Self>,
        judge: &Judge<Self>,
        wanted: [bool; 5],
    ) -> [Vec<Self>; 2];

    /// Pullback of `direction` through [`Kernels::blend_vjp`]; `direction` has the layout of its result with `along` wanted. Gradients with
    /// respect to the inputs and the upstream, those that are wanted, concatenated in this order.
    fn blend_vjp_of_vjp(
        inputs: &blend::Inputs<Self>,
        kept: &Kept<Self>,
        upstream: &[Self],
        direction: &[Self],
        along: [bool; 5],
        wanted: [bool; 6],
    ) -> Vec<Self>;
}

macro_rules! kernels {
    ($float:ty) => {
        // Functions without generics, compiled in this crate instead of in each crate that draws.
        impl Kernels for $float {
            fn bands(inputs: &Inputs<Self>) -> Bands {
                inputs.bands()
            }

            fn sums(inputs: &Inputs<Self>, bands: &Bands) -> Vec<Self> {
                sum::forward(inputs, bands)
            }

            fn sums_vjp(
                inputs: &Inputs<Self>,
                bands: &Bands,
                upstream: &[Self],
                wanted: [bool; 2],
            ) -> Vec<Self> {
                sum::vjp(inputs, bands, upstream, wanted)
            }

            fn sums_vjp_of_vjp(
                inputs: &Inputs<Self>,
                bands: &Bands,
                upstream: &[Self],
                direction: &[Self],
                along: [bool; 2],
                wanted: [bool; 3],
            ) -> Vec<Self> {
                sum::vjp_of_vjp(inputs, bands, upstream, direction, along, wanted)
            }

            fn losses(
                inputs: &Inputs<Self>,
                bands: &Bands,
                judged: Judged<Self>,
                loss: PixelLoss,
                with_gradient: bool,
            ) -> [Vec<Self>; 2] {
                loss::losses(inputs, bands, judged, loss, with_gradient)
            }

            fn pairs(inputs: &Inputs<Self>) -> usize {
                pairs::pairs(inputs)
            }

            fn kept(inputs: &blend::Inputs<Self>, sums: bool) -> Kept<Self> {
                Kept::new(inputs, sums)
            }

            fn blend(inputs: &blend::Inputs<Self>, kept: &Kept<Self>) -> Vec<Self> {
                blend::forward(inputs, kept)
            }

            fn blend_vjp(
                inputs: &blend::Inputs<Self>,
                kept: &Kept<Self>,
                upstream: &[Self],
                wanted: [bool; 5],
            ) -> Vec<Self> {
                blend::vjp(inputs, kept, upstream, wanted)
            }

            fn blend_judged(
                inputs: &blend::Inputs<Self>,
                kept: &Kept<Self>,
                judge: &Judge<Self>,
                wanted: [bool; 5],
            ) -> [Vec<Self>; 2] {
                blend::judged(inputs, kept, judge, wanted)
            }

            fn blend_vjp_of_vjp(
                inputs: &blend::Inputs<Self>,
                kept: &Kept<Self>,
                upstream: &[Self],
                direction: &[Self],
                along: [bool; 5],
                wanted: [bool; 6],
            ) -> Vec<Self> {
                blend::vjp_of_vjp(inputs, kept, upstream, direction, along, wanted)
            }
        }
    };
}

kernels!(f32);
kernels!(f64);
