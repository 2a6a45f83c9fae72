use crate::{
    Bands, Float, Inputs, Judged, PixelLoss,
    blend::{self, Judge, Kept},
    loss, pairs, sum,
};

/// The trait, with a function for each entry `fn signature = path;`, and its impls: functions without generics, compiled in this crate
/// instead of in each crate that draws.
macro_rules! kernels {
    ($($(#[$doc:meta])* fn $name:ident($($arg:ident: $kind:ty),* $(,)?) -> $found:ty = $path:path;)*) => {
        /// Floats that passes run on: `f32` and `f64`.
        pub trait Kernels: Float {
            $($(#[$doc])* fn $name($($arg: $kind),*) -> $found;)*
        }

        impl Kernels for f32 {
            $(fn $name($($arg: $kind),*) -> $found { $path($($arg),*) })*
        }

        impl Kernels for f64 {
            $(fn $name($($arg: $kind),*) -> $found { $path($($arg),*) })*
        }
    };
}

kernels! {
    /// The lists of the faces that reach each band of rows, valid for all passes over the same vertices.
    fn bands(inputs: &Inputs<Self>) -> Bands = Inputs::bands;

    /// Sums of the profile, `[views, height, width]`. `bands` must be those of `inputs`.
    fn sums(inputs: &Inputs<Self>, bands: &Bands) -> Vec<Self> = sum::forward;

    /// Gradients of `Σ upstream · sums` with respect to vertices and table, those that are `wanted`, concatenated in this order.
    fn sums_vjp(
        inputs: &Inputs<Self>,
        bands: &Bands,
        upstream: &[Self],
        wanted: [bool; 2],
    ) -> Vec<Self> = sum::vjp;

    /// Pullback of `direction` through [`Kernels::sums_vjp`]; `direction` has the layout of its result with `along` wanted. Gradients with
    /// respect to vertices, table and upstream, those that are wanted, concatenated in this order.
    fn sums_vjp_of_vjp(
        inputs: &Inputs<Self>,
        bands: &Bands,
        upstream: &[Self],
        direction: &[Self],
        along: [bool; 2],
        wanted: [bool; 3],
    ) -> Vec<Self> = sum::vjp_of_vjp;

    /// Losses `[views]`, and the gradient of each with respect to its vertices, `[views, 3, vertices]`: zeros if it is not wanted.
    fn losses(
        inputs: &Inputs<Self>,
        bands: &Bands,
        judged: Judged<Self>,
        loss: PixelLoss,
        with_gradient: bool,
    ) -> [Vec<Self>; 2] = loss::losses;

    /// Number of pixel-face pairs that one pass visits, over all views; the table is not read.
    fn pairs(inputs: &Inputs<Self>) -> usize = pairs::pairs;

    /// Prepares the data shared by colour passes over these inputs. `sums`: whether the sums of the image are cached, channels and share of
    /// each pixel rounded up to fours, and one number more.
    fn kept(inputs: &blend::Inputs<Self>, sums: bool) -> Kept<Self> = Kept::new;

    /// The image `[views, channels + 1, height, width]`: blended channels, then the faces' share. `kept` must be that of `inputs`.
    fn blend(inputs: &blend::Inputs<Self>, kept: &Kept<Self>) -> Vec<Self> = blend::forward;

    /// Gradients of `Σ upstream · image` with respect to vertices, attributes, tables, background and texture, those that are wanted,
    /// concatenated in this order.
    fn blend_vjp(
        inputs: &blend::Inputs<Self>,
        kept: &Kept<Self>,
        upstream: &[Self],
        wanted: [bool; 5],
    ) -> Vec<Self> = blend::vjp;

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
    ) -> [Vec<Self>; 2] = blend::judged;

    /// Pullback of `direction` through [`Kernels::blend_vjp`]; `direction` has the layout of its result with `along` wanted. Gradients with
    /// respect to the inputs and the upstream, those that are wanted, concatenated in this order.
    fn blend_vjp_of_vjp(
        inputs: &blend::Inputs<Self>,
        kept: &Kept<Self>,
        upstream: &[Self],
        direction: &[Self],
        along: [bool; 5],
        wanted: [bool; 6],
    ) -> Vec<Self> = blend::vjp_of_vjp;
}
