//! Walks over the pixel-face pairs of a band: for the largest weight of a pixel, for sums of weights, and for gradients.
//!
//! Loops run over numbers of corners and channels, as in `lanes`, so that all of them become vectors.
#![allow(clippy::needless_range_loop)]

use super::{
    depth::{DepthAt, cubic, pull_row},
    planes::Planes,
    point::{Barycentric, Point},
    scene::Blend,
    texture::{TEXEL_CHANNELS, TexelSums},
};
use crate::{
    face::Face,
    float::Float as _,
    lanes::{Lanes, Places, Work},
    list::{Chunk, LISTED, List},
    real::{Float, Real, everywhere, splat},
    scene::{BandRef, Scene},
    table,
};

/// Numbers of a face that a gradient has beside those of its attributes: x and y of three corners, then their depths.
pub(super) const CORNER_NUMBERS: usize = 9;

/// Stands for the logarithm of a weight of 0.
const HIDDEN: f64 = -1e30;

/// What the pairs of a face share beside its edges, in all lanes.
pub(super) struct FaceAttributes<T: Real> {
    planes: Barycentric<T>,
    /// The corners as they were given, by their places here.
    order: [usize; 3],
    /// One over the depth of each corner.
    per_depth: [T; 3],
    /// Attributes of the corners, number by number.
    attributes: Vec<[T; 3]>,
    /// Logarithm of its largest weight by depth.
    log: T::Lanes,
}

/// What a face is to eight pixels.
pub(super) struct Pair<T: Real> {
    point: Point<T>,
    /// Depth of the point.
    depth: T,
    /// Its barycentric weights on the face itself.
    weights: [T; 3],
    /// Logarithm of the edge softness, its derivative by the squared distance, and its place in the table.
    log_edge: T,
    edge_slope: T,
    edge_t: T,
    edge_row: Places,
    by_depth: DepthAt<T>,
}

impl<T: Real> Pair<T> {
    /// What lies at the point, of what lies at the corners.
    #[inline(always)]
    fn between(&self, [c0, c1, c2]: [T; 3]) -> T {
        let [w0, w1, w2] = self.weights;
        w0 * c0 + w1 * c1 + w2 * c2
    }

    /// Where a texture is seen, if there is one.
    #[inline(always)]
    fn place_on_texture(&self, shown: &FaceAttributes<T>) -> [T; 2] {
        [self.between(shown.attributes[0]), self.between(shown.attributes[1])]
    }
}

/// What is done to every pair.
pub(super) trait Visitor<T: Real> {
    /// Whether the pair at these places of the band counts for nothing.
    #[inline(always)]
    fn skips(&self, shown: &FaceAttributes<T>, at: [u32; 2]) -> bool {
        let _ = (shown, at);
        false
    }

    /// Takes a pair at these places of the band.
    fn pair(&mut self, blend: &Blend<T>, shown: &FaceAttributes<T>, pair: &Pair<T>, at: [u32; 2]);

    /// Has taken all pairs, or some of the last, of face `index` of the band.
    fn face(&mut self, scene: &Scene<T>, index: usize, shown: &FaceAttributes<T>) {
        let _ = (scene, index, shown);
    }
}

/// A walk over the pairs of a band.
pub(super) struct Walk<'a, 's, T: Real, V> {
    pub(super) blend: &'a Blend<'s, T>,
    pub(super) place: BandRef<'a, T>,
    pub(super) view: usize,
    /// Logarithm of the largest weight by depth of each face.
    pub(super) logs: &'a [f32],
    pub(super) visitor: &'a mut V,
}

impl<T: Real, V: Visitor<T>> Work for Walk<'_, '_, T, V> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (blend, place) = (self.blend, self.place);
        let mut list = List::new();
        let mut shown = FaceAttributes::new(blend.numbers);
        for (k, numbers) in place.view.faces(place.band).chunks(LISTED).enumerate() {
            list.fill(&blend.scene, &place, numbers);
            let mut of = None;
            for Chunk { places, at, owner } in list.chunks(0) {
                if of != Some(owner) {
                    if let Some(face) = of {
                        self.visitor.face(&blend.scene, k * LISTED + face, &shown);
                    }
                    shown.set(blend, &place, self.view, list.face(owner), numbers[owner]);
                    shown.log = splat(f64::from(self.logs[numbers[owner] as usize]));
                    of = Some(owner);
                }
                if self.visitor.skips(&shown, at) {
                    continue;
                }
                let (px, py) = T::Lanes::pixels(places);
                let pair = blend.pair(&place, list.face(owner), &shown, px, py);
                self.visitor.pair(blend, &shown, &pair, at);
            }
            if let Some(face) = of {
                self.visitor.face(&blend.scene, k * LISTED + face, &shown);
            }
        }
    }
}

impl<T: Real> FaceAttributes<T> {
    /// Room for a face with so many numbers at each corner.
    fn new(numbers: usize) -> Self {
        let one = T::constant(splat(1.0));
        Self {
            planes: Barycentric::nothing(),
            order: [0, 1, 2],
            per_depth: [one; 3],
            attributes: vec![[one; 3]; numbers],
            log: splat(0.0),
        }
    }

    /// Takes a face, whose number in the scene is given too.
    #[inline(always)]
    fn set(
        &mut self,
        blend: &Blend<T>,
        place: &BandRef<T>,
        view: usize,
        face: Face<T>,
        number: u32,
    ) {
        self.order = face.corners();
        let (corners, entries) =
            (blend.scene.faces[number as usize], blend.entries[number as usize]);
        let depths = 2 * (place.vertices.len() / 3);
        let first = blend.first_attribute(view);
        for k in 0..3 {
            let at = depths + corners[self.order[k]] as usize;
            self.per_depth[k] = T::inverse(everywhere(place.vertices, place.tangents, at));
            let start = first + entries[self.order[k]] as usize * blend.numbers;
            for (c, attribute) in self.attributes.iter_mut().enumerate() {
                attribute[k] = everywhere(blend.attributes[0], blend.attributes[1], start + c);
            }
        }
        self.planes = Barycentric::new(face, blend.least_area);
    }
}

impl<T: Real> Blend<'_, T> {
    /// What a face is to the pixels at `px`, `py`, from its origin.
    #[inline(always)]
    fn pair(
        &self,
        place: &BandRef<T>,
        face: Face<T>,
        shown: &FaceAttributes<T>,
        px: T::Lanes,
        py: T::Lanes,
    ) -> Pair<T> {
        let point = Point::new(face, &shown.planes, px, py);
        // 1 / z is what interpolates linearly on the screen.
        let [r0, r1, r2] = shown.per_depth;
        let [l0, l1, l2] = point.barycentric;
        let parts = [l0 * r0, l1 * r1, l2 * r2];
        let depth = T::inverse(parts[0] + parts[1] + parts[2]);
        let weights = [parts[0] * depth, parts[1] * depth, parts[2] * depth];

        // The table is that of the mirrored softness, so that its inner side is outside the face.
        let pick = <T::Lanes as Lanes>::pick;
        let zero = splat::<T::Lanes>(0.0);
        let outside = zero.less(pick(point.closest.inside, zero, splat(1.0)));
        let table::TablePosition { row: edge_row, t, rate } =
            self.scene.lookup.place::<T, true>(point.closest.distance2, outside);
        let [value, slope] = cubic(T::rows(place.table, &edge_row), t);
        let log_edge = T::constant(zero) - value;
        let edge_slope = slope.scale(rate.neg());
        let x = (T::constant(T::Lanes::splat(self.near)) - depth)
            .scale(T::Lanes::splat(self.per_range));
        let by_depth = self.depth.at(x);
        Pair { point, depth, weights, log_edge, edge_slope, edge_t: t, edge_row, by_depth }
    }

    /// Weights of pairs relative to those of the logarithm `largest`: all of it, and the part that the edge softness makes before its
    /// floor is taken off.
    #[inline(always)]
    fn weight(&self, pair: &Pair<T>, largest: T::Lanes) -> [T; 2] {
        let by_depth = pair.by_depth.log() - T::constant(largest);
        let whole = T::exponential(pair.log_edge + by_depth);
        if self.floor == Float::<T>::ZERO {
            return [whole, whole];
        }
        let rest = T::Lanes::splat(Float::<T>::ONE / (Float::<T>::ONE - self.floor));
        let floor = T::exponential(by_depth).scale(T::Lanes::splat(self.floor));
        let some = T::Lanes::splat(self.counts_from).less(pair.log_edge.value());
        [(whole - floor).scale(rest).masked(some), whole.scale(rest).masked(some)]
    }
}

/// Finds the logarithm of the largest weight of each pixel.
pub(super) struct Largest<'a, T: Real> {
    pub(super) largest: &'a mut Planes<T>,
}

impl<T: Real> Visitor<T> for Largest<'_, T> {
    #[inline(always)]
    fn pair(&mut self, blend: &Blend<T>, _: &FaceAttributes<T>, pair: &Pair<T>, at: [u32; 2]) {
        let log = (pair.log_edge + pair.by_depth.log()).value();
        // A face that does not count must make nothing else vanish.
        let some = T::Lanes::splat(blend.counts_from).less(pair.log_edge.value());
        self.largest.raise(at, <T::Lanes as Lanes>::pick(some, log, splat(HIDDEN)));
    }
}

/// Adds up weights, and weights times attributes.
pub(super) struct Sums<'a, T: Real> {
    pub(super) largest: &'a Planes<T>,
    /// The weights, then a plane for each channel.
    pub(super) sums: &'a mut Planes<T>,
}

impl<T: Real> Visitor<T> for Sums<'_, T> {
    #[inline(always)]
    fn pair(&mut self, blend: &Blend<T>, shown: &FaceAttributes<T>, pair: &Pair<T>, at: [u32; 2]) {
        let [weight, _] = blend.weight(pair, self.largest.groups(0, at).value());
        // Numbers so small that they lose digits take a hundred times as long to multiply.
        let weight = weight.masked(T::Lanes::splat(blend.vanishing).less(weight.value()));
        self.sums.add(0, at, weight);
        if let Some(texture) = &blend.texture {
            let seen = texture.sample(pair.place_on_texture(shown)).channels();
            for channel in 0..blend.channels {
                self.sums.add(1 + channel, at, weight * seen[channel % TEXEL_CHANNELS]);
            }
            return;
        }
        for (channel, &corners) in shown.attributes.iter().enumerate() {
            self.sums.add(1 + channel, at, weight * pair.between(corners));
        }
    }
}

/// Gradients of `Σ upstream · image` to a band's faces and to the tables.
pub(super) struct Pull<'a, T: Real> {
    pub(super) largest: &'a Planes<T>,
    /// One over the sum of all weights of a pixel; then what the image is, `Σ upstream · image` over the channels, less the upstream of
    /// the faces' share; then the logarithm of a weight that may be left out of that sum.
    pub(super) pixels: &'a Planes<T>,
    /// A plane for each channel.
    pub(super) upstream: &'a Planes<T>,
    /// For each face of the band [`CORNER_NUMBERS`] numbers, then three for each number of an attribute if the gradient to the attributes is wanted.
    pub(super) faces: &'a mut [Float<T>],
    pub(super) stride: usize,
    /// Gradients to the tables of edge and depth, if they are wanted.
    pub(super) tables: Option<&'a mut [Vec<[Float<T>; 4]>; 2]>,
    pub(super) corners: [T::Lanes; CORNER_NUMBERS],
    pub(super) attributes: Vec<[T::Lanes; 3]>,
    /// Gradient to the texels, if it is wanted.
    pub(super) texels: Option<&'a mut TexelSums<Float<T>>>,
}

impl<T: Real> Pull<'_, T> {
    /// Adds to the gradient of a number of the attributes, of a function with this derivative by it at the point of a pair.
    #[inline(always)]
    fn pull_attribute(&mut self, number: usize, by_number: T, pair: &Pair<T>) {
        if let Some(sums) = self.attributes.get_mut(number) {
            for k in 0..3 {
                sums[k] += (by_number * pair.weights[k]).output();
            }
        }
    }
}

/// Whether a mask holds nowhere.
#[inline(always)]
fn nowhere<L: Lanes>(mask: L::Mask) -> bool {
    L::bits(mask) == 0
}

impl<T: Real> Visitor<T> for Pull<'_, T> {
    #[inline(always)]
    fn skips(&self, shown: &FaceAttributes<T>, at: [u32; 2]) -> bool {
        // Now that the sums are known, what is hidden by nearer faces is known too.
        nowhere::<T::Lanes>(self.pixels.groups(2, at).value().less(shown.log))
    }

    #[inline(always)]
    fn pair(&mut self, blend: &Blend<T>, shown: &FaceAttributes<T>, pair: &Pair<T>, at: [u32; 2]) {
        let log = pair.log_edge.value() + pair.by_depth.log().value();
        let counts = self.pixels.groups(2, at).value().less(log);
        if nowhere::<T::Lanes>(counts) {
            return;
        }
        let weights = blend.weight(pair, self.largest.groups(0, at).value());
        let per_total = self.pixels.groups(0, at);
        let [share, of_edge] =
            [weights[0].masked(counts) * per_total, weights[1].masked(counts) * per_total];
        let zero = T::constant(splat(0.0));
        // How the objective changes with the attributes of the three corners, were the point there, and what it is at the point.
        let mut at_corners = [zero; 3];
        let (here, between);
        if let Some(texture) = &blend.texture {
            let sample = texture.sample(pair.place_on_texture(shown));
            let mut upstream = [splat(0.0); TEXEL_CHANNELS];
            for channel in 0..blend.channels {
                upstream[channel % TEXEL_CHANNELS] = self.upstream.groups(channel, at).value();
            }
            let [seen, by_u, by_v] = sample.pulled(upstream);
            let [u, v] = [shown.attributes[0], shown.attributes[1]];
            for k in 0..3 {
                at_corners[k] = by_u * u[k] + by_v * v[k];
            }
            for (number, by_place) in [by_u, by_v].into_iter().enumerate() {
                self.pull_attribute(number, share * by_place, pair);
            }
            if let Some(texels) = &mut self.texels {
                sample.pull_texels(share, upstream, texels);
            }
            (here, between) = (seen, pair.between(at_corners));
        } else {
            for (channel, values) in shown.attributes.iter().enumerate() {
                let upstream = self.upstream.groups(channel, at).value();
                for k in 0..3 {
                    at_corners[k] = at_corners[k] + values[k].scale(upstream);
                }
                self.pull_attribute(channel, share.scale(upstream), pair);
            }
            between = pair.between(at_corners);
            here = between;
        }
        // A share draws the image from what it is towards what the face shows.
        let draw = here - self.pixels.groups(1, at);
        let (by_edge, by_depth) = (of_edge * draw, share * draw);
        let by_place = by_depth * pair.by_depth.slope();
        // The nearness falls as the depth grows.
        let by_z = by_place.scale(T::Lanes::splat(blend.per_range).neg());
        // d z / d λₖ = -z² / zₖ, and the weights on the face are λₖ z / zₖ: so both change by λₖ as by its share of 1 / z.
        let mut by_part = [zero; 3];
        for k in 0..3 {
            by_part[k] = pair.depth * (share * (at_corners[k] - between) - pair.depth * by_z);
        }
        let [r0, r1, r2] = shown.per_depth;
        let by_barycentric = [by_part[0] * r0, by_part[1] * r1, by_part[2] * r2];
        let moved = pair.point.pulled(&shown.planes, by_edge * pair.edge_slope, by_barycentric);
        for k in 0..6 {
            self.corners[k] += moved[k].output();
        }
        for k in 0..3 {
            let per_depth = shown.per_depth[k];
            let by_depth = by_part[k] * pair.point.barycentric[k] * per_depth * per_depth;
            self.corners[6 + k] += (zero - by_depth).output();
        }
        if let Some(tables) = &mut self.tables {
            let [edge, depth] = &mut **tables;
            pull_row(zero - by_edge, pair.edge_t, &pair.edge_row, edge);
            pair.by_depth.pull(by_depth, depth);
        }
    }

    #[inline(always)]
    fn face(&mut self, scene: &Scene<T>, index: usize, shown: &FaceAttributes<T>) {
        // From pixels, with y down, to NDC.
        let [right, down] = [scene.half, -scene.half].map(Float::<T>::from_f64);
        let own = &mut self.faces[index * self.stride..(index + 1) * self.stride];
        for k in 0..3 {
            let corner = shown.order[k];
            own[2 * corner] += self.corners[2 * k].sum() * right;
            own[2 * corner + 1] += self.corners[2 * k + 1].sum() * down;
            own[6 + corner] += self.corners[6 + k].sum();
            for (number, sums) in self.attributes.iter_mut().enumerate() {
                own[CORNER_NUMBERS + 3 * number + corner] += sums[k].sum();
                sums[k] = splat(0.0);
            }
        }
        self.corners = [splat(0.0); CORNER_NUMBERS];
    }
}
