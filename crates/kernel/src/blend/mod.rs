//! Blending of the colours of faces that share pixels, weighted by edge and depth: the image, its gradient, and the gradient of that.
//!
//! `C = (Σ wⱼ cⱼ + w c) / (Σ wⱼ + w)` with `ln wⱼ = ln s(dⱼ) + ln b(zⱼ)`, both from tables. Each band is walked once for the sums and once
//! more for the gradient; before that, for the largest weight of each pixel if the weights may exceed the range of floats. As in the sums
//! of profiles, the code is generic over `Real`.
//!
//! ```
//! use softrast_kernel::{Grid, Kernels, blend::{DepthGrid, Inputs, Kept}};
//!
//! // Minus the logarithm of a logistic of scale 0.05 NDC, mirrored, and a weight of 1 at every depth.
//! let edge = Grid { outer: 0.6, inner: 0.6, from: [0.0; 2], octaves: 24, far: 0, bits: 4 };
//! let mut tables = edge.table(|d| [(d / 0.05).exp().ln_1p(), (1.0 + (-d / 0.05).exp()).recip() / 0.05]);
//! tables.extend([0.0; 4]);
//!
//! // A white face in front of a black background of weight e⁻⁵.
//! let inputs = Inputs {
//!     vertices: &[-0.5, 0.5, 0.0, -0.5, -0.4, 0.5, 1.0, 1.0, 1.0],
//!     attributes: &[1.0; 3],
//!     tables: &tables,
//!     background: &[0.0, -5.0],
//!     texture: &[],
//!     texture_size: None,
//!     faces: &[[0, 1, 2]],
//!     entries: &[[0, 1, 2]],
//!     edge,
//!     depth: DepthGrid::Exponential,
//!     floor: 0.0,
//!     planes: [0.5, 2.0],
//!     size: 8.into(),
//!     near: 0.01,
//!     far: 100.0,
//!     tolerance: 1e-3,
//!     culls: false,
//!     views: 1,
//!     shared: true,
//! };
//! let kept: Kept<f64> = f64::kept(&inputs, false); // serves all passes over the same inputs
//! let image = f64::blend(&inputs, &kept);
//! let (white, share) = image.split_at(64);
//! assert!(white[36] > 0.95 && white[0] < 1e-3);
//! assert!(white.iter().zip(share).all(|(white, share)| (white - share).abs() < 1e-12));
//!
//! // Brighter corners brighten the image.
//! let to_attributes = [false, true, false, false, false];
//! let gradient = f64::blend_vjp(&inputs, &kept, &[1.0; 128], to_attributes);
//! assert!(gradient.len() == 3 && gradient.iter().all(|&by_corner| by_corner > 0.0));
//! ```
#![allow(clippy::needless_range_loop)]

mod band;
mod block;
mod depth;
mod judged;
mod point;
mod pull;
mod quads;
mod reach;
mod scene;
mod shown;
mod sums;
mod texture;
mod walk;

use std::sync::OnceLock;

use rayon::prelude::*;

use self::{
    band::{BandSums, Drawn, Walked},
    judged::JudgedBand,
    pull::CORNER_NUMBERS,
    reach::Reached,
    scene::{Band, Blend},
    texture::TexelSums,
};
pub use self::{
    depth::{DepthGrid, LEAST},
    judged::Judge,
    point::AREA,
    scene::{Inputs, NOTHING, counts_from},
    texture::TEXEL_CHANNELS,
};
use super::{
    bands::View,
    float::{self, Vectors, on_vectors},
    lanes::{Lanes, run},
    real::{Dual, Float, Real},
    sum::tangents,
    tasks::task,
};

/// Data shared by passes over the same inputs.
///
/// The [module](self) has an example.
pub struct Kept<F> {
    reached: Reached,
    /// Sums of each band of each view, set by the first pass without tangents; empty if they are not cached.
    sums: Vec<OnceLock<BandSums<F>>>,
}

impl<F> Kept<F> {
    /// See [`Kernels::kept`](crate::Kernels::kept).
    pub(crate) fn new(inputs: &Inputs<F>, sums: bool) -> Self
    where
        F: Vectors,
    {
        let reached = reach::bands(inputs);
        let count = if sums { reached.bands.views.len() * reached.bands.count } else { 0 };
        Self { reached, sums: (0..count).map(|_| OnceLock::new()).collect() }
    }
}

/// See [`Kernels::blend`](crate::Kernels::blend).
pub(crate) fn forward<F: Vectors>(inputs: &Inputs<F>, kept: &Kept<F>) -> Vec<F> {
    on_vectors!(drawn::<F>(inputs, [&[]; 5], kept, None)).image()
}

/// See [`Kernels::blend_vjp`](crate::Kernels::blend_vjp).
pub(crate) fn vjp<F: Vectors>(
    inputs: &Inputs<F>,
    kept: &Kept<F>,
    upstream: &[F],
    wanted: [bool; 5],
) -> Vec<F> {
    let pull = Some((upstream, wanted));
    on_vectors!(drawn::<F>(inputs, [&[]; 5], kept, pull)).gradient(wanted)
}

/// See [`Kernels::blend_judged`](crate::Kernels::blend_judged).
pub(crate) fn judged<F: Vectors>(
    inputs: &Inputs<F>,
    kept: &Kept<F>,
    judge: &Judge<F>,
    wanted: [bool; 5],
) -> [Vec<F>; 2] {
    assert!(!wanted[2], "a loss has no gradient with respect to the tables");
    on_vectors!(of_judged::<F>(inputs, kept, judge, wanted))
}

/// See [`Kernels::blend_vjp_of_vjp`](crate::Kernels::blend_vjp_of_vjp).
pub(crate) fn vjp_of_vjp<F: Vectors>(
    inputs: &Inputs<F>,
    kept: &Kept<F>,
    upstream: &[F],
    direction: &[F],
    along: [bool; 5],
    wanted: [bool; 6],
) -> Vec<F> {
    let of_inputs =
        [inputs.vertices, inputs.attributes, inputs.tables, inputs.background, inputs.texture];
    let tangents = tangents(of_inputs, along, direction);
    let tangents = tangents.each_ref().map(|own| &own[..]);
    let [wanted @ .., to_upstream] = wanted;
    let pull = Some((upstream, wanted));
    let passed = on_vectors!(drawn::<Dual<F>>(inputs, tangents, kept, pull));
    let image = if to_upstream { passed.image() } else { Vec::new() };
    let mut gradient = passed.gradient(wanted);
    gradient.extend(image);
    gradient
}

/// Results of a band, of the bands of a view, or of all views. Results of dual numbers are tangents.
#[derive(Default)]
struct Passed<F> {
    /// View by view; 0 where nothing is judged.
    losses: Vec<F>,
    /// `[views, channels + 1, height, width]`, view by view.
    images: Vec<Vec<F>>,
    /// `[views, 3, vertices]`, view by view.
    vertices: Vec<Vec<F>>,
    attributes: Vec<F>,
    tables: Vec<F>,
    background: Vec<F>,
    texels: TexelSums<F>,
}

impl<F: float::Float> Passed<F> {
    fn image(&self) -> Vec<F> {
        self.images.concat()
    }

    fn gradient(self, wanted: [bool; 5]) -> Vec<F> {
        let parts = [
            self.vertices.concat(),
            self.attributes,
            self.tables,
            self.background,
            self.texels.dense(),
        ];
        parts
            .into_iter()
            .zip(wanted)
            .filter(|&(_, wanted)| wanted)
            .flat_map(|(part, _)| part)
            .collect()
    }
}

/// Draws all bands, or finds their gradients if there is an upstream.
fn drawn<T: Real>(
    inputs: &Inputs<Float<T>>,
    tangents: [&[Float<T>]; 5],
    kept: &Kept<Float<T>>,
    upstream: Option<(&[Float<T>], [bool; 5])>,
) -> Passed<Float<T>> {
    let (blend, bands) = (inputs.blend(tangents), kept.reached.bands.count);
    let name = if upstream.is_some() { "pull of a band" } else { "image of a band" };
    passes(inputs, &blend, kept, upstream.map(|(_, wanted)| wanted), |of: Band<T>| {
        let kept = kept.sums.get(of.view * bands + of.band);
        task(name, || run::<T::Lanes, _>(Drawn { of, kept, upstream }))
    })
}

/// Losses of all views, and their gradient.
fn of_judged<L: Lanes>(
    inputs: &Inputs<L::Float>,
    kept: &Kept<L::Float>,
    judge: &Judge<L::Float>,
    wanted: [bool; 5],
) -> [Vec<L::Float>; 2] {
    let blend = inputs.blend([&[]; 5]);
    let mut passed = passes(inputs, &blend, kept, Some(wanted), |of: Band<L>| {
        task("loss of a band", || run::<L, _>(JudgedBand { of, judge, wanted }))
    });
    [std::mem::take(&mut passed.losses), passed.gradient(wanted)]
}

/// Runs all bands; `wanted` are the gradients that they return. Sums are taken in the order of views and bands.
fn passes<T: Real>(
    inputs: &Inputs<Float<T>>,
    blend: &Blend<T>,
    kept: &Kept<Float<T>>,
    wanted: Option<[bool; 5]>,
    of_band: impl Fn(Band<T>) -> Walked<Float<T>> + Sync,
) -> Passed<Float<T>> {
    let zero = <Float<T> as float::Float>::ZERO;
    let reached = &kept.reached;
    let bands = &reached.bands;
    let views = bands.views.len();
    let per_view: Vec<_> = (0..views)
        .into_par_iter()
        .map(|view| {
            let of = |band| Band {
                blend,
                of_view: &bands.views[view],
                views,
                view,
                band,
                logs: &reached.logs[view],
                least: reached.least,
            };
            let walked: Vec<_> =
                (0..bands.count).into_par_iter().map(|band| of_band(of(band))).collect();
            task("gather", || gather(blend, inputs, &bands.views[view], walked, wanted))
        })
        .collect();
    let mut passed = Passed {
        attributes: vec![zero; if wanted.is_some() { inputs.attributes.len() } else { 0 }],
        texels: blend.no_texels(wanted),
        ..Passed::default()
    };
    for (index, mut view) in per_view.into_iter().enumerate() {
        passed.losses.append(&mut view.losses);
        passed.images.append(&mut view.images);
        passed.vertices.append(&mut view.vertices);
        let first = blend.first_attribute(index).min(passed.attributes.len());
        add(&mut passed.attributes[first..], &view.attributes);
        added(&mut passed.tables, view.tables);
        added(&mut passed.background, view.background);
        passed.texels.add_all(view.texels);
    }
    passed
}

/// Adds `part` to `total`, element by element.
fn add<F: float::Float>(total: &mut [F], part: &[F]) {
    total.iter_mut().zip(part).for_each(|(total, &part)| *total += part);
}

/// Adds `part` to `total`, which may still be empty.
fn added<F: float::Float>(total: &mut Vec<F>, part: Vec<F>) {
    match total.is_empty() {
        true => *total = part,
        false => add(total, &part),
    }
}

/// Adds up the bands of a view in their order.
fn gather<T: Real>(
    blend: &Blend<T>,
    inputs: &Inputs<Float<T>>,
    view: &View,
    walked: Vec<Walked<Float<T>>>,
    wanted: Option<[bool; 5]>,
) -> Passed<Float<T>> {
    let zero = <Float<T> as float::Float>::ZERO;
    let (channels, numbers) = (blend.channels, blend.numbers);
    let mut image = Vec::new();
    for plane in 0..=channels {
        walked.iter().filter_map(|band| band.image.get(plane)).for_each(|rows| image.extend(rows));
    }
    let mut passed = Passed {
        losses: vec![walked.iter().fold(zero, |loss, band| loss + band.loss)],
        images: vec![image],
        texels: blend.no_texels(wanted),
        ..Passed::default()
    };
    let Some([_, of_attributes, ..]) = wanted else { return passed };
    let count = inputs.vertices.len() / inputs.views / 3;
    let mut vertices = vec![zero; 3 * count];
    let entries = inputs.attributes.len() / if inputs.shared { 1 } else { inputs.views };
    let mut attributes = vec![zero; if of_attributes { entries } else { 0 }];
    let stride = CORNER_NUMBERS + if of_attributes { 3 * numbers } else { 0 };
    for (band, walked) in walked.into_iter().enumerate() {
        for (&face, own) in view.faces(band).iter().zip(walked.faces.chunks_exact(stride)) {
            for (k, &vertex) in inputs.faces[face as usize].iter().enumerate() {
                let vertex = vertex as usize;
                vertices[vertex] += own[2 * k];
                vertices[count + vertex] += own[2 * k + 1];
                vertices[2 * count + vertex] += own[6 + k];
            }
            if of_attributes {
                for (k, &entry) in inputs.entries[face as usize].iter().enumerate() {
                    for number in 0..numbers {
                        attributes[entry as usize * numbers + number] +=
                            own[CORNER_NUMBERS + 3 * number + k];
                    }
                }
            }
        }
        added(&mut passed.tables, walked.tables.concat().as_flattened().to_vec());
        added(&mut passed.background, walked.background);
        passed.texels.add_all(walked.texels);
    }
    (passed.vertices, passed.attributes) = (vec![vertices], attributes);
    passed
}
