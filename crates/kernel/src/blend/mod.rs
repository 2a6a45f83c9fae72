//! Colours of faces that share pixels, weighted by their edges and depths: the image, its gradient, and the gradient of that.
//!
//! `C = (Σ wⱼ cⱼ + w c) / (Σ wⱼ + w)` with `ln wⱼ = ln s(dⱼ) + ln b(zⱼ)`, both from tables. Each band is walked for the sums, and once
//! more for the gradient; where weights of a pixel may differ by more than floats can hold, first for the largest of each pixel. As in
//! the sums of profiles, all is written once for any `Real`.
#![allow(clippy::needless_range_loop)]

mod depth;
mod point;
mod quads;
mod reach;
mod scene;
mod texture;
mod walk;

use std::sync::OnceLock;

use rayon::prelude::*;

pub use self::{
    depth::{DepthGrid, LEAST},
    point::AREA,
    scene::{Inputs, NOTHING, counts_from},
    texture::TEXEL_CHANNELS,
};
use self::{
    quads::{QUAD, Quads},
    reach::Reached,
    scene::{Blend, of_type},
    texture::TexelSums,
    walk::{CORNER_NUMBERS, Largest, Pull, Sums, Visitor, Walk},
};
use super::{
    bands::View,
    float::{self, Vectors},
    lanes::{LANES, Lanes, Plain, Work, has_vectors, run},
    real::{Dual, Float, Real, splat},
    scene::BandRef,
    tasks::task,
};

/// Logarithm of the largest ratio of two weights that floats of 32 and of 64 bits add up without losing the sum.
const RANGE: [f64; 2] = [60.0, 600.0];

/// What passes over the same inputs share.
pub struct Kept<F> {
    reached: Reached,
    /// Those of each band of each view, once an image has been drawn; nothing where no pass follows that would need them.
    sums: Vec<OnceLock<BandSums<F>>>,
}

/// Sums over the faces at the pixels of a band.
struct BandSums<F> {
    /// Logarithms that weights are relative to: none is so much larger or smaller than that of a pixel's sum that it could not be told.
    largest: Vec<F>,
    /// Of the weights, then of each channel.
    sums: Quads<F>,
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
    let tangents = [&[][..]; 5];
    if has_vectors() {
        passes::<F::Best>(inputs, &inputs.blend(tangents), kept, None).image()
    } else {
        passes::<Plain<F>>(inputs, &inputs.blend(tangents), kept, None).image()
    }
}

/// See [`Kernels::blend_vjp`](crate::Kernels::blend_vjp).
pub(crate) fn vjp<F: Vectors>(
    inputs: &Inputs<F>,
    kept: &Kept<F>,
    upstream: &[F],
    wanted: [bool; 5],
) -> Vec<F> {
    let tangents = [&[][..]; 5];
    let pull = Some((upstream, wanted));
    if has_vectors() {
        passes::<F::Best>(inputs, &inputs.blend(tangents), kept, pull).gradient(wanted)
    } else {
        passes::<Plain<F>>(inputs, &inputs.blend(tangents), kept, pull).gradient(wanted)
    }
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
    let still: [Vec<F>; 5] =
        std::array::from_fn(|k| vec![F::ZERO; if along[k] { 0 } else { of_inputs[k].len() }]);
    let mut direction = direction;
    let tangents = std::array::from_fn(|k| {
        if !along[k] {
            return &still[k][..];
        }
        let (own, rest) = direction.split_at(of_inputs[k].len());
        direction = rest;
        own
    });
    let [wanted @ .., to_upstream] = wanted;
    let pull = Some((upstream, wanted));
    let passed = if has_vectors() {
        passes::<Dual<F::Best>>(inputs, &inputs.blend(tangents), kept, pull)
    } else {
        passes::<Dual<Plain<F>>>(inputs, &inputs.blend(tangents), kept, pull)
    };
    let image = if to_upstream { passed.image() } else { Vec::new() };
    let mut gradient = passed.gradient(wanted);
    gradient.extend(image);
    gradient
}

/// What the bands of a view, and then all views, give back. Of dual numbers all are tangents.
struct Passed<F> {
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

/// Runs all bands, with their gradients if there is an upstream; everything is added up in the order of views and bands.
fn passes<T: Real>(
    inputs: &Inputs<Float<T>>,
    blend: &Blend<T>,
    kept: &Kept<Float<T>>,
    pull: Option<(&[Float<T>], [bool; 5])>,
) -> Passed<Float<T>> {
    let zero = <Float<T> as float::Float>::ZERO;
    let Kept { reached, sums } = kept;
    let bands = &reached.bands;
    let views = bands.views.len();
    let of_image = (blend.channels + 1) * inputs.size.pixels();
    let with_image = pull.is_none() || T::DUAL;
    let per_view: Vec<_> = (0..views)
        .into_par_iter()
        .map(|view| {
            let upstream = pull.map(|(upstream, wanted)| {
                (&upstream[view * of_image..(view + 1) * of_image], wanted)
            });
            let walked: Vec<_> = (0..bands.count)
                .into_par_iter()
                .map(|band| {
                    let work = Band {
                        blend,
                        of_view: &bands.views[view],
                        views,
                        view,
                        band,
                        logs: &reached.logs[view],
                        least: reached.least,
                        kept: sums.get(view * bands.count + band),
                        upstream,
                    };
                    task(if pull.is_some() { "pull of a band" } else { "image of a band" }, || {
                        run::<T::Lanes, _>(work)
                    })
                })
                .collect();
            let wanted = pull.map(|(_, wanted)| wanted);
            task("gather", || gather(blend, inputs, &bands.views[view], walked, with_image, wanted))
        })
        .collect();
    let mut passed = Passed {
        images: Vec::new(),
        vertices: Vec::new(),
        attributes: vec![zero; if pull.is_some() { inputs.attributes.len() } else { 0 }],
        tables: Vec::new(),
        background: Vec::new(),
        texels: blend.no_texels(pull.is_some_and(|(_, wanted)| wanted[4])),
    };
    for (index, mut view) in per_view.into_iter().enumerate() {
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

/// Adds numbers to as many.
fn add<F: float::Float>(total: &mut [F], part: &[F]) {
    total.iter_mut().zip(part).for_each(|(total, &part)| *total += part);
}

/// The same where there may be no total yet.
fn added<F: float::Float>(total: &mut Vec<F>, part: Vec<F>) {
    match total.is_empty() {
        true => *total = part,
        false => add(total, &part),
    }
}

/// What one band gives back.
struct Walked<F> {
    /// Rows of the image, plane by plane, as they stand in the image.
    image: Vec<Vec<F>>,
    faces: Vec<F>,
    tables: [Vec<[F; 4]>; 2],
    background: Vec<F>,
    texels: TexelSums<F>,
}

/// Adds up the bands of a view in their order.
fn gather<T: Real>(
    blend: &Blend<T>,
    inputs: &Inputs<Float<T>>,
    view: &View,
    walked: Vec<Walked<Float<T>>>,
    with_image: bool,
    wanted: Option<[bool; 5]>,
) -> Passed<Float<T>> {
    let zero = <Float<T> as float::Float>::ZERO;
    let (channels, numbers) = (blend.channels, blend.numbers);
    let mut image = Vec::new();
    if with_image {
        for plane in 0..=channels {
            walked.iter().for_each(|band| image.extend_from_slice(&band.image[plane]));
        }
    }
    let mut passed = Passed {
        images: vec![image],
        vertices: Vec::new(),
        attributes: Vec::new(),
        tables: Vec::new(),
        background: Vec::new(),
        texels: blend.no_texels(wanted.is_some_and(|wanted| wanted[4])),
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

/// One band of one view.
struct Band<'a, 's, T: Real> {
    blend: &'a Blend<'s, T>,
    of_view: &'a View,
    views: usize,
    view: usize,
    band: usize,
    /// Logarithm of the largest weight by depth of each face.
    logs: &'a [f32],
    /// Logarithm of what may be left out of a pixel of each face, as a part of the weights there.
    least: f64,
    kept: Option<&'a OnceLock<BandSums<Float<T>>>>,
    /// `[channels + 1, height, width]`, and what gradients are wanted.
    upstream: Option<(&'a [Float<T>], [bool; 5])>,
}

impl<T: Real> Work for Band<'_, '_, T> {
    type Output = Walked<Float<T>>;

    #[inline(always)]
    fn run(self) -> Walked<Float<T>> {
        let blend = self.blend;
        let (scene, channels) = (&blend.scene, blend.channels);
        let zero = <Float<T> as float::Float>::ZERO;
        let length = self.place().length(scene);
        let padded = length.next_multiple_of(LANES);
        // Those that are kept have no tangents.
        let kept = self.kept.filter(|_| !T::DUAL);
        let own;
        let BandSums { largest, sums } = match kept {
            Some(kept) => {
                if kept.get().is_none() {
                    // Another walk may have been as quick; its sums are the same.
                    let _ = kept.set(self.summed(length));
                }
                kept.get().expect("it was set")
            }
            None => {
                own = self.summed(length);
                &own
            }
        };
        let upstream = self.upstream.map(|(upstream, _)| self.padded(upstream, length));
        let with_image = self.upstream.is_none() || T::DUAL;
        let mut image = vec![zero; if with_image { (channels + 1) * largest.len() } else { 0 }];
        let of_pixels = if upstream.is_some() { length } else { 0 };
        let mut pixels = Quads::new(QUAD, of_pixels, T::DUAL);
        let mut limits = vec![zero; of_pixels.next_multiple_of(LANES)];
        // What each channel of the background gets.
        let mut background = vec![splat::<T::Lanes>(0.0); channels + 1];
        let mut seen = vec![T::constant(splat(0.0)); channels + 1];
        let log_weight = blend.behind(channels);
        for (k, largest) in largest.as_chunks().0.iter().enumerate() {
            let largest = T::Lanes::of(largest);
            let behind = T::exponential(log_weight - T::constant(largest));
            let mut sum = T::constant(splat(0.0));
            let (mut per_total, mut rest) = (sum, sum);
            for (number, quad) in (0..channels + 1).step_by(QUAD).zip(0..) {
                for (number, own) in (number..=channels).zip(sums.vector(quad, k)) {
                    if number == 0 {
                        sum = own;
                        per_total = T::inverse(sum + behind);
                        rest = behind * per_total;
                        seen[channels] = sum * per_total;
                    } else {
                        seen[number - 1] = own * per_total + rest * blend.behind(number - 1);
                    }
                }
            }
            if with_image {
                for (plane, seen) in image.chunks_exact_mut(padded).zip(&seen) {
                    plane[k * LANES..(k + 1) * LANES].copy_from_slice(&seen.output().array());
                }
            }
            let Some(upstream) = &upstream else { continue };
            let mut whole = T::constant(splat(0.0));
            let (mut alone, mut of_share) = (whole, splat(0.0));
            for (first, quad) in (0..channels + 1).step_by(QUAD).zip(0..) {
                for (channel, upstream) in (first..=channels).zip(upstream.vector::<T>(quad, k)) {
                    let upstream = upstream.value();
                    whole = whole + seen[channel].scale(upstream);
                    if channel == channels {
                        of_share = upstream;
                    } else {
                        alone = alone + blend.behind(channel).scale(upstream);
                        background[channel] += rest.scale(upstream).output();
                    }
                }
            }
            background[channels] += (rest * (alone - whole)).output();
            let image = whole - T::constant(of_share);
            let total = (sum + behind).value().ln();
            let total = total + largest + splat(self.least);
            pixels.set(k, [T::constant(largest), per_total, image, T::constant(total)]);
            limits[k * LANES..(k + 1) * LANES].copy_from_slice(&total.array());
        }
        let mut walked = Walked {
            image: image.chunks_exact(padded).map(|plane| self.trimmed(plane)).collect(),
            faces: Vec::new(),
            tables: [Vec::new(), Vec::new()],
            background: background.into_iter().map(Lanes::sum).collect(),
            texels: blend.no_texels(self.upstream.is_some_and(|(_, wanted)| wanted[4])),
        };
        if let (Some(upstream), Some((_, wanted))) = (&upstream, self.upstream) {
            self.pull(&pixels, &limits, upstream, wanted, &mut walked);
        }
        walked
    }
}

impl<T: Real> Band<'_, '_, T> {
    fn place(&self) -> BandRef<'_, T> {
        self.blend.scene.place(self.of_view, self.view, self.views, self.band)
    }

    #[inline(always)]
    fn walk<V: Visitor<T>>(&self, visitor: &mut V) {
        let place = self.place();
        Walk { blend: self.blend, place, view: self.view, logs: self.logs, visitor }.run();
    }

    #[inline(always)]
    fn summed(&self, length: usize) -> BandSums<Float<T>> {
        let largest = self.largest(length);
        let mut sums = Quads::new(1 + self.blend.channels, length, T::DUAL);
        self.walk(&mut Sums { largest: &largest, sums: &mut sums });
        BandSums { largest, sums }
    }

    /// See [`BandSums`].
    #[inline(always)]
    fn largest(&self, length: usize) -> Vec<Float<T>> {
        let blend = self.blend;
        let behind = blend.background[0][blend.channels];
        let number = <Float<T> as float::Float>::from_f64;
        let length = length.next_multiple_of(LANES);
        // No weight is larger than this, and the background is always there: so one number does for all pixels.
        let faces = self.of_view.faces(self.band).iter();
        let highest = faces.map(|&face| self.logs[face as usize]).fold(f32::MIN, f32::max);
        let highest = number(f64::from(highest));
        if highest <= behind + number(of_type::<Float<T>>(RANGE)) {
            return vec![if highest > behind { highest } else { behind }; length];
        }
        let mut largest = vec![behind; length];
        self.walk(&mut Largest { largest: &mut largest });
        largest
    }

    #[inline(always)]
    fn pull(
        &self,
        pixels: &Quads<Float<T>>,
        limits: &[Float<T>],
        upstream: &Quads<Float<T>>,
        [_, of_attributes, of_tables, _, of_texels]: [bool; 5],
        walked: &mut Walked<Float<T>>,
    ) {
        let zero = <Float<T> as float::Float>::ZERO;
        let numbers = if of_attributes { self.blend.numbers } else { 0 };
        let stride = CORNER_NUMBERS + 3 * numbers;
        walked.faces = vec![zero; self.of_view.faces(self.band).len() * stride];
        let rows = [self.blend.scene.grid.rows(), self.blend.depth.rows()];
        let mut tables = rows.map(|rows| vec![[zero; 4]; if of_tables { rows } else { 0 }]);
        self.walk(&mut Pull {
            pixels,
            limits,
            upstream,
            faces: &mut walked.faces,
            stride,
            tables: of_tables.then_some(&mut tables),
            corners: [splat(0.0); CORNER_NUMBERS],
            attributes: vec![[splat(0.0); 3]; numbers],
            texels: of_texels.then_some(&mut walked.texels),
            owner: None,
        });
        walked.tables = tables;
    }

    /// The band's rows of an upstream, followed by zeros.
    fn padded(&self, upstream: &[Float<T>], length: usize) -> Quads<Float<T>> {
        let scene = &self.blend.scene;
        let (width, rows) = (scene.size.width, self.of_view.rows(self.band));
        let mut padded = Quads::new(self.blend.channels + 1, length, false);
        for (number, upstream) in upstream.chunks_exact(scene.size.pixels()).enumerate() {
            let own = &upstream[rows.start * width..rows.end * width];
            for (row, own) in own.chunks(width).enumerate() {
                padded.set_values(number, row * scene.stride(), own);
            }
        }
        padded
    }

    /// The band's rows as they stand in the image.
    fn trimmed(&self, padded: &[Float<T>]) -> Vec<Float<T>> {
        let scene = &self.blend.scene;
        let (width, rows) = (scene.size.width, self.of_view.rows(self.band).len());
        let padded = padded.chunks(scene.stride()).take(rows);
        padded.flat_map(|row| &row[..width]).copied().collect()
    }
}
